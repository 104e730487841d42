"""Say how uncertain an identified model is: covariance of its poles, and the band of its frequency response."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from aeolid.errors import UsageError
from aeolid.identify.bands import Band, frequency_response, grid, on_circle, response_covariance
from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.subspace import ScaledModel, StateBasis
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
METHODS = ("asymptotic", "bootstrap", "none")


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Hold what is known of a model's uncertainty.

    poles (n, 2, 2): covariance of real and imaginary part of each, in the order of eig(A); band: of the model in scaled
    units; both None where nothing is known. facts: JSON facts beyond the settings.
    """

    poles: Array | None = None
    band: Band | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def require_method(method: str) -> None:
    """Refuse an unknown way to find uncertainty."""
    if method not in METHODS:
        raise UsageError(f"uncertainty {method!r} is none of {', '.join(METHODS)}")


def asymptotic(
    factor: WindowFactor, basis: StateBasis, fitted: ScaledModel, model: ScaledModel, markov: MarkovEstimate,
    through: tuple[bool, ...], sample_time_s: float,
) -> Uncertainty:  # fmt: skip
    """Push the noise of Ξ through to first order.

    fitted: as the regressions gave it; model: the same, or with poles moved inside, whose response the band is around.
    """
    spread = matrix_spread(factor, basis, fitted, markov, through)
    poles = in_order_of(pole_covariance(fitted.A, spread), fitted.A, model.A)
    frequency = grid(sample_time_s, np.linalg.eigvals(model.A).astype(complex))
    z = on_circle(frequency, sample_time_s)
    covariance = response_covariance(model, spread, z)
    known = bool(np.isfinite(covariance).all())
    return Uncertainty(poles, Band(frequency, frequency_response(model, z), covariance) if known else None)


def in_order_of(covariance: Array, before: Array, after: Array) -> Array:
    """Return the poles' covariance (n, 2, 2) in the order of eig(after): each pole's goes to the nearest one."""
    if after is before:
        return covariance
    distance = abs(np.linalg.eigvals(after)[:, None] - np.linalg.eigvals(before)[None])
    rows, columns = linear_sum_assignment(distance)
    out: Array = covariance[columns[np.argsort(rows)]]
    return out
