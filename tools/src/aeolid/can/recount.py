"""Find where the index of a node's samples does not go on: it may have been set up anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.can.judging import SHUFFLE

HOLE, HOLE_MOST = 1000, 30_000  # samples that may be missing while nobody supposes a restart
AHEAD = 16  # messages after a leap within which the count before it goes on if it was a stray
TRIED_MOST = 64  # leaps of a batch looked at one by one; with more of them the first one left counts


def find_recount(index: NDArray[np.uint16], last: int | None, every: int) -> int | None:
    """Return the first of the sample messages (n,) that begins another count; None where all go on.

    last: index before them; every: the node sends every k-th sample. A leap after which the count before it goes on is
    a stray.
    """
    if not len(index):
        return None
    near = SHUFFLE * max(every, 1)
    told = index.astype(np.int64)
    step = _wrapped(np.diff(told, prepend=told[0] if last is None else last))
    leaps = np.flatnonzero((step < -near) | (step > min(max(HOLE, 8 * every), HOLE_MOST)))
    known = -1  # up to here the leaps are those of strays
    for tried, at in enumerate(leaps.tolist()):
        if at <= known:
            continue
        if tried >= TRIED_MOST:
            return int(at)
        before = int(told[at - 1]) if at or last is None else last
        on = _wrapped(told[at + 1 : at + 1 + AHEAD] - before)
        again = np.flatnonzero((on >= 0) & (on <= near))
        if not len(again):
            return int(at)
        known = at + 1 + int(again[0])
    return None


def _wrapped(step: NDArray[np.int64]) -> NDArray[np.int64]:
    return (step + 32768) % 65536 - 32768
