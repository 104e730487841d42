"""What a change of the inputs within a sample adds to the states of a model in discrete time.

Such a model was made for held inputs, x⁺ = Φ x + Γ u with Φ = e^X, X = A h. Of an input that goes from m − s/2 to
m + s/2 in the sample Γ m is the mean's share, exact; the ramp about it adds ∫ e^{A (h − t)} B (t/h − 1/2) s dt, which
is −ψ(X) Γ s with ψ(X) = coth(X/2)/2 − X⁻¹ = X/12 − X³/720 + …. With T = tanh(X/2) = (Φ − 1)(Φ + 1)⁻¹, which needs no
logarithm of a matrix, ψ = T/6 + 2T³/45 + O(T⁵), here as (T/6)(1 − 4T²/15)⁻¹, which is bounded for every stable pole:
off by 0.3 % of itself at |X| = 1, by 12 % for a mode of three samples a period.

Without it the position of a mass, which the force of a sample has moved by its first moment, is off by θ²/12 of a
sine, θ = ωh: 6 % at eight samples a period, of which less than 0.1 % is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_EMPTY = 1e-9  # of the largest entry of Φ: what is smaller is none


def added_by_ramps(A: Array, B: Array) -> Array:
    """Return −ψ(X) Γ (n, r) of Φ = A (n, n) and Γ = B (n, r).

    Zero for states that only hand on what an input or another such state was a sample before: a dead time in samples
    says nothing of what lies between them. Zero, too, where Φ has an eigenvalue of −1, as no sampled plant has one.
    """
    result = np.zeros_like(B)
    kept = ~_handing_on(A)
    own, eye = A[kept][:, kept], np.eye(int(kept.sum()))
    try:
        T = np.linalg.solve(own + eye, own - eye)
        found = -np.linalg.solve(eye - (4.0 / 15.0) * (T @ T), T @ B[kept]) / 6.0
    except np.linalg.LinAlgError:
        return result
    result[kept] = np.where(np.isfinite(found), found, 0.0)
    return result


def _handing_on(A: Array) -> NDArray[np.bool_]:
    """Tell which states (n,) depend on no state, or on such alone."""
    seen = np.abs(A) > _EMPTY * np.max(np.abs(A), initial=0.0)
    found = np.zeros(len(A), dtype=bool)
    for _ in range(len(A)):
        found = ~np.any(seen[:, ~found], axis=1)
    return found
