"""Read delimited text: CSV, plain or gzipped, and OpenFAST text output."""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_LINE, guard_names, guard_size
from aeolid.formats.clock import date_hint, looks_like_date, seconds_of_dates
from aeolid.formats.headings import bare_heading, split_heading
from aeolid.formats.table import Array, Choose, Table, is_number_text, positions, text_error
from aeolid.formats.unpacking import GZIP, bounded_lines, open_native, open_text, open_unpacked
from aeolid.inputs import open_regular

EMPTY = ("", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "#N/A", "-nan")
_BLOCK = 1 << 22  # bytes read at a time: memory is bounded by the wanted columns, not by the file
_CELLS = 1 << 16  # that are Python numbers at a time
_LINE_END = re.compile(r"\r\n|\r|\n")  # what Arrow ends a line at; str.splitlines takes form feeds and others, too
_BLANKS = tuple(" " * width for width in range(1, 65))  # cells of which nothing is left
_LOOKED_AT = 100  # rows in which the decimal sign is looked for
_SEPARATOR = re.compile(r'"?sep=([,;\t|])"?\s*', re.IGNORECASE)  # what a spreadsheet writes above the headings
_WITH_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*", re.ASCII)
_WITH_POINT = re.compile(r"\s*[+-]?\d*\.\d+(?:[eE][+-]?\d+)?\s*", re.ASCII)


@dataclass(frozen=True)
class Layout:
    """Say how a text table is written: its headings, units, delimiter, decimal sign and lines before sample 1."""

    names: tuple[str, ...]
    units: dict[str, str]
    delimiter: str
    decimal: str
    skip: int
    encoding: str
    rows: tuple[tuple[str, ...], ...] = ()  # the cells of the first samples

    @property
    def first(self) -> tuple[str, ...]:
        """Return the cells of sample 1; empty where there is none."""
        return next((row for row in self.rows if row), ())

    def dates(self, wanted: tuple[str, ...]) -> tuple[str, ...]:
        """Return those of the wanted columns that begin with a date."""
        places = zip(wanted, positions(self.names, wanted), strict=True)
        return tuple(name for name, i in places if i < len(self.first) and looks_like_date(self.first[i]))


def read_csv(path: Path, choose: Choose) -> Table:
    """Read the chosen columns of a CSV file; comma, semicolon or tab, with decimal comma where semicolons separate."""
    layout = _csv_layout(path)
    wanted = choose(layout.names, None)
    layout = replace(layout, decimal=_decimal(layout, wanted))
    try:
        try:
            columns, begins = _read_columns(path, layout, wanted, open_native)
        except OSError:  # zeros behind packed data, which Arrow does not pass over
            columns, begins = _read_columns(path, layout, wanted, open_unpacked)
    except ValueError as error:  # what pyarrow raises for bad cells and ragged rows, without the place
        raise _locate(path, layout, wanted, str(error)) from None
    return Table(str(path), layout.names, columns, layout.units, None, layout.skip + 1, begins)


def read_out(path: Path, choose: Choose) -> Table:
    """Read OpenFAST text output: six lines of description, names, units, then rows separated by blanks."""
    with open_regular(path) as handle:
        lines = bounded_lines(path, handle)
        head = [line.decode("latin-1") for line in itertools.islice(lines, 8)]
        rows = next((i for i, line in enumerate(head) if line.split()[:1] == ["Time"]), None)
        if head and head[0].startswith(GZIP.decode("latin-1")):
            raise DataError(f"{path}: packed by gzip; unpack it first (gunzip)")
        if rows is None or rows + 1 >= len(head):
            raise DataError(f"{path}: no line that starts with 'Time' among the first eight; not OpenFAST text output")
        names = guard_names(path, tuple(head[rows].split()))
        units = [u.strip("()") for u in head[rows + 1].split()]
        if len(units) != len(names):
            raise DataError(f"{path}: {len(names)} names but {len(units)} units in line {rows + 2}")
        wanted = choose(names, "Time")
        index = positions(names, wanted)
        body = itertools.chain((line.encode("latin-1") for line in head[rows + 2 :]), lines)
        table = _gather(path, _out_rows(path, body, names, index, rows + 3), len(wanted))
    columns = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(wanted)}
    return Table(str(path), names, columns, dict(zip(names, units, strict=True)), "Time", rows + 3)


