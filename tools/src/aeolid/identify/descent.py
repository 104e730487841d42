"""Take damped Gauss–Newton steps down a prediction-error criterion, for time-invariant and scheduled models alike.

The criterion and the derivatives are the model's own; what is common is the damped step from a triangular factor of
the weighted [∂e/∂θ, e], when to stop, and the covariance that the information leaves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import svd

Array = NDArray[np.float64]
Model = TypeVar("Model")
MOST_STEPS = 15
ENOUGH = 1e-5  # gain in log error power per output below which no further step is taken
DAMPING = tuple(10.0**k for k in range(-6, 4))  # relative to the largest singular value squared


def descend(
    start: Model,
    loss_of: Callable[[Model], float],
    factor_of: Callable[[Model], Array],
    move: Callable[[Model, Array], Model],
    *,
    steps: int,
    floor: float,
    enough: float = ENOUGH,
) -> Iterator[Model]:
    """Yield the start and the model after each step, until a step gains too little.

    loss_of: mean log error power per output, infinite for a model that is not admitted; factor_of: triangular factor
    (npar + 1, npar + 1) of the weighted [∂e/∂θ, e]; move: the model with Δθ (npar,) added; floor: loss below which the
    errors are rounding and no step is taken; enough: gain in loss below which no further step is taken.
    """
    model = start
    yield model
    loss = loss_of(model)
    for _ in range(steps):
        if not np.isfinite(loss) or loss <= floor:
            return
        R = factor_of(model)
        if not usable(R):
            return
        model, found = _best_step(model, R, loss, loss_of, move)
        if loss - found < enough:
            return
        loss = found
        yield model


def _best_step(
    model: Model, R: Array, loss: float, loss_of: Callable[[Model], float], move: Callable[[Model, Array], Model]
) -> tuple[Model, float]:
    """Return the best model along the damped steps and its loss, the model itself where none is better."""
    size = R.shape[1] - 1
    scale = column_scale(R)
    U, s, Vt = svd(R[:size, :size] / scale)
    target = U.T @ R[:size, size]
    best, least = model, loss
    for damping in DAMPING:
        candidate = move(model, -(Vt.T @ (s / (s**2 + damping * s[0] ** 2) * target)) / scale)
        found = loss_of(candidate)
        if found < least:
            best, least = candidate, found
        elif best is not model:
            break
    return best, least


def column_scale(R: Array) -> Array:
    """Return the sizes (npar,) of the derivatives in a factor (npar + 1, npar + 1), none zero."""
    out: Array = np.maximum(np.sqrt((R[:, :-1] ** 2).sum(axis=0)), 1e-300)
    return out


def usable(R: Array) -> bool:
    """Return whether derivatives are numbers that can be squared; those of a predictor at its limit may not be."""
    return bool((abs(R) < 1e100).all())


def covariance_root(R: Array, free: int) -> Array:
    """Return L (npar, free) with cov θ = L Lᵀ, the inverse of the information RᵀR on its `free` largest directions."""
    size = R.shape[1] - 1
    scale = column_scale(R)
    _, s, Vt = svd(R[:size, :size] / scale)
    root: Array = (Vt[:free].T / s[:free]) / scale[:, None]
    return root
