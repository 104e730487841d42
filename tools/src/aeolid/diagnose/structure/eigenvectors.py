"""Eigenvectors of linear models, some of which have too few: chains of delays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vectors = NDArray[np.complex128]
_DEFECTIVE = 1e-7  # by which the inverse of the eigenvectors may miss the unit matrix, and all that rounding may cost


def inverse_of(right: Array | Vectors) -> Vectors | None:
    """Return the inverse (n, n) of eigenvectors by columns (n, n); None where there are too few of them for one.

    Two that differ by rounding alone have an inverse that multiplies to the unit matrix exactly and whose numbers are
    beyond all measure: of two delays in a row it had 1e291, and a mode beside them a size of 1e273.
    """
    try:
        found = np.asarray(np.linalg.inv(right), dtype=complex)
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(found)) or np.abs(found).max() * np.finfo(float).eps > _DEFECTIVE:
        return None
    return found if np.allclose(found @ right, np.eye(len(right)), atol=_DEFECTIVE) else None


def left_vectors(A: Array, values: Vectors, right: Vectors) -> Vectors:
    """Return the left eigenvectors (n, n) by rows, each with product 1 with its right one.

    A chain of delays has too few right eigenvectors for an inverse; the vectors of the oscillatory modes, which lie
    apart from its eigenvalue 0, are then those of Aᵀ.
    """
    found = inverse_of(right)
    if found is not None:
        return found
    own, vectors = np.linalg.eig(A.T)
    rows = np.stack([vectors[:, int(np.argmin(np.abs(own - value)))] for value in values])
    products = np.sum(rows * right.T, axis=1)
    safe = np.where(np.abs(products) > 0, products, 1.0)
    return np.asarray(rows / safe[:, None], dtype=complex)
