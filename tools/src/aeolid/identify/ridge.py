"""Solve a regression with Tikhonov's penalty, chosen by generalised cross-validation on the filter that is applied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError

Array = NDArray[np.float64]
EXACT = 1e-13  # residual power below this fraction of an output's power is rounding: the data are interpolated
LEAST_FREEDOM = 0.02  # of the windows; nearer to interpolation the score is 0/0 and says nothing


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Hold a regression in singular coordinates: y ≈ P diag(s) Vᵀ θ.

    values (k,): s, largest first; projected (k, l): Pᵀ y; outside (l,): power of y that no regressor reaches; count:
    number of samples.
    """

    values: Array
    projected: Array
    outside: Array
    count: int


def filter_factors(spectrum: Spectrum, regularization: str | float) -> tuple[Array, Array]:
    """Return λ (l,) of each output and s²/(s² + λ²) as (l, k).

    regularization: "gcv", "none" or λ relative to the largest singular value.
    """
    s = spectrum.values
    outputs = spectrum.projected.shape[1]
    if isinstance(regularization, str):
        if regularization not in ("gcv", "none"):
            raise UsageError(f"regularization {regularization!r} is none of gcv, none or a number")
        penalty = np.zeros(outputs)
        if regularization == "gcv":
            penalty = np.array([choose_penalty(spectrum, j) for j in range(outputs)])
    else:
        if not 0 <= regularization < 1:
            raise UsageError(
                f"regularization {regularization} is not within 0 … 1 (relative to the largest singular value)"
            )
        penalty = np.full(outputs, regularization * s.max(initial=0.0))
    return penalty, s**2 / (s**2 + penalty[:, None] ** 2)


def gcv_score(spectrum: Spectrum, output: int, penalty: float) -> float:
    """Return N ‖(I − F) y‖²/(N − tr F)², F = P diag(s²/(s² + λ²)) Pᵀ, with floors where both vanish.

    On data that can be interpolated exactly the residual and N − tr F go to zero together. The residual is floored at
    rounding, 1e-13 of the power, and λ with N − tr F below 2 % of N are given no score.
    """
    s, y = spectrum.values, spectrum.projected[:, output]
    leftover = penalty**2 / (s**2 + penalty**2)
    power = float((y**2).sum() + spectrum.outside[output])
    residual = float(((leftover * y) ** 2).sum() + spectrum.outside[output])
    freedom = spectrum.count - len(s) + float(leftover.sum())
    if freedom < LEAST_FREEDOM * spectrum.count:
        return np.inf
    return spectrum.count * max(residual, EXACT * power) / freedom**2


def choose_penalty(spectrum: Spectrum, output: int) -> float:
    """Return the λ with the lowest score, 0 where none is better."""
    from scipy.optimize import minimize_scalar  # half a second to load

    s = spectrum.values
    if spectrum.outside[output] <= EXACT * float((spectrum.projected[:, output] ** 2).sum()) and (
        spectrum.count - len(s) >= LEAST_FREEDOM * spectrum.count
    ):
        return 0.0  # fewer regressors than samples reproduce the output: nothing needs damping

    def cost(log_penalty: float) -> float:
        return gcv_score(spectrum, output, float(np.exp(log_penalty)))

    grid = np.linspace(np.log(s[-1] * 1e-2), np.log(s[0]), 80)
    scores = [cost(g) for g in grid]
    place = int(np.argmin(scores))
    if gcv_score(spectrum, output, 0.0) <= scores[place]:
        return 0.0
    around = (grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)])
    if not np.isfinite([cost(edge) for edge in around]).all():
        return float(np.exp(grid[place]))  # next to where the score ends
    found = minimize_scalar(cost, bounds=around, method="bounded")
    return float(np.exp(found.x if found.fun <= scores[place] else grid[place]))
