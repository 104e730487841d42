"""Part each recording into what models are fitted to and what chooses between them, by the samples that tell something.

A cut at a place of the recording would leave nothing behind it where a sensor was lost before, and nothing to fit where
an input moves only afterwards. So the first FIT_PART of the samples in complete windows are fitted to, and where some
channel stands still for more than QUIET of them at first, of those from its first motion on. Complete recordings in
which everything moves are cut at FIT_PART of their length.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.windows import Scaling
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
FIT_PART = 0.7  # of the samples that count; the rest chooses the order
STILL = 0.01  # of a channel's deviation: within it about its first value a channel has not begun to move
QUIET = 0.25  # of the samples: a shorter quiet start leaves the fit part two thirds of what moves


def border(z: Array, past: int) -> int:
    """Return the first sample of scaled z (N, m) that is held out, not a number where missing.

    past: p; samples count that lie in a window of p + 1 complete ones. Without any: FIT_PART of N.
    """
    whole = np.zeros(len(z), dtype=bool)
    for start, stop in complete_stretches(z, past + 1):
        whole[start:stop] = True
    places = np.flatnonzero(whole)
    moving = places[places >= _first_motion(z)]
    if len(moving) and len(places) - len(moving) > QUIET * len(places):
        places = moving
    if not len(places):
        return round(FIT_PART * len(z))
    kept = round(FIT_PART * len(places))
    return int(places[kept]) if kept < len(places) else int(places[-1]) + 1


def border_of(record: Record, scaling: Scaling, past: int) -> int:
    """Return the first sample of a recording that is held out; see `border`."""
    plain = scaling.without_innovations()
    return border(plain.apply(record.columns(plain.names)), past)


def cut(records: Sequence[Record], scaling: Scaling, past: int) -> tuple[list[Record], list[Record]]:
    """Return the fit part of each recording, and the rest with the p samples before it, where its windows begin."""
    at = [border_of(r, scaling, past) for r in records]
    heads = [r.slice(0, b) for r, b in zip(records, at, strict=True)]
    return heads, [r.slice(max(b - past, 0), len(r)) for r, b in zip(records, at, strict=True)]


def _first_motion(z: Array) -> int:
    """Return the sample from which on every channel has moved; those that never do are left out."""
    first = 0
    for column in z.T:
        known = np.flatnonzero(np.isfinite(column))
        moved = known[abs(column[known] - column[known[0]]) > STILL] if len(known) else known
        first = max(first, int(moved[0]) if len(moved) else 0)
    return first
