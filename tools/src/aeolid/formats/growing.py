"""Write tables that grow row by row for as long as it takes: CSV, gzipped CSV, Parquet, MDF4."""

from __future__ import annotations

import gzip
import io
import os
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.errors import UsageError
from aeolid.formats.headings import heading_line
from aeolid.formats.parquet import WRITTEN
from aeolid.formats.spare import SPARE, SpareFile
from aeolid.formats.spool import PART_SUFFIX, TextSpool, read_spool
from aeolid.formats.table import Array
from aeolid.output import create

GROWING_SUFFIXES = (".csv", ".csv.gz", ".parquet", ".mf4")
PART = 1 << 16  # rows that make a part of a Parquet or MDF4 file


def growing_suffix(path: Path) -> str | None:
    """Return which of the known suffixes a name ends with, None for another."""
    return next((s for s in GROWING_SUFFIXES[::-1] if path.name.lower().endswith(s)), None)


def open_growing(path: Path, suffix: str, names: Sequence[str], units: Sequence[str]) -> GrowingTable:
    """Begin a table at `path`, laid out as `suffix` says; the first column is the time in seconds.

    Raises UsageError for another suffix or a place that cannot be written to.
    """
    if suffix not in GROWING_SUFFIXES:
        raise UsageError(f"{path}: the suffix is none of {', '.join(GROWING_SUFFIXES)}")
    try:
        kind = CsvTable if suffix == ".csv" else SpooledTable
        return kind(path, suffix, tuple(names), tuple(units))
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror or error})") from None


class GrowingTable(ABC):
    """Take blocks of rows; `full` turns true when the disk has no room left: then close, what was taken is there."""

    part = PART  # rows that are held back until they are written together

    def __init__(self, path: Path, suffix: str, names: tuple[str, ...], units: tuple[str, ...]) -> None:
        """Create the file. Raises OSError."""
        self.path, self.suffix = path, suffix
        self.names, self.units = names, units
        self.full = False
        self._held: list[Array] = []
        self._rows = 0

    def write(self, rows: Array) -> None:
        """Add rows (n, columns). Raises OSError when nothing more can be written."""
        self._held.append(rows)
        self._rows += len(rows)
        if self._rows >= self.part:
            self._flush()

    def show(self, rows: Array) -> None:
        """Put rows (n, columns) on the disk that may still change, instead of those shown before. Raises OSError.

        A table that is written at once has no place for them.
        """
        del rows

    def drop(self) -> None:
        """Give the table up and remove its file."""
        self.path.unlink(missing_ok=True)

    def close(self, start: datetime | None = None, notes: Mapping[str, str] | None = None) -> None:
        """Complete the file. start: when time 0 was; notes: facts about the table, where the format has room."""
        self._flush()
        self._finish(start, notes or {})

    def _flush(self) -> None:
        held, self._held, self._rows = self._held, [], 0
        if held:
            self._put(np.concatenate(held))

    @abstractmethod
    def _put(self, rows: Array) -> None:
        """Write rows to the file."""

    @abstractmethod
    def _finish(self, start: datetime | None, notes: Mapping[str, str]) -> None:
        """End the file."""


class CsvTable(GrowingTable):
    """Write text that is on the disk as soon as it is taken; a missing number is an empty cell."""

    part = 1

    def __init__(self, path: Path, suffix: str, names: tuple[str, ...], units: tuple[str, ...]) -> None:
        super().__init__(path, suffix, names, units)
        self._spool = TextSpool(path, heading_line(names).encode())

    def show(self, rows: Array) -> None:
        """Put rows on the disk that may still change."""
        self._spool.show(rows)
        self.full = self._spool.full

    def drop(self) -> None:
        """Give the table up and remove its file."""
        self._spool.close()
        self.path.unlink(missing_ok=True)

    def _put(self, rows: Array) -> None:
        self._spool.append(rows)
        self.full = self._spool.full

    def _finish(self, start: datetime | None, notes: Mapping[str, str]) -> None:
        self._spool.close()


