"""Take columns out of an Excel workbook with openpyxl; everything here runs confined."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from datetime import date, datetime, time
from typing import Any

import numpy as np

from aeolid.confined import Reply
from aeolid.errors import DataError
from aeolid.formats.bounds import guard_size
from aeolid.formats.clock import looks_like_date, relative, seconds_of_dates
from aeolid.formats.headings import split_heading
from aeolid.formats.table import Array, to_numbers

_LOOKED_AT = 50  # rows of a sheet in which its headings are looked for


def send_columns(path: str, source: str, most: int) -> Generator[Reply, dict[str, Any], None]:
    """Say what columns the first sheet with a table has, then send those that are wanted."""
    os.environ["OPENPYXL_LXML"] = "False"  # the standard library's parser fetches no entity from anywhere
    from openpyxl import load_workbook

    book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
    for sheet in book.worksheets:
        rows = iter(sheet.iter_rows(values_only=True))
        head = _heading(rows)
        if head is not None:
            break
    else:
        raise DataError(f"{source}: no sheet holds a row of headings above rows of numbers")
    headings, first = head
    names = [name for name, _ in headings]
    places = dict(reversed(headings))  # of a doubled one the first; whoever wants it by name is refused
    units = {name: unit for name in names if (unit := split_heading(name)[1]) is not None}
    body: Iterator[tuple[Any, ...]] = iter([first])
    if _is_units(first):
        units |= {n: str(first[i]).strip("[]() ") for n, i in headings if i < len(first) and first[i]}
        body = iter(())
    wanted = (yield {"asks": "wanted", "names": names, "units": units}, {})["wanted"]
    cells: dict[str, list[Any]] = {name: [] for name in wanted}
    count = 0
    for part in (body, rows):
        for row in part:
            count += 1
            if count % 4096 == 0:
                guard_size(source, 40 * count * len(wanted), most)
            for name in wanted:
                cells[name].append(row[places[name]] if places[name] < len(row) else None)
    begins: dict[str, str] = {}
    columns = [_column(source, name, _trimmed(cells, count)[name], begins) for name in wanted]
    missing = any(np.isnan(values).any() for values in columns)
    unstored = _unstored(path, sheet.title, {places[n] for n in wanted}) if missing else 0
    yield {"begins": begins, "unstored": unstored}, {str(i): values for i, values in enumerate(columns)}


def _unstored(path: str, title: str, places: set[int]) -> int:
    """Count the formulas in some columns of a sheet of which the file holds no value."""
    from openpyxl import load_workbook

    values, formulas = (
        load_workbook(path, read_only=True, data_only=only, keep_links=False)[title].iter_rows(values_only=True)
        for only in (True, False)
    )
    return sum(
        value is None and isinstance(formula, str) and formula.startswith("=")
        for row, written in zip(values, formulas, strict=False)
        for i, (value, formula) in enumerate(zip(row, written, strict=False))
        if i in places
    )


def _heading(rows: Iterator[tuple[Any, ...]]) -> tuple[list[tuple[str, int]], tuple[Any, ...]] | None:
    """Return the headings and where each stands, and the row after it; None where the sheet has no row of texts."""
    for _, row in zip(range(_LOOKED_AT), rows, strict=False):
        texts = [(c.strip(), i) for i, c in enumerate(row) if isinstance(c, str) and c.strip()]
        if len(texts) >= 2:
            following = next(rows, None)
            return None if following is None else (texts, following)
    return None


def _is_units(row: tuple[Any, ...]) -> bool:
    there = [c for c in row if c is not None]
    return bool(there) and all(isinstance(c, str) and not looks_like_date(c) for c in there)


def _trimmed(cells: dict[str, list[Any]], count: int) -> dict[str, list[Any]]:
    """Leave out empty rows at the end, which a sheet keeps where something once stood."""
    while count and all(values[count - 1] is None for values in cells.values()):
        count -= 1
    return {name: values[:count] for name, values in cells.items()}


def _column(source: str, name: str, values: list[Any], begins: dict[str, str]) -> Array:
    """Return a column as numbers; dates as seconds since the first of them, which `begins` then says."""
    import pyarrow as pa

    first = next((v for v in values if v is not None), None)
    if isinstance(first, datetime):
        if not all(v is None or isinstance(v, datetime) for v in values):
            raise DataError(f"{source}: channel {name!r} holds dates and other things; one kind is needed")
        seconds, begins[name] = relative(pa.array(values, pa.timestamp("us")).cast(pa.timestamp("ns")), None)
        return np.round(seconds, 6)
    if isinstance(first, date | time):
        raise DataError(f"{source}: channel {name!r} holds days or times of day; give date and time in one column")
    if isinstance(first, str) and looks_like_date(first):
        text = pa.array([None if v is None else str(v) for v in values], pa.string())
        seconds, begins[name] = seconds_of_dates(source, name, text, lambda i: f"sample {i + 1}")
        return seconds
    return to_numbers(source, name, np.array(values, dtype=object))
