"""Bridge short gaps in recorded channels that the model does not use, and say so; long ones leave the channel out (S0).

A gap in an output updates no state, one in an input of the model cuts the recording there. A channel that only the
catalogue may ask for (rotor angle, wind, waves) must do neither: it would cost every other effect its samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.exogenous import ROLES
from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.rules import in_force
from aeolid.models.angles import turn_of, wraps
from aeolid.models.equations import Equations
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """Hold where a channel (N,) has no value: samples start to stop, the latter not included."""

    start: int
    stop: int

    def __len__(self) -> int:
        """Return how many samples are missing."""
        return self.stop - self.start


def bridged_case(case: Case) -> tuple[Case, tuple[Finding, ...]]:
    """Return the case with the short gaps of its unused channels bridged, and a finding for each such channel.

    Values go on in a straight line, angles on the shorter way that their usual pace leads to; before the first and
    after the last value they keep it, angles their pace. A run of a simulator uses every input and disturbance.
    """
    findings, records = [], list(case.records)
    for channel in case.records[0].channels:
        if channel.role not in _roles(case) or channel.name in _used(case):
            continue
        gaps = [gaps_of(r.column(channel.name)) for r in records]
        if not any(gaps) or any(not np.isfinite(r.column(channel.name)).any() for r in records):
            continue
        findings += _findings(channel, gaps, sum(len(r) for r in records))
        records = [_bridged(r, channel, own) for r, own in zip(records, gaps, strict=True)]
    return replace(case, records=tuple(records)), tuple(findings)


def gaps_of(values: Array) -> list[Gap]:
    """List the gaps of a channel (N,) in their order.

    >>> gaps_of(np.array([np.nan, 1.0, np.nan, np.nan, 2.0]))
    [Gap(start=0, stop=1), Gap(start=2, stop=4)]
    """
    missing = np.concatenate([[False], ~np.isfinite(values), [False]])
    edges = np.flatnonzero(missing[1:] != missing[:-1])
    return [Gap(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def bridged(values: Array, gaps: Sequence[Gap], turn: float | None = None) -> Array:
    """Return a channel (N,) with these gaps filled; turn: a whole turn in the unit of an angle.

    >>> bridged(np.array([320.0, 340.0, 0.0, np.nan, 40.0]), [Gap(3, 4)], turn=360.0).tolist()
    [320.0, 340.0, 0.0, 20.0, 40.0]
    """
    found = values.copy()
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    if turn is not None:
        steps = steps - turn * np.rint(steps / turn)
    pace = float(np.median(steps)) if turn is not None and len(steps) else 0.0
    for gap in gaps:
        n = len(gap)
        if gap.start == 0:
            found[: gap.stop] = values[gap.stop] + pace * np.arange(-n, 0)
        elif gap.stop == len(values):
            found[gap.start :] = values[gap.start - 1] + pace * np.arange(1, n + 1)
        else:
            before, change = values[gap.start - 1], values[gap.stop] - values[gap.start - 1]
            if turn is not None:
                change -= turn * np.rint((change - pace * (n + 1)) / turn)
            found[gap.start : gap.stop] = before + change * np.arange(1, n + 1) / (n + 1)
    if turn is not None and wraps(values, turn):
        known = values[np.isfinite(values)]
        low = np.floor(2 * known.min() / turn) * turn / 2  # a range from 0 or from half a turn below it
        rows = ~np.isfinite(values)
        found[rows] = low + np.mod(found[rows] - low, turn)
    return found


def _roles(case: Case) -> tuple[str, ...]:
    """Return the roles of which a channel may be bridged."""
    is_model = isinstance(case.baseline, Equations | StateSpace)
    return ROLES if is_model else tuple(r for r in ROLES if r not in ("input", "disturbance"))


def _used(case: Case) -> set[str]:
    """Return the names of the channels that the baseline takes or gives."""
    model = case.baseline
    if not isinstance(model, Equations | StateSpace):
        return set()
    return {signal.name for signal in model.inputs} | {signal.name for signal in model.outputs}


def _bridged(record: Record, channel: Channel, gaps: Sequence[Gap]) -> Record:
    """Return a recording with the short gaps of one channel bridged."""
    short = [g for g in gaps if len(g) <= in_force().data.bridged_rows]
    if not short:
        return record
    values = record.values.copy()
    at, turn = [c.name for c in record.channels].index(channel.name), turn_of(channel.unit)
    is_angle = turn is not None and (channel.role == "azimuth" or wraps(values[:, at], turn))
    values[:, at] = bridged(values[:, at], short, turn if is_angle else None)
    return replace(record, values=values)


def _findings(channel: Channel, gaps: Sequence[Sequence[Gap]], every: int) -> list[Finding]:
    """Say what was bridged, or why no effect can ask for the channel."""
    most = in_force().data.bridged_rows
    sizes = [len(g) for own in gaps for g in own]
    missing = f"{sum(sizes)} of {every} samples are missing"
    if max(sizes) <= most:
        return [Finding("missing", channel.name, f"{missing}, at most {max(sizes)} in a row; bridged", "info")]
    text = f"{missing}, up to {max(sizes)} in a row: the channel is left out unless the model's inputs lack them, too"
    return [Finding("missing", channel.name, f"{text}; split the recording there to have its effects asked", "warning")]