class SpooledTable(GrowingTable):
    """Hold rows as text in NAME.part.csv until the end, then write them in a format whose directory comes last."""

    part = 1

    def __init__(self, path: Path, suffix: str, names: tuple[str, ...], units: tuple[str, ...]) -> None:
        super().__init__(path, suffix, names, units)
        stem = path.name[: len(path.name) - len(suffix)].removesuffix(".part")
        self._spool = TextSpool(path.with_name(stem + PART_SUFFIX), heading_line(names).encode())

    def show(self, rows: Array) -> None:
        """Put rows on the disk that may still change."""
        self._spool.show(rows)
        self._look()

    def drop(self) -> None:
        """Give the table up and remove its file."""
        self._spool.close()
        self._spool.path.unlink(missing_ok=True)

    def _put(self, rows: Array) -> None:
        self._spool.append(rows)
        self._look()

    def _look(self) -> None:
        """See whether there is room for the file that is written at the end."""
        self.full = self._spool.full or shutil.disk_usage(self.path.parent).free < self._spool.size + 2 * SPARE

    def _finish(self, start: datetime | None, notes: Mapping[str, str]) -> None:
        self._spool.close()
        if self.suffix == ".csv.gz":
            with (
                open(self._spool.path, "rb") as text,
                SpareFile(self.path) as raw,
                gzip.GzipFile(filename="", mode="wb", fileobj=raw, compresslevel=6) as packed,
            ):
                shutil.copyfileobj(text, packed, 1 << 20)
        else:
            kind = ParquetTable if self.suffix == ".parquet" else Mf4Table
            table = kind(self.path, self.suffix, self.names, self.units)
            for rows in read_spool(self._spool.path, self.names):
                table.write(rows)
            table.close(start, notes)
        self._spool.path.unlink()


class ParquetTable(GrowingTable):
    """Write Parquet; each field carries its unit, the file its notes."""

    def __init__(self, path: Path, suffix: str, names: tuple[str, ...], units: tuple[str, ...]) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        super().__init__(path, suffix, names, units)
        metadata = [{"unit": unit} if unit else None for unit in units]
        fields = [pa.field(n, pa.float64(), metadata=m) for n, m in zip(names, metadata, strict=True)]
        self._schema = pa.schema(fields)
        self._raw = SpareFile(path)
        self._file = io.BufferedWriter(self._raw, 1 << 16)
        self._writer = parquet.ParquetWriter(self._file, self._schema, **WRITTEN)

    def _put(self, rows: Array) -> None:
        self._writer.write_table(_arrow(rows, self.names).cast(self._schema), row_group_size=PART)
        self._file.flush()
        self.full = self._raw.full

    def _finish(self, start: datetime | None, notes: Mapping[str, str]) -> None:
        self._writer.add_key_value_metadata({**notes, **({"utc_of_time_0": _iso(start)} if start else {})})
        self._writer.close()
        self._file.close()


class Mf4Table(GrowingTable):
    """Write MDF4 with asammdf: one group, binary32 values, units; its start is when time 0 was.

    Rows wait, compressed, in a hidden folder beside the target while it is written.
    """

    def __init__(self, path: Path, suffix: str, names: tuple[str, ...], units: tuple[str, ...]) -> None:
        from asammdf import MDF, Signal

        super().__init__(path, suffix, names, units)
        os.close(create(path))  # a place that cannot be written to is told now
        self._folder = tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.")
        self._mdf: Any = MDF(version="4.10", temporary_folder=self._folder.name)
        self._mdf.header.start_time = datetime.fromtimestamp(0, UTC)
        none = np.zeros(0)
        pairs = list(zip(names, units, strict=True))[1:]
        signals = [Signal(none.astype(np.float32), none, name=name, unit=unit) for name, unit in pairs]
        self._mdf.append(signals, common_timebase=True)

    def _put(self, rows: Array) -> None:
        values = [(np.ascontiguousarray(column), None) for column in rows[:, 1:].astype(np.float32).T]
        self._mdf.extend(0, [(np.ascontiguousarray(rows[:, 0]), None), *values])
        waiting = sum(entry.stat().st_size for entry in os.scandir(self._folder.name))
        self.full = shutil.disk_usage(self.path.parent).free < waiting + 2 * SPARE

    def _finish(self, start: datetime | None, notes: Mapping[str, str]) -> None:
        if start is not None:
            self._mdf.header.start_time = start
        self._mdf.header.comment = "\n".join(f"{name}: {value}" for name, value in notes.items())
        try:
            whole = Path(self._folder.name) / "whole.mf4"
            self._mdf.save(whole, overwrite=True, compression=2)
            os.replace(whole, self.path)
        finally:
            self._mdf.close()
            self._folder.cleanup()


def _arrow(rows: Array, names: tuple[str, ...]) -> Any:
    import pyarrow as pa

    empty_cells = len(names) > 1  # alone in its row an empty cell would be an empty line, which readers skip
    columns = [pa.array(np.ascontiguousarray(column), from_pandas=empty_cells) for column in rows.T]
    return pa.table(columns, names=list(names))


def _iso(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat(timespec="microseconds")
