"""Bring channels of different rates, or of one uneven rate, to one uniform clock.

Between two samples of a channel its value goes on a straight line, an angle the shorter way round. Nothing is averaged,
as a logger does not either, and nothing is put across a gap of more than three of the channel's own steps. Time runs
forward in the samples of each channel: what repeats or goes backwards is no uneven rate but two recordings in one.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import guard_size
from aeolid.formats.table import Array, Table, listed
from aeolid.formats.timebase import Grid, require_running_clock
from aeolid.models.angles import turn_of
from aeolid.models.fill_values import fill_values_in, sentence
from aeolid.record import Channel

log = logging.getLogger("aeolid.formats")
AUTO = "auto"
_ACTING = ("input", "output", "excitation")
_BRIDGED = 3.0  # own steps of a channel that a straight line may span
_MOST_SAMPLES = 200_000_000


@dataclass(frozen=True, eq=False)
class Series:
    """Hold the samples of one channel: time in seconds and value (n,), both finite, time rising."""

    channel: Channel
    time: Array
    values: Array

    @property
    def step(self) -> float:
        """Return the median step in seconds."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


def series_of(table: Table, channel: Channel, time: Array, values: Array) -> Series:
    """Return the samples of a channel that are there; time (n,) and values (n,) as the file has them.

    Rows that hold other channels' samples alone may stand between them, at the same instant too. Samples that read a
    fill value are not there, and a warning says so: no straight line leads to such a value. Raises DataError where
    fewer than two are left, and where the time of one is missing, repeats or goes backwards.
    """
    source = table.source
    filled = fill_values_in(values)
    for value, count in zip(*np.unique(values[filled], return_counts=True), strict=True):
        log.warning(sentence(source, channel.name, float(value), int(count)))
    rows = np.flatnonzero(np.isfinite(values) & ~filled)
    if len(rows) < 2:
        raise DataError(f'{source}: channel {channel.name!r} has fewer than two samples; give it the role "ignore"')
    require_running_clock(table, time[rows], rows, channel.name)
    return Series(channel, time[rows], values[rows])


def resampled(source: str, series: Sequence[Series], wanted: float | str) -> tuple[Grid, Array]:
    """Return the clock all channels have in common, and their values (N, channels) on it.

    wanted: the sample time in seconds, or "auto": the longest among inputs, outputs and excitations, so that none of
    those is filled in between its samples. The clock spans what all channels cover. A sentence says what was done.
    """
    acting = [s for s in series if s.channel.role in _ACTING] or list(series)
    step = float(f"{max(s.step for s in acting):.6g}") if wanted == AUTO else float(wanted)
    first = max(s.time[0] for s in series)
    last = min(s.time[-1] for s in series)
    count = int(np.floor((last - first) / step + 1e-6)) + 1 if last >= first else 0
    if count < 2:
        raise DataError(
            f"{source}: its channels have no {step:g} s in common: one begins at {first:.6g} s, one ends at"
            f" {last:.6g} s"
        )
    if count > _MOST_SAMPLES:
        raise DataError(f"{source}: {count} samples at {step:g} s, at most {_MOST_SAMPLES} are made; resample coarser")
    guard_size(source, 16 * count * len(series))
    at = first + step * np.arange(count)
    columns = [_at(s, at) for s in series]
    _say(source, series, step, count)
    return Grid(float(first), step, np.arange(count)), np.column_stack(columns)


def _at(series: Series, at: Array) -> Array:
    values = series.values
    turn = turn_of(series.channel.unit) if series.channel.role == "azimuth" else None
    if turn is not None:
        values = np.unwrap(values, period=turn)
    found = np.interp(at, series.time, values)
    after = np.clip(np.searchsorted(series.time, at), 1, len(series.time) - 1)
    gap = series.time[after] - series.time[after - 1]
    near = np.minimum(abs(series.time[after] - at), abs(series.time[after - 1] - at)) < 1e-6 * series.step
    found[(gap > _BRIDGED * series.step) & ~near] = np.nan
    return np.mod(found, turn) if turn is not None else found


def _say(source: str, series: Sequence[Series], step: float, count: int) -> None:
    rates: dict[str, list[str]] = {}
    for s in series:
        rates.setdefault(f"{s.step:.4g}", []).append(s.channel.name)
    told = "; ".join(f"every {rate} s {listed(names, 4)}" for rate, names in rates.items())
    log.warning(
        "%s: resampled to %.6g s, %d samples, along straight lines between samples, nothing averaged (recorded: %s)",
        source, step, count, told,
    )  # fmt: skip
