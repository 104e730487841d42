"""Find starts for several effects at once from the simulation error, where the one-step likelihood has many optima."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.starts import starts_of
from aeolid.diagnose.predictor.explore import core, noise_ladder
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.scoring.scores import Row

_STILL = 1e-6  # process noise, in sizes of the states, with which a prediction is a simulation
_SPREAD = 16  # values of the effects, spread over their ranges; a power of two, as the Sobol sequence wants
_PASSES = 50_000  # samples times spread values: 16 on 3,000 samples, 1 on 50,000
_BRIEF, _LONG, _KEPT = 6, 20, 3  # Gauss–Newton iterations from each value, and from the best of them
_LIKELIEST = 8  # values that fits begin from of an effect that has a model of its own states, where each takes seconds


def simulation_starts(prepared: Prepared, base: Fit, rows: Sequence[Row], free: Free) -> list[Point]:
    """Return the effects fitted together to the simulation error of equations, with a ladder of process noises.

    A threshold that is not reached has no slope, and process noise takes the place of what is missing, so that of 24
    one-step fits of two overflowing tanks, all begun near the truth, three ended at the best and the others 70 to 200
    nats short. The simulation error is fitted from values spread over the effects' ranges instead, the baseline's own
    values as simulation without the effects has them. Nothing for a free gain, or where no process noise is free. Where
    an effect is rugged, from the likeliest of these values only.
    """
    predictor, model = prepared.predictor, prepared.extended
    if base.point.K is not None or not free.noise:
        return []
    noise = base.point.noise.copy()
    noise[: len(base.point.x0[0])] = _STILL
    simulator, physics = predictor.with_order(0), replace(core(predictor, free), noise=())
    groups = starts_of(prepared, base, rows)
    starts = [replace(p, noise=noise) for p in {p.theta.tobytes(): p for group in groups for p in group}.values()]
    slots = [s for r in rows for s in r.attachment.slots if s.name not in r.attachment.fixed]
    places = [model.index(s.name) for s in slots]
    bare = replace(physics, theta=tuple(i for i in physics.theta if i not in places))
    plain = [replace(base.point, theta=theta, noise=noise) for theta in (base.point.theta, model.theta)]
    origin = min((f for p in plain if (f := simulator.climb(p, bare, iterations=_LONG))), key=_value, default=None)
    if origin is not None:
        fixed = {model.index(n): v for r in rows for n, v in r.attachment.fixed.items()}
        starts += _spread(simulator, origin[1], fixed, places)
    if any(r.attachment.rugged for r in rows):
        starts = sorted(starts, key=simulator.objective)[:_LIKELIEST]
    brief = [f for p in starts if (f := simulator.climb(p, physics, iterations=_BRIEF))]
    kept = sorted(brief, key=_value)[:_KEPT]
    found = [f for _, p in kept if (f := simulator.climb(p, physics, iterations=_LONG))]
    return noise_ladder(min(found, key=_value)[1], core(predictor, free).noise) if found else []


def _spread(simulator: Predictor, origin: Point, fixed: dict[int, float], places: Sequence[int]) -> list[Point]:
    """Return the point with values spread over the ranges at some places of θ, log where they lie above zero."""
    from scipy.stats import qmc  # a second to load

    low, high = (v[list(places)] for v in (simulator.scales.low, simulator.scales.high))
    count = _SPREAD
    while count > 1 and count * sum(len(s.u) for s in simulator.segments) > _PASSES:
        count //= 2
    shares = qmc.Sobol(len(places), scramble=True, seed=1).random(count)
    theta = np.tile(origin.theta, (count, 1))
    theta[:, list(fixed)] = list(fixed.values())
    theta[:, list(places)] = _between(low, high, shares)
    return [replace(origin, theta=row) for row in theta]


def _between(low: NDArray[np.float64], high: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values (n, k) at these shares of the ranges low … high (k,)."""
    wide = low > 0
    ratio = np.divide(high, low, out=np.ones_like(low), where=wide)
    value: NDArray[np.float64] = np.where(wide, low * ratio**shares, low + shares * (high - low))
    return value


def _value(found: tuple[float, Point]) -> float:
    return found[0]
