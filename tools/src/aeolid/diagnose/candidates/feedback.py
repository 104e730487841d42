"""Say how much innovations tell of the inputs of their own row: a controller answers the output's error (S1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor

Array = NDArray[np.float64]
_PAST = 40  # samples of an input's own past: longer than steps are held
_KNOWN = 1e-9  # share below which an input's own past foretells all of it: a sequence that no output can add to
_LEVELS = 5  # samples of a held input's own past
_ROWS = 20_000  # rows that show feedback


def feedback_of(predictor: Predictor, point: Point, kinds: Sequence[tuple[int, str]]) -> float:
    """Return the nats that the innovations of a row tell of its inputs beyond what the inputs' own past does.

    kinds: place and look of each input that may be fed back. A controller answers them; an input that is then let into
    the prediction of its own row, or between rows, brings them along. -n/2 ln(1 - share) of what the past leaves of
    each input is the most that this can gain. An input that is held is asked where it changes. In open loop, where an
    input read wrongly is in the innovations, what reading it rightly gains is far more: most of it is in the past of a
    smooth input.
    """
    pairs = zip(predictor.segments, predictor.innovations(point), strict=True)
    long = [(s, e) for s, e in pairs if len(e) > 4 * _PAST]
    total = 0.0
    for place, kind in kinds if long else ():
        own, seen, now = (np.vstack(p)[:_ROWS] for p in zip(*(_pasts(s, e, place, kind) for s, e in long), strict=True))
        alone, both = (_left(X, now) for X in (own, np.hstack([own, seen])))
        if len(now) > own.shape[1] + seen.shape[1] and alone > _KNOWN * float(np.sum(now**2)):
            total += 0.5 * len(now) * float(np.log(alone / max(both, 1e-12 * alone)))
    return total


def _left(X: Array, now: Array) -> float:
    return float(np.sum((now - X @ lstsq(X, now, rcond=1e-10)) ** 2))


def _pasts(segment: Segment, errors: Array, place: int, kind: str) -> tuple[Array, Array, Array]:
    """Return one and an input's past, the innovations (n, l) and the input (n, 1) of the same row, whole rows only."""
    u, first = segment.u[:: segment.stride, place : place + 1], _PAST + 1
    lags = range(1, (_LEVELS if kind == "held" else _PAST) + 1)
    own = np.hstack([np.ones((len(u) - first, 1)), *(u[first - i : len(u) - i] for i in lags)])
    seen = errors[first:]
    rows = np.all(np.isfinite(seen), axis=1)
    if kind == "held":
        rows &= u[first:, 0] != u[first - 1 : -1, 0]
    return own[rows], seen[rows], u[first:][rows]
