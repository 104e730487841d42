"""Differentiate a predictor: finite differences of the whitened innovations, several parameters a filter pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.evaluation import Evaluator
from aeolid.diagnose.predictor.noise import Noise, whiten_lanes
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.models.machine_code import LANES

Array = NDArray[np.float64]
_POOL = ThreadPoolExecutor(max_workers=2)  # the compiled filter releases the interpreter lock
_DIVERGED = 1e100
_LEAST = 1e-8  # step of a noise variance, in squares of its typical size
_STEP = 1e-6  # of a typical size, for finite differences; at 1e-5 scores moved by 2e-4 when the channels changed units


@dataclass(frozen=True, eq=False)
class Variant:
    """Hold a point a small step h away in one direction; `segment` where only one stretch's start has moved."""

    point: Point
    h: float
    segment: int | None = None


def sensitivity(predictor: Evaluator, point: Point, noise: Noise, base: Array, free: Free) -> Array:
    """Return d(−residual)/d(parameter) (M, k): forward differences for `free`, then the noise model's own.

    Zero for a parameter whose small step makes the model run away, and for one that moves nothing: a fit leaves both
    where they are. One filter pass for every LANES parameters, on two threads.
    """
    variants = [theta_variant(point, {i: step_of(predictor, i, point)}) for i in free.theta]
    variants += [noise_variant(point, i) for i in free.noise]
    variants += [gain_variant(predictor, point, i, j) for i, j in free.gain]
    segments = range(len(predictor.segments))
    variants += [_x0_variant(predictor, point, s, i) for s in segments for i in free.x0]
    found = columns(predictor, point, noise, base, [*variants, Variant(point, 1.0)])
    own = found[:, :-1]
    with np.errstate(invalid="ignore"):
        for column, v in zip(own.T, variants, strict=True):
            if v.segment is None:  # less what rounds otherwise side by side: divided by h it is no slope of zero
                column -= found[:, -1] / v.h
            if not np.all(np.abs(column) < _DIVERGED):  # NaN too: a small step made the model run away
                column[:] = 0.0
    if not variants or not len(noise.var):
        return own
    return np.hstack([own, _var_columns(predictor, point, noise)])


def columns(predictor: Evaluator, at: Point, noise: Noise, base: Array, variants: Sequence[Variant]) -> Array:
    """Return the change of −residual (M, k) a unit of each variant's step; `base` is the residual at `at`.

    A variant may start from another point than `at`, as long as the residual there is the same. A column lies in one
    piece: 180 of them were twice as dear to work on across.
    """
    result = np.zeros((len(variants), len(base))).T
    jobs = []
    for places in _alike(predictor, at, variants):
        for first in range(0, len(places), LANES):
            jobs.append(partial(_fill, result, predictor, at, noise, base, variants, places[first : first + LANES]))
    list(_POOL.map(lambda job: job(), jobs))
    return result


def _fill(
    result: Array, predictor: Evaluator, at: Point, noise: Noise, base: Array, variants: Sequence[Variant],
    places: Sequence[int],
) -> None:  # fmt: skip
    """Write the columns of up to LANES variants of one kind."""
    chosen = [variants[p] for p in places]
    only, outputs = chosen[0].segment, predictor.segments[0].y.shape[1]
    rows = [(len(s.y) - s.burn) * outputs for s in predictor.segments]
    first = 0 if only is None else sum(rows[:only])
    steps, points = np.array([v.h for v in chosen]), [v.point for v in chosen]
    gains = predictor.wide_gain(points)
    for i in range(len(rows)) if only is None else [only]:
        still = base[first : first + rows[i], None]
        e, moved = predictor.wide(at, points, gains, i), np.empty((rows[i], LANES))
        scored = predictor.scored(i, len(noise.var)).masks
        whiten_lanes(e, scored, noise.var, noise.factor, noise.early_factor, moved)
        with np.errstate(over="ignore", invalid="ignore"):  # a model that runs away
            result.T[places, first : first + rows[i]] = ((still - moved[:, : len(places)]) / steps).T
        first += rows[i]


def _alike(predictor: Evaluator, at: Point, variants: Sequence[Variant]) -> list[list[int]]:
    """Group variants that may run side by side: the same inputs behind the filters, the same stretches.

    Those that move a filter come last: inputs behind the others are those of the point itself, which are known.
    """
    model = predictor.compiled.model
    own = [model.index(p) for f in model.filters for p in f.parameters]
    groups: dict[tuple[int | None, bytes], list[int]] = {}
    still = at.theta[own].tobytes()
    for place, v in enumerate(variants):
        groups.setdefault((v.segment, v.point.theta[own].tobytes()), []).append(place)
    return [groups[key] for key in sorted(groups, key=lambda k: k[1] != still)]


def _var_columns(predictor: Evaluator, point: Point, noise: Noise) -> Array:
    """Return d(−residual)/d(VAR coefficient) (M, q l²): the noise model is estimated too and is projected out.

    Leaving them in the step is Kaufman's variable projection: the fit then converges in a few iterations although
    the noise model follows every step.
    """
    outputs = predictor.segments[0].y.shape[1]
    order = len(noise.var)
    parts = []
    for s, (e, segment) in enumerate(zip(predictor.innovations(point), predictor.segments, strict=True)):
        past = np.zeros((order, *e.shape))
        for i in range(1, order + 1):
            past[i - 1, i:] = np.where(np.isfinite(e[:-i]), e[:-i], 0.0)
        known, early = predictor.scored(s, order).masks
        past[:, early | ~known] = 0.0  # early rows know of no lags
        lagged = past[:, segment.burn :].transpose(1, 0, 2)  # (rows, q, l)
        block = lagged[:, None, :, None, :] * noise.factor.T[None, :, None, :, None]  # −dr[t, c] / dA_i[a, b]
        parts.append(block.reshape(len(lagged) * outputs, -1))
    return np.vstack(parts)


def step_of(predictor: Evaluator, index: int, point: Point) -> float:
    """Return a finite-difference step for one θ, into the allowed range."""
    h = _STEP * max(float(predictor.scales.theta[index]), abs(float(point.theta[index])))
    return h if point.theta[index] + h <= predictor.scales.high[index] else -h


def theta_variant(point: Point, steps: Mapping[int, float]) -> Variant:
    """Move these θ together; columns are a unit of the first step."""
    theta = point.theta.copy()
    for index, h in steps.items():
        theta[index] += h
    return Variant(replace(point, theta=theta), next(iter(steps.values())))


def noise_variant(point: Point, index: int) -> Variant:
    """Move a noise amplitude; columns are a unit of its square (variance)."""
    amplitude = point.noise.copy()
    h = max(1e-3 * float(amplitude[index]) ** 2, _LEAST)
    amplitude[index] = np.sqrt(amplitude[index] ** 2 + h)
    return Variant(replace(point, noise=amplitude), h)


def gain_variant(predictor: Evaluator, point: Point, state: int, output: int) -> Variant:
    """Move K[state, output]."""
    assert point.K is not None
    h = _STEP * float(predictor.scales.gain[state, output])
    K = point.K.copy()
    K[state, output] += h
    return Variant(replace(point, K=K), h)


def _x0_variant(predictor: Evaluator, point: Point, segment: int, state: int) -> Variant:
    h = _STEP * predictor.scales.x0[state]
    x0 = list(point.x0)
    x0[segment] = x0[segment].copy()
    x0[segment][state] += h
    return Variant(replace(point, x0=tuple(x0)), h, segment)
