"""Read NumPy archives (.npz): each array is checked against the archive before memory is taken for it."""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.formats.arrays import table_of_arrays
from aeolid.formats.bounds import MOST_CHANNELS, guard_size
from aeolid.formats.table import Choose, Table, unreadable
from aeolid.inputs import open_regular

_KIND = "NumPy archive"
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # what NumPy writes; others unpack without a bound on memory
_NUMBERS, _TEXT = "biufc", "US"


@dataclass(frozen=True)
class _Array:
    """Say where one array stands in the archive and what it is."""

    entry: zipfile.ZipInfo
    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype[Any]
    start: int


class Archive:
    """Hold an open .npz; `shapes` of its arrays are known, the arrays are read when asked for.

    Raises DataError, here and in `load`, for whatever is not an archive of numbers and text, or larger than it may be.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path
        self._handle: BinaryIO = open_regular(path)
        try:
            self._zip = zipfile.ZipFile(self._handle)
            self._arrays = self._index()
        except DataError:
            self._handle.close()
            raise
        except Exception as error:  # parsers of a damaged file raise anything
            self._handle.close()
            raise unreadable(path, _KIND, error) from None

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._handle.close()

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of each array."""
        return {name: array.shape for name, array in self._arrays.items()}

    def load(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Read these arrays; raises DataError where one is missing, or neither numbers nor text."""
        wanted = list(names)
        missing = next((name for name in wanted if name not in self._arrays), None)
        if missing is not None:
            raise DataError(f"{self.path}: no array {missing!r} in it")
        guard_size(self.path, sum(self._arrays[name].entry.file_size for name in wanted))
        return {name: self._read(name, self._arrays[name]) for name in wanted}

    def _index(self) -> dict[str, _Array]:
        entries = self._zip.infolist()
        if len(entries) > MOST_CHANNELS:
            raise DataError(f"{self.path}: {len(entries)} arrays; at most {MOST_CHANNELS} are read")
        found = {}
        for entry in entries:
            if entry.filename.endswith(".npy"):
                if entry.filename.removesuffix(".npy") in found:
                    raise DataError(f"{self.path}: {entry.filename} stands in it twice; keep one of the two")
                found[entry.filename.removesuffix(".npy")] = self._head(entry)
        return found

    def _head(self, entry: zipfile.ZipInfo) -> _Array:
        """Read what one array says it is, and compare it with the bytes there are."""
        if entry.compress_type not in _METHODS or entry.flag_bits & 1:
            raise ValueError(f"{entry.filename} is encrypted or packed in a way that NumPy does not write")
        with self._zip.open(entry) as member, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of headers that Python 2 wrote
            version = npy.read_magic(member)
            read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
            if read is None:
                raise ValueError(f"{entry.filename} has version {version} of the layout")
            shape, fortran, dtype = read(member)
            start = member.tell()
        needed = math.prod(shape) * max(dtype.itemsize, shape != ())
        if any(type(n) is not int or n < 0 for n in shape) or needed > entry.file_size - start:
            raise ValueError(f"{entry.filename} announces shape {shape}, which it does not hold")
        return _Array(entry, shape, fortran, dtype, start)

    def _read(self, name: str, array: _Array) -> NDArray[Any]:
        if array.dtype.kind not in _NUMBERS + _TEXT:
            raise DataError(f"{self.path}: {name!r} holds neither numbers nor text")
        try:
            with self._zip.open(array.entry) as member:
                member.seek(array.start)
                content = member.read()  # the whole rest, so that its checksum is compared
            if array.dtype.kind == "U":
                _require_text(content, array)
            flat = np.frombuffer(content, array.dtype, math.prod(array.shape)) if array.dtype.itemsize else None
            if flat is None:
                return np.zeros(array.shape, array.dtype)
            return flat.reshape(array.shape, order="F" if array.fortran else "C")
        except Exception as error:  # as in __init__
            raise unreadable(self.path, _KIND, error) from None


def _require_text(content: bytes, array: _Array) -> None:
    """Refuse text that is none; NumPy holds any 32 bits as a character, and Python ends in an error of its own."""
    characters = array.dtype.itemsize // 4 * math.prod(array.shape)
    codes = np.frombuffer(content, array.dtype.byteorder.replace("|", "=") + "u4", characters)
    if np.any((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))):
        raise ValueError(f"{array.entry.filename} holds no text")


def read_npz(path: Path, choose: Choose) -> Table:
    """Read a NumPy archive: one array a channel; the columns of a matrix `y` are called y1, y2, …"""
    with Archive(path) as archive:
        return table_of_arrays(path, archive.shapes, archive.load, choose)
