"""Read text that may be packed by gzip, and let it unpack no further than its bound."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from aeolid.errors import DataError
from aeolid.formats.bounds import FACTOR, FLOOR, MIB, MOST_LINE, content_limit
from aeolid.formats.spool import PART_SUFFIX, end_of_lines, whole_lines
from aeolid.inputs import open_regular

GZIP = b"\x1f\x8b"  # how packed data begin


def open_text(path: Path) -> BinaryIO:
    """Open a text file for reading as bytes, unpacked where it is packed, whatever its suffix.

    Reading raises DataError where the packed data are damaged or unpack beyond `content_limit`.
    """
    handle = open_regular(path)
    if path.name.endswith(PART_SUFFIX):  # of a recording that is under way, or whose recorder was killed
        handle.close()
        return whole_lines(path)
    if handle.peek(2)[:2] != GZIP:  # type: ignore[attr-defined] # buffered, by fdopen
        return handle
    return cast(BinaryIO, io.BufferedReader(_Unpacked(path, handle), 1 << 16))


@contextmanager
def open_native(path: Path) -> Iterator[Any]:
    """Open a text file as `open_text` does, as a stream of Arrow's own that calls no Python while it is read.

    Arrow reads ahead on a thread of its own, and where that calls Python while the work has ended the process ends with
    a signal. Packed data are to have been read to their end by `open_text` before, for their bound and their faults;
    where Arrow finds a fault that Python does not, reading raises OSError.
    """
    import pyarrow as pa

    with open_regular(path) as handle:
        packed = handle.peek(2)[:2] == GZIP  # type: ignore[attr-defined] # buffered, by fdopen
    with ExitStack() as opened:
        file = opened.enter_context(pa.OSFile(str(path)))
        if path.name.endswith(PART_SUFFIX):
            file = opened.enter_context(file.get_stream(0, end_of_lines(path)))
        elif packed:
            file = opened.enter_context(pa.CompressedInputStream(file, "gzip"))
        yield file


@contextmanager
def open_unpacked(path: Path) -> Iterator[Any]:
    """Open the unpacked content of a text file in memory, for what `open_native` fails on: zeros behind packed data."""
    import pyarrow as pa

    with open_text(path) as handle:
        content = handle.read()
    yield pa.BufferReader(content)


def bounded_lines(path: Path, handle: BinaryIO) -> Iterator[bytes]:
    """Yield lines with their ends; raises DataError at one longer than MOST_LINE."""
    number = 0
    while line := handle.readline(MOST_LINE + 1):
        number += 1
        if len(line) > MOST_LINE:
            raise DataError(f"{path}: line {number} is longer than {MOST_LINE // MIB} MiB; this is not a text table")
        yield line


class _Unpacked(io.RawIOBase):
    """Unpack gzip, counting."""

    def __init__(self, path: Path, handle: BinaryIO) -> None:
        self._path, self._below = path, handle
        self._file = gzip.GzipFile(fileobj=handle)
        self._left = self._most = content_limit(path)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object) -> int:
        view = memoryview(buffer).cast("B")  # type: ignore[arg-type] # what io hands over is a buffer
        try:
            piece = self._file.read1(len(view))
        except (EOFError, OSError, zlib.error) as error:
            cause = str(error).split("\n")[0]
            raise DataError(f"{self._path}: the gzip data are cut off or damaged ({cause}); copy it again") from None
        self._left -= len(piece)
        if self._left < 0:
            raise DataError(
                f"{self._path}: it unpacks into more than the {self._most / MIB:.0f} MiB that a file of its size may"
                f" ({FLOOR // MIB} MiB and {FACTOR} times its size); unpack or split the recording"
            )
        view[: len(piece)] = piece
        return len(piece)

    def close(self) -> None:
        self._file.close()
        self._below.close()
        super().close()
