"""Read delimited text: CSV, plain or gzipped, and OpenFAST text output."""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import guard_names, guard_size
from aeolid.formats.clock import date_hint, looks_like_date, seconds_of_dates
from aeolid.formats.lines import below, count_lines, numbered
from aeolid.formats.table import Array, Choose, Table, place_in_text, positions, text_error
from aeolid.formats.text_layout import EMPTY, Layout, csv_layout, decimal_sign
from aeolid.formats.unpacking import GZIP, bounded_lines, open_native, open_unpacked
from aeolid.inputs import open_regular

_BLOCK = 1 << 22  # bytes read at a time: memory is bounded by the wanted columns, not by the file
_CELLS = 1 << 16  # that are Python numbers at a time
_BLANKS = tuple(" " * width for width in range(1, 65))  # cells of which nothing is left


def read_csv(path: Path, choose: Choose) -> Table:
    """Read the chosen columns of a CSV file; comma, semicolon or tab, with decimal comma where `decimal_sign` says."""
    layout = csv_layout(path)
    wanted = choose(layout.names, None)
    layout = replace(layout, decimal=decimal_sign(path, layout, wanted))
    lines = count_lines(path) - layout.skip
    try:
        try:
            parts, rows = _read_parts(path, layout, wanted, open_native)
        except OSError:  # zeros behind packed data, which Arrow does not pass over
            parts, rows = _read_parts(path, layout, wanted, open_unpacked)
    except ValueError as error:  # what pyarrow raises for bad cells and ragged rows, without the place
        raise _fault(path, layout, wanted) or _unreadable(path, str(error)) from None
    empty = np.empty((0, 2), np.int64)
    if rows != lines:
        filled, empty = below(path, layout.skip)
        fault = _fault(path, layout, wanted) if rows < filled else None  # else it has grown since
        if fault is not None:
            raise fault
    columns, begins = _columns(path, layout, wanted, parts, lambda i: place_in_text(i, layout.skip + 1, empty))
    return Table(
        str(path), layout.names, columns, layout.units, None, layout.skip + 1, begins, empty_lines=empty
    )  # fmt: skip


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
        blank: Counter[int] = Counter()
        table = _gather(path, _out_rows(path, body, names, index, rows + 3, blank), len(wanted))
    columns = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(wanted)}
    empty = np.column_stack([np.array(list(blank), np.int64), np.cumsum(list(blank.values()), dtype=np.int64)])
    units_of = dict(zip(names, units, strict=True))
    return Table(str(path), names, columns, units_of, "Time", rows + 3, empty_lines=empty)


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
    path: Path, body: Iterator[bytes], names: tuple[str, ...], index: list[int], first: int, blank: Counter[int]
) -> Iterator[list[float]]:
    """Yield the numbers of each sample; blank: counts, by the samples above them, the lines without any."""
    sample = 0
    for number, line in enumerate(body, first):
        cells = line.split()
        if not cells:
            blank[sample] += 1
            continue
        sample += 1
        if len(cells) != len(names):
            raise _ragged(path, f"sample {sample} (line {number})", len(names), len(cells))
        bad = next((i for i in index if b"_" in cells[i]), None) if b"_" in line else None
        if bad is None:
            try:
                yield [float(cells[i]) for i in index]
                continue
            except ValueError:
                bad = next(i for i in index if not _reads(cells[i]))
        raise text_error(path, names[bad], f"sample {sample} (line {number})", cells[bad].decode("latin-1"))


def _reads(cell: bytes) -> bool:
    """Tell whether the bytes are a number; as text a blank beyond ASCII would be stripped."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_parts(
    path: Path, layout: Layout, wanted: tuple[str, ...], opened: Callable[[Path], AbstractContextManager[Any]]
) -> tuple[dict[str, list[Any]], int]:
    """Return the parts of each wanted column, dates as text of Arrow and others as numbers, and the number of rows."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    keys = {name: str(position) for name, position in zip(wanted, positions(layout.names, wanted), strict=True)}
    dates = layout.dates(wanted)
    types = {key: pa.string() if name in dates else pa.float64() for name, key in keys.items()}
    read = arrow_csv.ReadOptions(
        column_names=[str(i) for i in range(len(layout.names))], skip_rows=layout.skip, block_size=_BLOCK,
        encoding=layout.encoding,
    )  # fmt: skip
    convert = arrow_csv.ConvertOptions(
        column_types=types, include_columns=[*keys.values()], null_values=[*EMPTY, *_BLANKS],
        decimal_point=layout.decimal,
    )  # fmt: skip
    parts: dict[str, list[Any]] = {name: [] for name in keys}
    rows = 0
    with opened(path) as handle:
        parse = arrow_csv.ParseOptions(delimiter=layout.delimiter)
        for batch in arrow_csv.open_csv(handle, read, parse, convert):
            rows += batch.num_rows
            guard_size(path, 2 * rows * (len(keys) * 8 + len(dates) * 32))  # twice: the parts and their concatenation
            for name, key in keys.items():
                column = batch.column(key)
                parts[name].append(column if name in dates else column.to_numpy(zero_copy_only=False))
    return parts, rows


