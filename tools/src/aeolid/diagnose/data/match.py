"""Bring a simulator's runs and the recordings to the same channels and the same sample time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.errors import DataError
from aeolid.record import Record
from aeolid.units import factor

_SAME = 1e-6  # of a ratio of sample times, within which it is a whole number


def matched(records: Sequence[Record], runs: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """Return recordings and runs with the channels that all have, by name, in the recordings' order, at one step.

    Sides with a shorter sample time keep the samples at the longest one; nothing is averaged, since a logger picks
    samples, too. The runs' numbers are brought to the recordings' units (kN m to N m). Outputs and channels
    that only describe (azimuth, wind) may be missing on either side and are left out of both. Raises DataError
    where an input is missing, no output is left, or one sample time is no multiple of the other.
    """
    first = records[0]
    names = [c.name for c in first.channels]
    for run in runs:
        there = {c.name: c for c in run.channels}
        for channel in first.of("input"):
            if channel.name not in there:
                raise DataError(
                    f"{run.source}: no channel {channel.name!r}, an input of {first.source}; its roles file must name"
                    " it"
                )
        roles = {c.name: c.role for c in first.channels}
        names = [n for n in names if n in there and there[n].role == roles[n]]
        if not any(there[n].role == "output" for n in names):
            raise DataError(
                f"{run.source}: no output of {first.source} is among its channels; names pair the two files"
            )
    runs = [_in_units_of(run, first) for run in runs]
    step = max(r.sample_time_s for r in (*runs, first))
    return tuple(_brought(r, names, step) for r in records), tuple(_brought(r, names, step) for r in runs)


def _in_units_of(run: Record, first: Record) -> Record:
    """Return the run with its channels in the recordings' units, where both are units of one quantity."""
    wanted = {c.name: c.unit for c in first.channels}
    scales = [factor(c.unit, wanted.get(c.name, c.unit)) for c in run.channels]
    if all(s in (None, 1.0) for s in scales):
        return run
    changed = [c if s is None else replace(c, unit=wanted.get(c.name, c.unit)) for c, s in
               zip(run.channels, scales, strict=True)]  # fmt: skip
    values = run.values * np.array([1.0 if s is None else s for s in scales])
    return replace(run, channels=tuple(changed), values=values)


def _brought(record: Record, names: Sequence[str], step: float) -> Record:
    every = step / record.sample_time_s
    whole = round(every)
    if abs(every - whole) > _SAME * every:
        raise DataError(
            f"{record.source}: sample time {record.sample_time_s:g} s is no whole part of {step:g} s; resample one side"
        )
    channels = {c.name: (i, c) for i, c in enumerate(record.channels)}
    places = [channels[n][0] for n in names]
    return replace(
        record, time_s=record.time_s[::whole], values=record.values[::whole, places], sample_time_s=step,
        channels=tuple(replace(channels[n][1], column=None) for n in names),
    )  # fmt: skip
