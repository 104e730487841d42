"""Keep rows of a growing table on the disk as text that is readable at any moment, also after the process was killed.

Rows that may still change are on the disk too, behind those that are final. What stands there already is never written
again where it stays the same, so that a kill can tear nothing but the last line, and a line that is not ended is left
out by `whole_lines`.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from aeolid.formats.spare import SpareFile
from aeolid.formats.table import Array

PART_SUFFIX = ".part.csv"  # of a table under way
_BLOCK = 1 << 22  # bytes read at a time
_FEW = 400  # values up to which Arrow's own time is longer than that of the interpreter
_AT_FIRST = 200_000  # values of a file before Arrow is worth its loading: 0.5 s, pandas with it


class TextSpool:
    """Append rows to a text file; the last of them may be replaced as long as they are not final."""

    def __init__(self, path: Path, heading: bytes) -> None:
        """Create the file. Raises OSError."""
        self.path = path
        self._raw = SpareFile(path)
        self._final = 0  # bytes that stay
        self._rest = b""  # what follows them on the disk
        self._values = 0  # that became text
        self._put(heading, True)

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""
        return self._raw.full

    @property
    def size(self) -> int:
        """Return the bytes on the disk."""
        return self._final + len(self._rest)

    def append(self, rows: Array) -> None:
        """Add rows (n, columns) that stay. Raises OSError."""
        if len(rows):
            self._put(self._to_text(rows), True)

    def show(self, rows: Array) -> None:
        """Put rows (n, columns) behind those that stay, instead of those shown before. Raises OSError."""
        self._put(self._to_text(rows) if len(rows) else b"", False)

    def _to_text(self, rows: Array) -> bytes:
        self._values += rows.size
        return to_text(rows, _FEW if self._values > _AT_FIRST else _AT_FIRST)

    def _put(self, text: bytes, final: bool) -> None:
        same = _common(self._rest, text)
        if final and same == len(text):  # there already
            self._final, self._rest = self._final + same, self._rest[same:]
            return
        if same < len(self._rest):
            self._raw.truncate(self._final + same)
            self._rest = self._rest[:same]
        self._raw.seek(self._final + same)
        left = memoryview(text)[same:]
        while left:
            left = left[self._raw.write(left) :]
        if final:
            self._final, self._rest = self._final + len(text), b""
        else:
            self._rest = text

    def close(self) -> None:
        """Leave only what is final. Raises OSError."""
        if not self._raw.closed:
            self._raw.truncate(self._final)
            self._raw.close()


def _common(a: bytes, b: bytes) -> int:
    """Count the bytes with which both begin."""
    n = min(len(a), len(b))
    if a[:n] == b[:n]:
        return n
    return int(np.argmax(np.frombuffer(a, np.uint8, n) != np.frombuffer(b, np.uint8, n)))


def to_text(rows: Array, few: int = _FEW) -> bytes:
    """Write rows (n, columns) as lines of CSV; a missing number is an empty cell, others come back bit for bit.

    few: values up to which the interpreter writes them, more are written by Arrow.
    """
    empty_cells = rows.shape[1] > 1  # alone in its row an empty cell would be an empty line, which readers skip
    if rows.size <= few:
        missing = "" if empty_cells else "nan"
        lines = (",".join(missing if x != x else repr(x).removesuffix(".0") for x in row) for row in rows.tolist())
        return "".join(line + "\n" for line in lines).encode()
    import pyarrow as pa
    from pyarrow import csv

    columns = [pa.array(np.ascontiguousarray(column), from_pandas=empty_cells) for column in rows.T]
    table = pa.table(columns, names=[str(i) for i in range(len(columns))])
    sink = pa.BufferOutputStream()
    csv.write_csv(table, sink, csv.WriteOptions(include_header=False))
    return cast(bytes, sink.getvalue().to_pybytes())


def read_spool(path: Path, names: Sequence[str]) -> Iterator[Array]:
    """Yield the rows (n, columns) of a spool, block by block; one line of headings is skipped."""
    import pyarrow as pa
    from pyarrow import csv

    keys = [str(i) for i in range(len(names))]
    read = csv.ReadOptions(column_names=keys, skip_rows=1, block_size=_BLOCK)
    convert = csv.ConvertOptions(column_types=dict.fromkeys(keys, pa.float64()), null_values=["", "nan"])
    with open(path, "rb") as handle:
        if len(handle.readline()) == path.stat().st_size:
            return
    with pa.OSFile(str(path)) as file:  # not a handle of Python, which Arrow's thread would call
        for batch in csv.open_csv(file, read, csv.ParseOptions(newlines_in_values=True), convert):
            yield np.column_stack([batch.column(key).to_numpy(zero_copy_only=False) for key in keys])


class _Whole(io.RawIOBase):
    """Read a file up to a place."""

    def __init__(self, path: Path, stop: int) -> None:
        self._file, self._stop = open(path, "rb"), stop  # noqa: SIM115 (closed with this)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        data = self._file.read(min(len(buffer), self._stop - self._file.tell()))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()


def whole_lines(path: Path) -> BinaryIO:
    """Open a table that may have been cut within its last line: what is not ended by a line end is left out."""
    stop = end_of_lines(path)
    if stop == path.stat().st_size:
        return open(path, "rb")
    return cast(BinaryIO, io.BufferedReader(_Whole(path, stop)))


def end_of_lines(path: Path) -> int:
    """Return how many bytes of a file its whole lines take, the last line end included."""
    stop = path.stat().st_size
    with open(path, "rb") as handle:
        while stop:
            start = max(0, stop - (1 << 16))
            handle.seek(start)
            at = handle.read(stop - start).rfind(b"\n")
            if at >= 0:
                return start + at + 1
            stop = start
    return 0
