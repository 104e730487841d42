"""Find places to start a fit from: declared ranges sampled evenly, each with a ladder of noise gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.quiet import quieted
from aeolid.diagnose.structure import modal
from aeolid.diagnose.structure.forces import FORCE, RATE

_MOST, _FEWEST = 128, 16  # points; powers of two, as the Sobol sequence wants
_PASSES = 1_000_000  # samples times points: keeps the search to seconds on long recordings
NOISE_LADDER = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)  # process noise amplitudes to try, in sizes of the states
_KEEP = 6
TRIED = 4  # starts that are fitted briefly
_QUICK, _FULL = 5, 40  # Gauss–Newton iterations to compare starts, and to finish


def explore(predictor: Predictor, origin: Point, free: Free, fixed: Sequence[int] = ()) -> list[Point]:
    """Return the best of up to 128 points spread over the declared ranges of the free parameters (log above zero).

    Parameters without two finite ends, or listed in `fixed`, stay where `origin` has them; noise amplitudes
    are tried on a ladder.
    """
    from scipy.stats import qmc  # a second to load

    scales = predictor.scales
    moving = [
        i for i in free.theta
        if i not in fixed and np.isfinite(scales.high[i] - scales.low[i]) and scales.high[i] > scales.low[i]
    ]  # fmt: skip
    if not moving:
        return []
    samples = sum(len(s.u) for s in predictor.segments)
    count = _FEWEST
    while count < _MOST and 2 * count * samples <= _PASSES:
        count *= 2
    declared = predictor.compiled.model.x0
    found: list[tuple[float, Point]] = []
    for row in qmc.Sobol(len(moving), scramble=True, seed=1).random(count):
        theta = origin.theta.copy()
        for i, share in zip(moving, row, strict=True):
            low, high = scales.low[i], scales.high[i]
            theta[i] = low * (high / low) ** share if low > 0 else low + share * (high - low)
        point = replace(origin, theta=theta, x0=tuple(declared.copy() for _ in origin.x0))
        for candidate in noise_ladder(point, core(predictor, free).noise):
            found.append((predictor.objective(candidate), candidate))
        if predictor.deadline.skips("some of the places to start from"):
            break
    found.sort(key=lambda pair: pair[0])
    return [point for value, point in found[:_KEEP] if value < 1e299]


def core(predictor: Predictor, free: Free) -> Free:
    """Return what may move first: not the unmeasured forces, nor what a simulator's run determines.

    Amplitudes and decay rates of the forces stay as they are, and so does the linear model of a run: where much is
    missing it would be bent far out of shape before the effect has its say (a tower's mode then ended at 0.11 Hz
    instead of 0.335).
    """
    model = predictor.compiled.model
    quiet = {i for i, s in enumerate(model.states) if s.name.startswith(FORCE)}
    rates = {i for i, p in enumerate(model.parameters) if p.name.startswith((RATE, modal.PREFIX))}
    return replace(
        free,
        theta=tuple(i for i in free.theta if i not in rates),
        noise=tuple(i for i in free.noise if i not in quiet),
    )


def noise_ladder(point: Point, noisy: Sequence[int]) -> list[Point]:
    """Return the point with the listed process noises at each rung of the ladder; itself where there is none."""
    states = len(point.x0[0])
    moving = [i for i in noisy if i < states]
    if not moving:
        return [point]
    result = []
    for level in NOISE_LADDER:
        noise = point.noise.copy()
        noise[moving] = level
        result.append(replace(point, noise=noise))
    return result


def fit_best(predictor: Predictor, starts: Sequence[Point], free: Free, tried: int = TRIED) -> Fit | None:
    """Fit briefly from the `tried` most likely starts, fully from the best; returns None where all diverge."""
    best = fit_briefly(predictor, starts, free, tried)
    return None if best is None else fit_fully(predictor, best[1], free)


def fit_briefly(
    predictor: Predictor, starts: Sequence[Point], free: Free, tried: int = TRIED
) -> tuple[float, Point] | None:
    """Return the best objective and point that a few steps from the `tried` most likely starts lead to.

    They move the `core` only: white noise first, its memory last, so that a force with memory does not take the place
    of a parameter that is still far off.
    """
    few = core(predictor, free)
    ranked = sorted(((predictor.objective(s), i) for i, s in enumerate(starts)))[:tried]
    trials: list[tuple[float, Point] | None] = []
    for value, i in ranked:
        if value < 1e299 and (not trials or not predictor.deadline.skips("some of the starts of a fit")):
            trials.append(predictor.climb(starts[i], few, iterations=_QUICK))
    return min((t for t in trials if t is not None), key=lambda t: t[0], default=None)


def fit_fully(predictor: Predictor, start: Point, free: Free) -> Fit | None:
    """Fit the `core` to the end, then all that is free."""
    few = core(predictor, free)
    found = predictor.climb(start, few, iterations=_FULL) if few != free else None
    return fit_quietly(predictor, start if found is None else found[1], free)


def fit_quietly(
    predictor: Predictor, start: Point, free: Free, iterations: int = _FULL, tolerance: float = 0.02
) -> Fit | None:
    """Fit, and lower what process noise nobody would miss; None where the start diverges.

    tolerance: nats below which a fit stops.
    """
    fit = predictor.fit(start, free, iterations, tolerance)
    if fit is None or not free.noise or predictor.deadline.passed:
        return fit
    quiet = quieted(predictor, fit.point, free)
    return fit if quiet is fit.point else predictor.at(quiet, free)