def _columns(
    path: Path, layout: Layout, wanted: tuple[str, ...], parts: dict[str, list[Any]], place: Callable[[int], str]
) -> tuple[dict[str, Array], dict[str, str]]:
    """Join the parts, which are used up: columns of numbers, dates as seconds, and the instants these count from."""
    import pyarrow as pa

    columns: dict[str, Array] = {}
    begins: dict[str, str] = {}
    dates = layout.dates(wanted)
    for name in wanted:
        if name in dates:
            text = pa.chunked_array(parts.pop(name), pa.string()).combine_chunks()
            columns[name], begins[name] = seconds_of_dates(str(path), name, text, place)
        else:
            columns[name] = np.concatenate([np.empty(0), *(np.asarray(p, dtype=float) for p in parts.pop(name))])
    return columns, begins


def _unreadable(path: Path, cause: str) -> DataError:
    rows = re.search(r"Expected \d+ columns, got \d+|field larger than field limit", cause)  # the row itself may follow
    told = f" ({rows[0]})" if rows else ""
    return DataError(f"{path}: not a readable table{told}; export it as CSV, one row a sample")


def _fault(path: Path, layout: Layout, wanted: tuple[str, ...]) -> DataError | None:
    """Walk the file once more, slowly, for the first row that cannot be read; None where every one can."""
    dates = layout.dates(wanted)
    index = positions(layout.names, [name for name in wanted if name not in dates])
    begun: set[int] = set()  # columns that held a number
    sample = 0
    for number, line in numbered(path, layout.skip):
        if not line:
            continue
        sample += 1
        place = f"sample {sample} (line {number})"
        reader = csv.reader((line.decode(layout.encoding, "replace"), ""), delimiter=layout.delimiter)
        try:
            cells = next(reader)
        except csv.Error as error:
            return _unreadable(path, str(error))
        if reader.line_num > 1:
            return DataError(
                f"{path}: {place}: a quotation mark begins a cell that does not end in its line; remove the mark or"
                " close the cell, and leave line ends out of cells"
            )
        if len(cells) != len(layout.names):
            return _ragged(path, place, len(layout.names), len(cells))
        for i in index:
            fault = _fault_of_cell(path, layout, i, cells[i].strip(" \t"), place, i in begun or sample == 1)
            if fault is not None:
                return fault
            if cells[i].strip(" \t") not in EMPTY:
                begun.add(i)
    return None


def _fault_of_cell(path: Path, layout: Layout, i: int, cell: str, place: str, begun: bool) -> DataError | None:
    """Say why a cell is no number; begun: whether cells above it in its column, or none at all, hold something."""
    if cell in EMPTY or _arrow_reads(cell, layout.decimal):
        return None
    where = f"{path}: channel {layout.names[i]!r}, {place}: {cell[:40]!r}"
    if looks_like_date(cell) and not begun:
        return DataError(f"{where} is a date, and every cell above is empty; fill them in or remove their rows")
    hint = date_hint(cell)
    return DataError(f"{where} is not a number{hint}") if hint else text_error(path, layout.names[i], place, cell)


def _ragged(path: Path, place: str, expected: int, found: int) -> DataError:
    return DataError(
        f"{path}: {place} has {found} cells where the heading has {expected}; complete the row or remove it"
    )


def _arrow_reads(cell: str, decimal: str) -> bool:
    """Tell whether Arrow takes a cell for a number; Python takes figures of other scripts, 1_000 and other blanks."""
    sign = re.escape(decimal)
    digits = rf"(?:\d+(?:{sign}\d*)?|{sign}\d+)(?:[eE][+-]?\d+)?"
    return re.fullmatch(rf"[+-]?(?:{digits}|nan(?:\(\w*\))?|inf|infinity)", cell, re.ASCII | re.IGNORECASE) is not None
