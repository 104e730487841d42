"""Go on where a likelihood has kinks: where a limit or level meets a sample, slopes promise what is not there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.evaluation import Evaluator
from aeolid.diagnose.predictor.point import Free, Point

Array = NDArray[np.float64]
_LADDER = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # steps along one value, in typical sizes, to both sides
_MOST = 8  # values that are looked along


@dataclass(frozen=True, eq=False)
class Beyond:
    """Hold the best point along single values, its objective, and the places in the free θ that stand on a kink."""

    value: float
    point: Point
    kinks: tuple[int, ...]


def beyond_kinks(predictor: Evaluator, value: float, point: Point, free: Free, promised: Array) -> Beyond:
    """Look along each free θ whose slope promises a gain that no step brought: `promised` (k,) nats, above none.

    The likelihood of a limit has a kink wherever it meets a recorded sample, and a local optimum at many of them: a
    saturated drive stood at one, 100 nats short, and held all other values where they were, for no step that moved it
    gained. Cost: twelve filter passes a value, eight values at most.
    """
    scales, found, kinks = predictor.scales, (value, point), []
    loudest = sorted(range(len(free.theta)), key=lambda place: -promised[place])[:_MOST]
    for place in (p for p in loudest if promised[p] > 0):
        index = free.theta[place]
        size, best = float(scales.theta[index]), value
        for share in (s * way for s in _LADDER for way in (-1.0, 1.0)):
            theta = point.theta.copy()
            theta[index] = np.clip(theta[index] + share * size, scales.low[index], scales.high[index])
            trial = replace(point, theta=theta)
            reached = predictor.objective(trial)
            best = min(best, reached)
            found = min(found, (reached, trial), key=lambda pair: pair[0])
        if best >= value:
            kinks.append(place)
    return Beyond(*found, tuple(kinks))
