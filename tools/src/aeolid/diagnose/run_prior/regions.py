"""Tell in which region of operation runs and recordings are: one linear predictor serves one wind speed.

Runs whose mean inputs and outputs lie within a deviation of each other are one region. A recording belongs to the
nearest, and regions that nothing was recorded in are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Side

Array = NDArray[np.float64]


def in_regions(recordings: Sequence[Side], runs: Sequence[Side]) -> tuple[tuple[Side, ...], tuple[Side, ...]]:
    """Return recordings and runs with the region of each, numbered from 0 in the order of the runs."""
    levels = np.stack([_level(s) for s in runs])
    spread = np.sqrt(np.mean([_channels(s).var(axis=0) for s in runs], axis=0))
    spread = np.where(spread > 0, spread, 1.0)
    group = _grouped(levels / spread)
    nearest = [group[_nearest(_level(s) / spread, levels / spread)] for s in recordings]
    used = [k for k in dict.fromkeys(group) if k in nearest]
    return (
        tuple(replace(s, region=used.index(k)) for s, k in zip(recordings, nearest, strict=True)),
        tuple(replace(s, region=used.index(k)) for s, k in zip(runs, group, strict=True) if k in used),
    )


def _channels(side: Side) -> Array:
    known = [side.u, side.y] if side.d is None else [side.u, side.y, side.d]
    return np.hstack(known)[~side.missing]


def _level(side: Side) -> Array:
    found: Array = _channels(side).mean(axis=0)
    return found


def _nearest(level: Array, levels: Array) -> int:
    return int(np.argmin(np.linalg.norm(levels - level, axis=1)))


def _grouped(levels: Array) -> list[int]:
    """Return for each run the first run of its region: runs that are near, or near one that is, belong together."""
    rules = in_force().run_prior
    group = list(range(len(levels)))
    for i in range(len(levels)):
        for j in range(i):
            if np.max(np.abs(levels[i] - levels[j])) <= rules.region_distance and group[i] != group[j]:
                low, high = sorted((group[i], group[j]))
                group = [low if g == high else g for g in group]
    return group
