"""Push the noise of the Markov parameters through PBSIDopt to the poles.

First-order analysis of van Wingerden (asymptotic variance of PBSIDopt) in closed form: with the windows fixed, all
randomness enters through ΔΞ with cov(vec ΔΞ) = Λ ⊗ (Z Zᵀ)⁻¹. Then ΔX = S ΔΓK Z, ΔE = −ΔΞ Ψ and
    ΔA = (ΔT Z₊ − A ΔT Z₋ + K ΔΞ Ψ) M†, columns of the state,      M = [X; U; E],
so that the change of an eigenvalue λ with left and right vectors w, v (wᴴ v = 1) is linear in ΔΞ:
    Δλ = wᴴ ΔA v = Σ_i (S_iᵀ w)ᴴ ΔΞ [shift_i (Z₊ − λ Z₋) M†v] + (Kᵀ w)ᴴ ΔΞ Ψ M†v.
Assumed: order and window chosen, (A − K C)ᵖ negligible, e white. Cost: O(n (p m)²), no array of recording length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.subspace import ScaledModel, StateBasis
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def pole_covariance(factor: WindowFactor, basis: StateBasis, model: ScaledModel, markov: MarkovEstimate) -> Array:
    """Return the covariance (n, 2, 2) of real and imaginary part of each pole, in the order of eig(model.A)."""
    values, right = np.linalg.eig(model.A)
    try:
        left = np.linalg.inv(right).conj().T  # columns w with wᴴ v = 1
    except np.linalg.LinAlgError:  # a defective A has no first-order expansion of its poles
        return np.full((len(values), 2, 2), np.nan)
    order, m, outputs = len(model.A), factor.channels, factor.outputs
    width = factor.past * m
    blocks = basis.selector(order).reshape(order, -1, outputs)  # S_i (n, l), i = 0 … f − 1
    past, following, regressors = _projections(factor, basis.state_map(order), model)
    covariance = np.zeros((order, 2, 2))
    for j, value in enumerate(values):
        v, w = right[:, j], left[:, j]
        moved = following @ v - value * (past @ v)  # (p m,)
        gradient = np.zeros((outputs, len(regressors)), dtype=complex)
        for i in range(blocks.shape[1]):
            # block row i of ΓK holds Ξ shifted right by i blocks: Ξ's column c meets row c + i m
            gradient[:, : width - i * m] += np.outer(blocks[:, i].T @ w.conj(), moved[i * m :])
        gradient += np.outer(model.K.T @ w.conj(), regressors @ v)
        covariance[j] = _real_and_imaginary(gradient, markov)
    return covariance


def _projections(factor: WindowFactor, T: Array, model: ScaledModel) -> tuple[Array, Array, Array]:
    """Return Z₋ M†, Z₊ M† (p m, n) and Ψ M† (p m + r, n), the columns of the state."""
    R, m, r, n = factor.R, factor.channels, factor.inputs, len(T)
    width = factor.past * m
    now, u, y = R[:, :width] @ T.T, factor.u_now, factor.y_now
    e = y - now @ model.C.T - u @ model.D.T
    M = np.hstack([now, u, e])
    pseudo = np.linalg.pinv(M, rcond=1e-11).T[:, :n]  # (q, n) in the coordinates of R
    return R[:, :width].T @ pseudo, R[:, m : width + m].T @ pseudo, R[:, : width + r].T @ pseudo


def _real_and_imaginary(gradient: ComplexArray, markov: MarkovEstimate) -> Array:
    """Return the covariance (2, 2) of Δλ = Σ gradient ∘ ΔΞ under cov(vec Ξ) = Λ ⊗ G Gᵀ."""
    reached = gradient @ markov.spread  # (l, rank)
    parts = [reached.real, reached.imag]
    return np.array([[float(np.sum(a * (markov.residual_covariance @ b))) for b in parts] for a in parts])
