"""Project directions on what a baseline can do by itself (S4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import svd

Array = NDArray[np.float64]
_RANK = 1e-7  # of the largest singular value, below which a direction is rounding


def span(jacobian: Array) -> Array:
    """Return an orthonormal basis (M, q) of the columns of a Jacobian (M, k), each taken at unit length."""
    size = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian[:, size > 0] / size[size > 0]
    if not scaled.shape[1]:
        return np.zeros((len(jacobian), 0))
    U, s, _ = svd(scaled)
    result: Array = U[:, s > _RANK * s[0]]
    return result


def outside(G: Array, baseline: Array) -> Array:
    """Return the part of G outside the baseline's span; projected twice, orthogonal to rounding."""
    once = G - baseline @ (baseline.T @ G)
    result: Array = once - baseline @ (baseline.T @ once)
    return result
