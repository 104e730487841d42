"""Weigh the prediction errors of several outputs: log det of their covariance, without trust in exact combinations.

Where noise reaches fewer directions than outputs (a gust that moves speed and tower alike) Λ is singular, and log det Λ
falls without end along the combination that the past predicts exactly. Steps then follow that combination alone, whose
small rest is what the model class lacks: feedthrough of a controller, rounding. The criterion is therefore

    log det(Λ + κ diag Λ) = Σ log Λ_ii + log det(R + κ I),    R the correlation of the errors,

free of units, with κ the share below which a direction counts as free of noise (`positive_real`). Its derivative is
tr(W Wᵀ dΛ) with W Wᵀ = M + κ diag M, M = (Λ + κ diag Λ)⁻¹. Since M Λ M ≤ M, the inverse information with M in the
place of Λ⁻¹ is no less than the covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.positive_real import RANK

Array = NDArray[np.float64]
FLOOR = 1e-6  # of the largest eigenvalue of Λ, added to all: what is exact from the start has no weight without end
RESOLVED = 1e-20  # error power in scaled units below which a prediction is exact to rounding


def least_of(covariance: Array) -> float:
    """Return what is added to the powers of all outputs, from a covariance (l, l) of errors in scaled units."""
    return FLOOR * float(np.linalg.eigvalsh(covariance)[-1])


def weight_of(covariance: Array, least: float | None = None) -> Array:
    """Return W (l, l), by which errors are multiplied from the right; least: by default of this covariance."""
    values, vectors, size = _shared(covariance, least_of(covariance) if least is None else least)
    M = (vectors / values) @ vectors.T
    values, vectors = np.linalg.eigh(M + RANK * np.diag(np.diag(M)))
    out: Array = vectors * np.sqrt(values) / size[:, None]
    return out


def log_det(covariance: Array, least: float) -> float:
    """Return the criterion over the number of outputs: a mean log power; infinite for what is not finite."""
    if not np.isfinite(covariance).all():
        return float(np.inf)
    values, _, size = _shared(covariance, least)
    return float(np.mean(np.log(values)) + 2 * np.mean(np.log(size)))


def _shared(covariance: Array, least: float) -> tuple[Array, Array, Array]:
    """Return eigenvalues and eigenvectors of R + κ I, and the outputs' deviations (l,)."""
    power = np.maximum(np.diag(covariance), 0) + max(least, RESOLVED)
    size = np.sqrt(power)
    R = covariance / np.outer(size, size)
    np.fill_diagonal(R, 1.0)
    values, vectors = np.linalg.eigh(R)
    return np.maximum(values, 0) + RANK, vectors, size
