"""Look at one file: which of its headings are known, what its clock is, and how its channels are sampled."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aeolid.errors import DataError
from aeolid.formats import Table, read_chosen
from aeolid.formats.clock import clock_of, is_time_heading
from aeolid.formats.headings import plain_unit, split_heading
from aeolid.formats.meanings import Meaning, meaning_of
from aeolid.formats.table import Array
from aeolid.formats.timebase import uniform_grid
from aeolid.units import alike, rightly

_SPARSE = 0.3  # share of missing cells from which a channel is taken for one of a slower rate
_FASTEST_S, _SLOWEST_S = 1e-4, 2.0  # sample times of recordings of turbines, by which milliseconds are told


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
        if not plain_unit(said):
            return ""
        spelt = _SPELT.get(plain_unit(said).lower().replace("/s2", "/s^2"), said.strip())
        return rightly(spelt) or spelt


_SPELT = {u.lower().replace(" ", ""): u for unit in ("deg", "rpm", "kN m", "kN", "kW", "m/s^2", "m", "m/s")
          for u in alike(unit) if u not in ("Nm", "kNm", "MNm", "m/s2")}  # fmt: skip


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
    from dataclasses import replace

    table = found.table
    if heading is None:
        note = "no time column was found: sample_time_s is a guess, correct it"
        return replace(found, sample_time_s=0.1, notes=(note,))
    unit = table.units.get(heading, split_heading(heading)[1])
    notes: tuple[str, ...] = ()
    stated = None
    try:
        seconds = clock_of(table, heading, unit, None, None).seconds
    except DataError:
        step = float(np.nanmedian(np.diff(table.columns[heading])))
        stated = "ms" if _FASTEST_S <= step * 1e-3 <= _SLOWEST_S else "s"
        notes = (f"the time steps by {step:g} and does not say its unit: taken for {stated}",)
        seconds = clock_of(table, heading, unit, stated, None).seconds
    resample = None
    sparse = [n for n in found.meanings if np.mean(np.isnan(table.columns[n])) > _SPARSE and len(found.values(n)) > 1]
    clocks = {len(c) for c in table.clocks.values()}
    if sparse or len(clocks) > 1:
        notes += ("its channels have different rates: they are resampled to the slowest of those in use",)
        resample = "auto"
    else:
        try:
            uniform_grid(table, seconds, None)
        except DataError as error:
            notes += (f"its clock is uneven, so it is resampled ({str(error).removeprefix(f'{table.source}: ')})",)
            resample = "auto"
    return replace(
        found, time=split_heading(heading)[0] if heading != table.time else heading, time_unit=stated,
        resample=resample, seconds=seconds, notes=notes,
    )  # fmt: skip