def _gather(path: Path, rows: Iterator[list[float]], width: int) -> Array:
    """Collect rows in blocks, so that the list of Python numbers stays small; returns (N, width)."""
    blocks: list[Array] = [np.empty((0, width))]
    count = 0
    while block := list(itertools.islice(rows, max(1, _CELLS // max(1, width)))):
        count += len(block)
        guard_size(path, 2 * count * width * 8)  # twice: the blocks and their concatenation
        blocks.append(np.array(block, dtype=float).reshape(len(block), width))
    return np.concatenate(blocks)


def _out_rows(
    path: Path, body: Iterator[bytes], names: tuple[str, ...], index: list[int], first: int
) -> Iterator[list[float]]:
    for number, line in enumerate(body):
        cells = line.split()
        if not cells:
            continue
        if len(cells) != len(names):
            raise _ragged(path, number, first, len(names), len(cells))
        bad = next((i for i in index if b"_" in cells[i]), None) if b"_" in line else None
        if bad is None:
            try:
                yield [float(cells[i]) for i in index]
                continue
            except ValueError:
                bad = next(i for i in index if not _reads(cells[i]))
        place = f"sample {number + 1} (line {first + number})"
        raise text_error(path, names[bad], place, cells[bad].decode("latin-1"))


def _reads(cell: bytes) -> bool:
    """Tell whether the bytes are a number; as text a blank beyond ASCII would be stripped."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _csv_layout(path: Path) -> Layout:
    """Read the lines up to sample 1: comments, the heading, an optional row of units."""
    with open_text(path) as handle:
        head = handle.read(MOST_LINE)
    if not head.strip():
        raise DataError(f"{path}: the file is empty; a heading line and one row a sample are needed")
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise DataError(f"{path}: the text is UTF-16; export it as UTF-8")
    if b"\0" in head:
        raise DataError(f"{path}: binary data, not a text table; give the file its right suffix or export it as CSV")
    encoding = "utf-8" if _decodes(head) else "cp1252"
    lines = _LINE_END.split(head.decode(encoding, errors="replace").removeprefix("\ufeff"))
    filled = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    stated = _SEPARATOR.fullmatch(lines[filled[0]]) if filled else None
    filled = filled[1:] if stated else filled
    if not filled:
        raise DataError(f"{path}: comment lines only; a heading line and one row a sample are needed")
    skip = filled[0]
    return _heading(path, lines[skip : skip + _LOOKED_AT], skip, encoding, stated[1] if stated else None)


def _heading(path: Path, lines: list[str], skip: int, encoding: str, stated: str | None) -> Layout:
    delimiter = stated or max(",;\t", key=lines[0].count)
    names = guard_names(path, tuple(bare_heading(cell.strip()) for cell in _cells(path, lines[0], delimiter)))
    if all(is_number_text(name) for name in names):
        raise DataError(f"{path}: line {skip + 1} holds numbers where the headings should be; add a heading line")
    units = {name: unit for name in names if (unit := split_heading(name)[1]) is not None}
    rows = _rows(lines[1:], delimiter)
    if rows and len(rows[0]) == len(names) and _is_unit_row(rows[0]) and len(rows) > 1 and not _is_unit_row(rows[1]):
        units |= {n: u.strip().strip("[]()") for n, u in zip(names, rows.pop(0), strict=True) if u.strip()}
        skip += 1
    return Layout(names, units, delimiter, ".", skip + 1, encoding, tuple(map(tuple, rows)))


def _decimal(layout: Layout, wanted: Sequence[str]) -> str:
    """Return the decimal sign of the wanted numbers: a comma where some of the first samples have one, none a point."""
    if layout.delimiter == ",":
        return "."
    dates = layout.dates(tuple(wanted))
    index = positions(layout.names, [name for name in wanted if name not in dates])
    cells = [row[i] for row in layout.rows for i in index if i < len(row)]
    return "," if any(map(_WITH_COMMA.fullmatch, cells)) and not any(map(_WITH_POINT.fullmatch, cells)) else "."


def _rows(lines: list[str], delimiter: str) -> list[list[str]]:
    """Split the first lines of the body; what cannot be split is left to the reader of the whole."""
    rows: list[list[str]] = []
    try:
        rows.extend(next(csv.reader([line], delimiter=delimiter), []) for line in lines)
    except csv.Error:
        return rows
    return rows


def _cells(path: Path, line: str, delimiter: str) -> list[str]:
    """Split one line of the head."""
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error as error:
        raise DataError(f"{path}: the heading is no line of a table ({error}); check the delimiter") from None


def _is_unit_row(cells: list[str]) -> bool:
    """Tell a row of units from a row of samples: words stand there, none of them a number or a mark for "missing"."""
    words = [c for c in cells if c.strip() and c.strip() not in EMPTY]
    return bool(words) and not any(is_number_text(c) or looks_like_date(c) for c in words)


def _decodes(head: bytes) -> bool:
    try:
        head[:-4].decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start >= len(head) - 8  # a character cut at the end of the block
    return True


def _read_columns(
    path: Path, layout: Layout, wanted: tuple[str, ...], opened: Callable[[Path], AbstractContextManager[Any]]
) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the wanted columns as numbers, those that are dates as seconds, and the instants these count from."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    keys = [str(position) for position in positions(layout.names, wanted)]
    dates = {k for k, name in zip(keys, wanted, strict=True) if name in layout.dates(wanted)}
    types = {key: pa.string() if key in dates else pa.float64() for key in keys}
    read = arrow_csv.ReadOptions(
        column_names=[str(i) for i in range(len(layout.names))], skip_rows=layout.skip, block_size=_BLOCK,
        encoding=layout.encoding,
    )  # fmt: skip
    convert = arrow_csv.ConvertOptions(
        column_types=types, include_columns=keys, null_values=[*EMPTY, *_BLANKS], decimal_point=layout.decimal
    )
    parts: dict[str, list[Any]] = {key: [] for key in keys}
    rows = 0
    with opened(path) as handle:
        parse = arrow_csv.ParseOptions(delimiter=layout.delimiter)
        for batch in arrow_csv.open_csv(handle, read, parse, convert):
            rows += batch.num_rows
            guard_size(path, 2 * rows * (len(keys) * 8 + len(dates) * 32))  # twice: the parts and their concatenation
            for key in keys:
                column = batch.column(key)
                parts[key].append(column if key in dates else column.to_numpy(zero_copy_only=False))
    columns: dict[str, Array] = {}
    begins: dict[str, str] = {}
    for name, key in zip(wanted, keys, strict=True):
        if key in dates:
            text = pa.chunked_array(parts.pop(key), pa.string()).combine_chunks()
            place = _namer(layout)
            columns[name], begins[name] = seconds_of_dates(str(path), name, text, place)
        else:
            columns[name] = np.concatenate([np.empty(0), *(np.asarray(p, dtype=float) for p in parts.pop(key))])
    return columns, begins


def _namer(layout: Layout) -> Callable[[int], str]:
    return lambda index: f"sample {index + 1} (line {layout.skip + 1 + index})"


def _locate(path: Path, layout: Layout, wanted: tuple[str, ...], cause: str) -> DataError:
    """Walk the file once more, slowly, to name the first row that cannot be read."""
    dates = layout.dates(wanted)
    index = positions(layout.names, [name for name in wanted if name not in dates])
    try:
        with open_text(path) as raw:
            texts = (line.decode(layout.encoding, "replace") for line in bounded_lines(path, raw))
            lines = (line for text in texts for line in re.split(r"(?<=\r)(?!\n)", text) if line)
            body = itertools.islice(lines, layout.skip, None)
            return _first_fault(path, layout, index, csv.reader(body, delimiter=layout.delimiter))
    except csv.Error as error:
        cause = f"{cause} {error}"
    rows = re.search(r"Expected \d+ columns, got \d+|field larger than field limit", cause)  # the row itself may follow
    told = f" ({rows[0]})" if rows else ""
    return DataError(f"{path}: not a readable table{told}; export it as CSV, one row a sample")


def _first_fault(path: Path, layout: Layout, index: list[int], rows: Iterator[list[str]]) -> DataError:
    sample = 0
    for cells in rows:
        if not cells:
            continue
        if len(cells) != len(layout.names):
            return _ragged(path, sample, layout.skip + 1, len(layout.names), len(cells))
        for i in index:
            cell = cells[i].strip(" \t")
            if cell not in EMPTY and not _arrow_reads(cell, layout.decimal):
                place = f"sample {sample + 1} (line {layout.skip + 1 + sample})"
                hint = date_hint(cell)
                told = f"{path}: channel {layout.names[i]!r}, {place}: {cell[:40]!r} is not a number{hint}"
                return DataError(told) if hint else text_error(path, layout.names[i], place, cell)
        sample += 1
    raise csv.Error("its rows cannot be told apart")


def _ragged(path: Path, sample: int, first: int, expected: int, found: int) -> DataError:
    return DataError(
        f"{path}: sample {sample + 1} (line {first + sample}) has {found} cells where the heading has {expected};"
        f" complete the row or remove it"
    )


def _arrow_reads(cell: str, decimal: str) -> bool:
    """Tell whether Arrow takes a cell for a number; Python takes figures of other scripts, 1_000 and other blanks."""
    sign = re.escape(decimal)
    digits = rf"(?:\d+(?:{sign}\d*)?|{sign}\d+)(?:[eE][+-]?\d+)?"
    return re.fullmatch(rf"[+-]?(?:{digits}|nan(?:\(\w*\))?|inf|infinity)", cell, re.ASCII | re.IGNORECASE) is not None
