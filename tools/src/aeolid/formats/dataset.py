"""Read a folder of Parquet files as one recording, as pyarrow and Spark write a table in parts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import guard_size
from aeolid.formats.clock import is_time_heading
from aeolid.formats.headings import same_unit
from aeolid.formats.table import Array, Choose, Table

MOST_PARTS = 2000  # each takes a process of its own to read


def parts_of(path: Path) -> list[Path]:
    """Return the Parquet files below a folder in the order of their names, numbers by size; hidden ones left out.

    Raises DataError where there are none, or more than can be read.
    """
    found = [
        p for p in path.rglob("*.parquet")
        if p.is_file() and not any(part[:1] in "._" for part in p.relative_to(path).parts)
    ]  # fmt: skip
    if not found:
        raise DataError(f"{path}: a folder without Parquet files; name the file in it")
    if len(found) > MOST_PARTS:
        raise DataError(f"{path}: {len(found)} Parquet files, {MOST_PARTS} at most are one recording; join them")
    return sorted(found, key=lambda p: _natural(p.relative_to(path).as_posix()))


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(digits or 0), text) for digits, text in re.findall(r"(\d*)(\D*)", name)]


def read_dataset(folder: Path, choose: Choose) -> Table:
    """Read the chosen columns of all parts and join them in the order of their time, else of their names."""
    from aeolid.formats.parquet import HoldsFrames, read_parquet

    tables: list[Table] = []
    wanted: tuple[str, ...] = ()

    def same(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        nonlocal wanted
        if not tables:
            wanted = tuple(dict.fromkeys(choose(names, clock)))
        return wanted

    rows, paths = 0, parts_of(folder)
    for path in paths:
        try:
            table = read_parquet(path, _present(path, same))
        except HoldsFrames:
            raise DataError(f"{path}: a log of CAN frames in a folder that is to be one table; name the file") from None
        rows += table.samples
        guard_size(folder, 2 * rows * len(wanted) * 8, _limit(paths))
        if table.samples:
            tables.append(table)
    if not tables:
        raise DataError(f"{folder}: {len(paths)} Parquet files without a row")
    _require_one_kind(tables, wanted)
    return _joined(folder, tables, wanted)


def _present(path: Path, choose: Choose) -> Choose:
    def checked(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        found = choose(names, clock)
        missing = [name for name in found if name not in names]
        if missing:
            raise DataError(f"{path}: no channel {missing[0]!r}, which the first part has; leave the part out")
        return tuple(found)

    return checked


def _require_one_kind(tables: Sequence[Table], wanted: Sequence[str]) -> None:
    """Refuse a part whose units differ from the first part's, or which has numbers where that has dates."""
    first = tables[0]
    for part in tables[1:]:
        for name in wanted:
            there, here = first.units.get(name, ""), part.units.get(name, "")
            if not same_unit(there, here):
                raise DataError(
                    f"{part.source}: channel {name!r} is in {here[:40]!r}, in {first.source} in {there[:40]!r}; convert"
                    " one of them, or give the parts one by one"
                )
            if (name in first.begins) != (name in part.begins):
                dated, plain = (first, part) if name in first.begins else (part, first)
                raise DataError(
                    f"{part.source}: channel {name!r} holds dates in {dated.source} and numbers in {plain.source};"
                    " write it alike in all parts"
                )


def _limit(paths: Sequence[Path]) -> int:
    from aeolid.formats.bounds import content_limit

    return sum(content_limit(p) for p in paths)


def _joined(folder: Path, tables: list[Table], wanted: Sequence[str]) -> Table:
    """Join the columns; dates of all parts count from the first instant of all."""
    first = tables[0]
    begins = {name: min(filter(None, (t.begins.get(name) for t in tables)), default="") for name in first.begins}
    columns: list[dict[str, Array]] = []
    for t in tables:
        shift = {n: _seconds(t.source, begins[n], t.begins[n]) for n in t.begins if begins.get(n) and t.begins[n]}
        columns.append({n: t.columns[n] + shift.get(n, 0.0) for n in wanted})
    clock = first.time or next((n for n in wanted if n in begins or is_time_heading(n)), None)
    if clock is not None and clock in wanted:
        own = [float(np.min(c[clock], initial=np.inf, where=np.isfinite(c[clock]))) for c in columns]
        columns = [columns[i] for i in np.argsort(own, kind="stable")]
    joined = {n: np.concatenate([c[n] for c in columns]) for n in wanted}
    return replace(first, source=str(folder), columns=joined, begins=begins)


def _seconds(source: str, begin: str, instant: str) -> float:
    if begin.endswith("Z") != instant.endswith("Z"):
        raise DataError(
            f"{source}: other parts' dates have {'a' if begin.endswith('Z') else 'no'} time zone, these not so"
        )
    return (datetime.fromisoformat(instant) - datetime.fromisoformat(begin)).total_seconds()
