"""Hold a free gain to values with which errors die out wherever the data lead a nonlinear model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.evaluation import HUGE, Evaluator
from aeolid.diagnose.predictor.gains import forgets, row_matrix
from aeolid.diagnose.predictor.point import Free, Point

Array = NDArray[np.float64]
_SAME = 1e-6  # of the largest entry, by which slopes that are differences may differ
_SMALLER = (1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.1, 0.05)  # shares of a gain, the largest that holds is gone on from


def runs_away_at(evaluator: Evaluator, point: Point) -> tuple[tuple[Array, Array], ...]:
    """Return the places (x, u) that segments lead to, all of them where at one errors of a free gain grow; else none.

    Places are the states of the rows at which a coordinate is largest or smallest, where the model goes on otherwise
    than at the middle; u the typical input. Between stops a gain may be the best there is while in contact it takes the
    model further in with every row: touches of one row hide it, one of two rows is without end. Cost: one pass, 2 n
    Jacobians a segment, and as many eigenvalue decompositions where they differ.
    """
    if point.K is None:
        return ()
    step, gain = evaluator.segments[0].step, evaluator.gain(point)
    usual = row_matrix(evaluator.compiled, evaluator.middle, point.theta, step)
    near = _SAME * float(np.max(np.abs(usual), initial=0.0))
    places = tuple(
        place for place in _extremes(evaluator, point)
        if not np.allclose(row_matrix(evaluator.compiled, place, point.theta, step), usual, rtol=0.0, atol=near)
    )  # fmt: skip
    held = all(forgets(evaluator.compiled, place, point.theta, gain, step) for place in places)
    return () if held else places


def _extremes(evaluator: Evaluator, point: Point) -> Iterator[tuple[Array, Array]]:
    for index, segment in enumerate(evaluator.segments):
        states = evaluator.run(point, index)[2]
        if np.all(np.isfinite(states)):
            rows = {int(r) for r in (*np.argmax(states, axis=0), *np.argmin(states, axis=0))}
            yield from ((states[row].copy(), segment.middle) for row in sorted(rows))


def held_starts(evaluator: Evaluator, points: tuple[Point, ...], free: Free) -> list[Point]:
    """Return each point with the largest share of its gain that an evaluator with places allows; none without one."""
    found = []
    for point in points:
        if point.K is None or not free.gain:
            continue
        trials = (replace(point, K=share * point.K) for share in _SMALLER)
        found += [first for first in [next((t for t in trials if evaluator.objective(t) < HUGE), None)] if first]
    return found
