"""Look at one file: which of its headings are known, what its clock is, and how its channels are sampled."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aeolid.errors import DataError, OpenUnit, UnevenClock
from aeolid.formats import Table, read_chosen
from aeolid.formats.clock import clock_of, is_time_heading, possible_units
from aeolid.formats.headings import plain_unit, split_heading
from aeolid.formats.meanings import Meaning, meaning_of
from aeolid.formats.table import Array
from aeolid.formats.timebase import require_running_clock, uniform_grid
from aeolid.units import alike, rightly

_SPARSE = 0.3  # share of missing cells from which a channel is taken for one of a slower rate
_SAME_INSTANT = 1e-9  # seconds, within which two channels have one clock


@dataclass(frozen=True, eq=False)
class Survey:
    """Hold what a look at a file found.

    table: the channels whose headings are known, and the time; meanings: of those headings; others: the headings that
    are not known; time, time_unit, sample_time_s, resample: what the roles file shall say of the clock; seconds: the
    time (N,), empty where there is none; notes: what was guessed of the clock, a sentence each.
    """

    path: Path
    table: Table
    meanings: dict[str, Meaning]
    others: tuple[str, ...]
    time: str | None = None
    time_unit: str | None = None
    sample_time_s: float | None = None
    resample: str | None = None
    seconds: Array = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()

    def values(self, heading: str) -> Array:
        """Return the samples (n,) of a known channel that are there."""
        found = self.table.columns[heading]
        kept: Array = found[np.isfinite(found)]
        return kept

    def unit(self, heading: str) -> str:
        """Return the unit that the file gives a channel, spelt as roles files spell it; empty where it gives none."""
        said = self.table.units.get(heading, split_heading(heading)[1]) or ""
        plain = plain_unit(said)
        if not plain:
            return ""
        spelt = _SPELT.get(plain) or _LOWER.get(plain.lower()) or said.strip()
        return rightly(spelt) or spelt


_SPELT = {plain_unit(u): u for unit in ("deg", "rpm", "kN m", "kN", "kW", "m/s^2", "m", "m/s")
          for u in alike(unit) if u not in ("Nm", "kNm", "MNm", "m/s2")}  # fmt: skip
_LOWER = {
    plain.lower(): u for plain, u in _SPELT.items() if plain[0] != "M"
}  # KW is kW; mNm and mW are not MN m and MW


def survey(path: str | Path) -> Survey:
    """Look at a file. Raises DataError where it cannot be read."""
    meanings: dict[str, Meaning] = {}
    seen: list[tuple[tuple[str, ...], str | None]] = []

    def choose(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        if clock is None:
            clock = next((n for n in names if is_time_heading(n)), None)
        for name in names:
            found = meaning_of(name) if name != clock and names.count(name) == 1 else None
            if found is not None:
                meanings[name] = found
        seen.append((names, clock))
        few = [n for n in names if n != clock and n][:1]
        return tuple(dict.fromkeys(([clock] if clock else []) + (list(meanings) or few)))

    table = read_chosen(path, choose)
    names, clock = seen[-1]
    if table.samples < 2:
        raise DataError(f"{path}: fewer than two samples; nothing can be guessed of it")
    others = tuple(n for n in names if n not in meanings and n != clock and n)
    return _with_clock(Survey(Path(path), table, meanings, others), clock)


def _with_clock(found: Survey, heading: str | None) -> Survey:
    """Find out what the roles file must say of the clock."""
    if heading is None:
        note = "no time column was found: sample_time_s is a guess, correct it"
        return replace(found, sample_time_s=0.1, notes=(note,))
    named = replace(found, time=split_heading(heading)[0] if heading != found.table.time else heading)
    try:
        seconds, stated, notes = _seconds(found.table, heading)
    except DataError as error:  # the question is the user's to answer
        return replace(named, notes=(_without_source(found.table, error),))
    resample = None
    try:
        why = _reason_to_resample(found, seconds)
        if why:
            resample, notes = "auto", (*notes, why)
    except DataError as error:
        notes = (*notes, f"as it stands it cannot be read: {_without_source(found.table, error)}")
    return replace(named, time_unit=stated, resample=resample, seconds=seconds, notes=notes)


def _without_source(table: Table, error: DataError) -> str:
    return str(error).removeprefix(f"{table.source}: ")


def _seconds(table: Table, heading: str) -> tuple[Array, str | None, tuple[str, ...]]:
    """Return the time in seconds (N,), the unit that the roles file must state, and what was guessed of it.

    Raises DataError where the unit is wrong or where more than one is possible.
    """
    unit = table.units.get(heading, split_heading(heading)[1])
    try:
        return clock_of(table, heading, unit, None, None).seconds, None, ()
    except OpenUnit:
        possible = possible_units(table.columns[heading])
        if len(possible) != 1:
            raise
    step = float(np.nanmedian(np.diff(table.columns[heading])))
    note = f"the time steps by {step:.6g} and does not say its unit: taken for {possible[0]}"
    return clock_of(table, heading, unit, possible[0], None).seconds, possible[0], (note,)


def _reason_to_resample(found: Survey, seconds: Array) -> str:
    """Say why the channels must be resampled: several rates, an uneven clock; empty where they need not be.

    Raises DataError where no resampling helps: the time of a channel is missing, repeats or goes backwards.
    """
    table = found.table
    sparse = [n for n in found.meanings if np.mean(np.isnan(table.columns[n])) > _SPARSE and len(found.values(n)) > 1]
    clocks = list(table.clocks.values())
    if sparse or any(not _same(clocks[0], other) for other in clocks[1:]):
        for name in found.meanings:
            rows = np.flatnonzero(np.isfinite(table.columns[name]))
            require_running_clock(table, table.clocks.get(name, seconds)[rows], rows, name)
        return "its channels have different rates: they are resampled to the slowest of those in use"
    try:
        uniform_grid(table, seconds, None)
    except UnevenClock as error:
        return f"its clock is uneven, so it is resampled ({_without_source(table, error)})"
    return ""


def _same(first: Array, other: Array) -> bool:
    return len(first) == len(other) and bool(np.all(np.abs(first - other) <= _SAME_INSTANT))
