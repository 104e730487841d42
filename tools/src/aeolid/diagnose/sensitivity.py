"""Differentiate a predictor: one filter pass a parameter, by finite differences of the whitened innovations."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.noise import Noise
from aeolid.diagnose.point import Free, Point

if TYPE_CHECKING:
    from aeolid.diagnose.predictor import Predictor

Array = NDArray[np.float64]
_POOL = ThreadPoolExecutor(max_workers=2)  # the compiled filter releases the interpreter lock
_STEP = 1e-6  # of a typical size, for finite differences; at 1e-5 scores moved by 2e-4 when the channels changed units


def sensitivity(predictor: Predictor, point: Point, noise: Noise, base: Array, free: Free) -> Array:
    """Return d(−residual)/d(parameter) (M, k): forward differences for `free`, then the noise model's own.

    One filter pass a parameter, on two threads.
    """
    jobs: list[Callable[[], Array]] = []
    segments = range(len(predictor.segments))
    steps = [{i: step_of(predictor, i, point)} for i in free.theta]
    jobs += [partial(theta_column, predictor, point, noise, base, step) for step in steps]
    jobs += [partial(noise_column, predictor, point, noise, base, i) for i in free.noise]
    jobs += [partial(gain_column, predictor, point, noise, base, i, j) for i, j in free.gain]
    jobs += [partial(_x0_column, predictor, point, noise, base, s, i) for s in segments for i in free.x0]
    columns = list(_POOL.map(lambda job: job(), jobs))
    return np.column_stack([*columns, _var_columns(predictor, point, noise)]) if columns else np.zeros((len(base), 0))


def _var_columns(predictor: Predictor, point: Point, noise: Noise) -> Array:
    """Return d(−residual)/d(VAR coefficient) (M, q l²): the noise model is estimated too and is projected out.

    Leaving them in the step is Kaufman's variable projection: the fit then converges in a few iterations although
    the noise model follows every step.
    """
    outputs = predictor.segments[0].y.shape[1]
    order = len(noise.var)
    if not order:
        return np.zeros((sum(len(s.y) - s.burn for s in predictor.segments) * outputs, 0))
    parts = []
    for e, segment in zip(predictor.innovations(point), predictor.segments, strict=True):
        past = np.zeros((order, *e.shape))
        for i in range(1, order + 1):
            past[i - 1, i:] = np.where(np.isfinite(e[:-i]), e[:-i], 0.0)
        lagged = past[:, segment.burn :].transpose(1, 0, 2)  # (rows, q, l)
        block = np.einsum("tib,ac->tciab", lagged, noise.factor)  # −dr[t, c] / dA_i[a, b]
        parts.append(block.reshape(len(lagged) * outputs, -1))
    return np.vstack(parts)


def step_of(predictor: Predictor, index: int, point: Point) -> float:
    """Return a finite-difference step for one θ, into the allowed range."""
    h = _STEP * max(float(predictor.scales.theta[index]), abs(float(point.theta[index])))
    return h if point.theta[index] + h <= predictor.scales.high[index] else -h


def theta_column(predictor: Predictor, point: Point, noise: Noise, base: Array, steps: dict[int, float]) -> Array:
    """Return the change of −residual (M,) a unit of the first step when these θ move together."""
    theta = point.theta.copy()
    for index, h in steps.items():
        theta[index] += h
    moved = predictor.whitened(predictor.innovations(replace(point, theta=theta)), noise)
    return (base - moved) / next(iter(steps.values()))


def noise_column(predictor: Predictor, point: Point, noise: Noise, base: Array, index: int) -> Array:
    """Return the change of −residual (M,) a unit of a noise amplitude's square (variance)."""
    amplitude = point.noise.copy()
    h = max(1e-3 * float(amplitude[index]) ** 2, 1e-6)
    amplitude[index] = np.sqrt(amplitude[index] ** 2 + h)
    return (base - predictor.whitened(predictor.innovations(replace(point, noise=amplitude)), noise)) / h


def gain_column(predictor: Predictor, point: Point, noise: Noise, base: Array, state: int, output: int) -> Array:
    """Return the change of −residual (M,) a unit of K[state, output]."""
    assert point.K is not None
    h = _STEP * float(predictor.scales.gain[state, output])
    K = point.K.copy()
    K[state, output] += h
    return (base - predictor.whitened(predictor.innovations(replace(point, K=K)), noise)) / h


def _x0_column(predictor: Predictor, point: Point, noise: Noise, base: Array, segment: int, state: int) -> Array:
    h = _STEP * predictor.scales.x0[state]
    x0 = list(point.x0)
    x0[segment] = x0[segment].copy()
    x0[segment][state] += h
    alone = predictor.on([predictor.segments[segment]])
    moved = alone.whitened(alone.innovations(replace(point, x0=(x0[segment],))), noise)
    outputs = predictor.segments[0].y.shape[1]
    before = sum(len(s.y) - s.burn for s in predictor.segments[:segment]) * outputs
    column = np.zeros(len(base))
    column[before : before + len(moved)] = (base[before : before + len(moved)] - moved) / h
    return column
