"""Foretell data that were not fitted row by row, their start known only as well as the rows before tell it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.evaluation import Evaluator
from aeolid.diagnose.predictor.noise import Noise
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.sensitivity import sensitivity

Array = NDArray[np.float64]
_WIDE = 10.0  # deviation of a start that no row tells, in sizes of the state


def foretold(predictor: Evaluator, point: Point, noise: Noise, states: Sequence[int]) -> tuple[Array, Array] | None:
    """Return whitened one-step errors (M,) of all segments, and what each row's density pays for its start (N,).

    With r the residuals at the settled start and J their slopes −∂r/∂x_0, the start is off by δ ~ N(0, P), where P⁻¹ is
    the information JᵀJ of the rows that settled it. Each row is foretold by those before it, r = J δ + white noise:
    recursive least squares (Ljung 1999, section 11.2), which is the Kalman filter of a constant δ, so that the product
    of the densities is the likelihood with δ integrated out. A predictor that forgets within the settling rows gives
    the plain residuals. states: those whose start was settled. None where the model runs away.
    """
    free, parts, paid = Free((), (), (), tuple(states)), [], []
    for start, segment in zip(point.x0, predictor.segments, strict=True):
        found = _of_segment(predictor, replace(point, x0=(start,)), noise, free, segment)
        if found is None:
            return None
        parts.append(found[0].ravel())
        paid.append(found[1])
    return np.concatenate(parts), np.concatenate(paid)


def _of_segment(
    predictor: Evaluator, point: Point, noise: Noise, free: Free, segment: Segment
) -> tuple[Array, Array] | None:
    whole, count = predictor.on([replace(segment, burn=0)]), len(free.x0)
    base = whole.whitened(whole.innovations(point), noise)
    slopes = sensitivity(whole, point, noise, base, free)[:, :count]
    if not np.all(np.isfinite(base)):
        return None
    outputs = segment.y.shape[1]
    settling = slopes[: segment.burn * outputs]
    size = _WIDE * predictor.scales.x0[list(free.x0)]
    # in sizes of the states, which differ by many powers of ten
    information = np.eye(count) + (settling * size).T @ (settling * size)
    rows = len(base) // outputs
    r, J = base.reshape(rows, outputs)[segment.burn :], (slopes * size).reshape(rows, outputs, count)[segment.burn :]
    P: Array = np.linalg.inv(information).astype(np.float64)
    white, paid = np.empty_like(r), np.empty(len(r))
    _update(np.ascontiguousarray(r), np.ascontiguousarray(J), P, white, paid)
    return white, paid


@njit(cache=True, error_model="numpy", nogil=True)
def _update(r: Array, J: Array, P: Array, white: Array, paid: Array) -> None:
    """Write white (N, l) and −½ Σ log s of every row; r (N, l), J (N, l, n), P (n, n) changes."""
    d = np.zeros(len(P))
    for t in range(len(r)):
        paid[t] = 0.0
        for c in range(r.shape[1]):
            h = J[t, c]
            told = P @ h
            s = 1.0 + h @ told
            v = r[t, c] - h @ d
            white[t, c] = v / np.sqrt(s)
            paid[t] -= 0.5 * np.log(s)
            for i in range(len(d)):
                d[i] += told[i] * v / s
                for j in range(len(d)):
                    P[i, j] -= told[i] * told[j] / s
