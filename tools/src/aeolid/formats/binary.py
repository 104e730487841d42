"""Read OpenFAST's binary output; the library of its authors makes a Python object of each number, 35 bytes for two."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_names, guard_size
from aeolid.formats.table import Choose, Table, positions, unreadable
from aeolid.inputs import open_regular, regular_size

_KIND = "OpenFAST binary output"
_WITH_TIME, _WITHOUT_TIME, _PLAIN, _NAME_LENGTH = 1, 2, 3, 4  # kinds of file


@dataclass(frozen=True)
class _Head:
    """Say what the file announces: samples and channels (time not counted), characters of a name, scales of time."""

    kind: int
    width: int
    channels: int
    rows: int
    first: float  # seconds; scale of the packed time where the kind has one
    second: float  # step in seconds; offset of the packed time


def read_outb(path: Path, choose: Choose) -> Table:
    """Read OpenFAST binary output, all four kinds; names and units stand in the file."""
    size = regular_size(path)
    with open_regular(path) as handle:
        try:
            head = _head(path, handle, size)
            scale, offset = _scales(handle, head)
            (described,) = struct.unpack("<i", _take(handle, 4))
            if not 0 <= described <= size:
                raise ValueError("the length of its description is impossible")
            handle.seek(described, 1)
            names, units = (_texts(handle, head) for _ in range(2))
            guard_names(path, names)
            wanted = choose(names, names[0])
            guard_size(path, 8 * head.rows * (len(wanted) + 1))
            time = _time(path, names[0], handle, head)
            data = _samples(handle, head)
        except (struct.error, ValueError, OverflowError) as error:
            raise unreadable(path, _KIND, error) from None
    columns = {}
    for name, place in zip(wanted, positions(names, wanted), strict=True):
        if place == 0:
            columns[name] = time
        elif head.kind == _PLAIN:
            columns[name] = np.ascontiguousarray(data[:, place - 1], dtype=np.float64)
        else:
            _require_scale(path, name, scale[place - 1], offset[place - 1])
            columns[name] = (data[:, place - 1] - offset[place - 1]) / scale[place - 1]
    marks = (unit[1:-1] if unit[:1] == "(" and unit[-1:] == ")" else unit for unit in units)  # (m/s)
    return Table(str(path), names, columns, dict(zip(names, marks, strict=True)), names[0])


def _head(path: Path, handle: BinaryIO, size: int) -> _Head:
    """Read the head, and compare what it announces with the size of the file before anything is taken for it."""
    (kind,) = struct.unpack("<h", _take(handle, 2))
    width = struct.unpack("<h", _take(handle, 2))[0] if kind == _NAME_LENGTH else 10
    channels, rows, first, second = struct.unpack("<iidd", _take(handle, 24))
    if kind not in (_WITH_TIME, _WITHOUT_TIME, _PLAIN, _NAME_LENGTH) or channels < 1 or rows < 0 or width < 1:
        raise ValueError("unknown head")
    needed = rows * channels * (8 if kind == _PLAIN else 2) + 2 * width * (channels + 1)
    if needed + (4 * rows if kind == _WITH_TIME else 0) > size:
        raise DataError(
            f"{path}: {rows} samples of {channels} channels are announced, the file is too short for them;"
            f" the simulation was cut off or the file copied in part"
        )
    if channels > MOST_CHANNELS:
        raise DataError(f"{path}: {channels} channels are announced; at most {MOST_CHANNELS} are read")
    return _Head(kind, width, channels, rows, first, second)


def _scales(handle: BinaryIO, head: _Head) -> tuple[np.ndarray, np.ndarray]:
    if head.kind == _PLAIN:
        return np.ones(head.channels), np.zeros(head.channels)
    with np.errstate(invalid="ignore"):  # a signalling NaN, refused where it is used
        both = np.frombuffer(_take(handle, 8 * head.channels), "<f4").astype(np.float64)
    return both[: head.channels], both[head.channels :]


def _require_scale(path: Path, name: str, scale: float, offset: float) -> None:
    """Refuse a channel whose packed numbers mean no value: value = (packed - offset) / scale."""
    if not np.isfinite(scale) or scale == 0.0 or not np.isfinite(offset):
        raise DataError(
            f"{path}: channel {name!r} has the scale {scale:g} and the offset {offset:g}, which give no values;"
            " the file is damaged, copy it or run the simulation again"
        )


def _texts(handle: BinaryIO, head: _Head) -> tuple[str, ...]:
    """Read one text of fixed width for the time and each channel."""
    block = _take(handle, head.width * (head.channels + 1)).decode("latin-1")
    return tuple(block[i : i + head.width].strip() for i in range(0, len(block), head.width))


def _time(path: Path, name: str, handle: BinaryIO, head: _Head) -> np.ndarray:
    if head.kind == _WITH_TIME:
        _require_scale(path, name, head.first, head.second)
        packed = np.frombuffer(_take(handle, 4 * head.rows), "<i4")
        with np.errstate(over="ignore"):  # refused as infinite
            return (packed - head.second) / np.float64(head.first)
    if not np.isfinite(head.first + head.second * head.rows):
        raise DataError(
            f"{path}: its time begins at {head.first:g} s in steps of {head.second:g} s;"
            " the file is damaged, copy it or run the simulation again"
        )
    return head.first + head.second * np.arange(head.rows, dtype=np.float64)


def _samples(handle: BinaryIO, head: _Head) -> np.ndarray:
    dtype = np.dtype("<f8" if head.kind == _PLAIN else "<i2")
    count = head.rows * head.channels
    return np.frombuffer(_take(handle, count * dtype.itemsize), dtype).reshape(head.rows, head.channels)


def _take(handle: BinaryIO, count: int) -> bytes:
    content = handle.read(count)
    if len(content) < count:
        raise ValueError("it ends too early")
    return content
