"""Find out how a delimited text table is written: its headings, units, delimiter and decimal sign."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_LINE, guard_names
from aeolid.formats.clock import looks_like_date
from aeolid.formats.headings import bare_heading, split_heading
from aeolid.formats.table import is_number_text, positions
from aeolid.formats.unpacking import open_text

EMPTY = ("", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "null", "NULL", "None", "#N/A", "-nan")
_LINE_END = re.compile(r"\r\n|\r|\n")  # what Arrow ends a line at; str.splitlines takes form feeds and others, too
_LOOKED_AT = 100  # rows in which the decimal sign is looked for
_SEPARATOR = re.compile(r'"?sep=([,;\t|])"?\s*', re.IGNORECASE)  # what a spreadsheet writes above the headings
_WITH_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*", re.ASCII)
_GROUPED = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}\s*", re.ASCII)  # a decimal comma, or one between thousands
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
    rows: tuple[tuple[str, ...], ...] = ()  # the cells of the first lines below

    def dates(self, wanted: tuple[str, ...]) -> tuple[str, ...]:
        """Return those of the wanted columns whose first cell that is not empty is a date."""
        found = []
        for name, i in zip(wanted, positions(self.names, wanted), strict=True):
            first = next((row[i] for row in self.rows if i < len(row) and row[i].strip() not in EMPTY), "")
            if looks_like_date(first):
                found.append(name)
        return tuple(found)


def csv_layout(path: Path) -> Layout:
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
    first, second = [*(k for k, row in enumerate(rows) if row), -1, -1][:2]  # lines that are not empty
    if second > 0 and len(rows[first]) == len(names) and _is_unit_row(rows[first]) and not _is_unit_row(rows[second]):
        units |= {n: u.strip().strip("[]()") for n, u in zip(names, rows[first], strict=True) if u.strip()}
        skip, rows = skip + first + 1, rows[first + 1 :]
    return Layout(names, units, delimiter, ".", skip + 1, encoding, tuple(map(tuple, rows)))


def decimal_sign(path: Path, layout: Layout, wanted: Sequence[str]) -> str:
    """Return the decimal sign of the wanted numbers: a comma where some of the first samples have one, none a point.

    Programs that put semicolons between cells do so because the comma is their decimal sign. Between tabs a comma may
    also stand between thousands; raises DataError where the first samples do not tell.
    """
    if layout.delimiter == ",":
        return "."
    dates = layout.dates(tuple(wanted))
    index = positions(layout.names, [name for name in wanted if name not in dates])
    cells = [(k, i, row[i]) for k, row in enumerate(layout.rows) for i in index if i < len(row)]
    with_comma = [cell for cell in cells if _WITH_COMMA.fullmatch(cell[2])]
    if not with_comma or any(_WITH_POINT.fullmatch(text) for _, _, text in cells):
        return "."
    if layout.delimiter != ";" and all(_GROUPED.fullmatch(text) for _, _, text in with_comma):
        k, i, text = with_comma[0]
        place = f"sample {1 + sum(map(bool, layout.rows[:k]))} (line {layout.skip + 1 + k})"
        raise DataError(
            f"{path}: channel {layout.names[i]!r}, {place}: {text.strip()!r} may be {text.strip().replace(',', '.')} or"
            f" {text.strip().replace(',', '')}; write a decimal point, and nothing between thousands, or semicolons"
            " between the cells where the comma is the decimal sign"
        )
    return ","


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
