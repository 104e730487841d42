"""Correlate one signal with the past of another, and whiten it first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from aeolid.decompositions import lstsq

Array = NDArray[np.float64]
WHITENING_ORDER = 30  # of the autoregression that whitens an input before it is correlated


def lagged_correlation(x: Array, past: Array, lags: int) -> Array:
    """Return the correlation of x_k with past_{k−τ}, τ = 1 … lags, as (lags,)."""
    x, past = x - x.mean(), past - past.mean()
    size = float(np.sqrt((x @ x) * (past @ past))) or 1.0
    return np.array([x[t:] @ past[:-t] / size for t in range(1, lags + 1)])


def whiten(u: Array, order: int = WHITENING_ORDER) -> Array:
    """Return the prediction errors (N,) of an autoregression fitted to u; the first `order` samples are zero."""
    u = u - u.mean()
    order = min(order, len(u) // 10)
    if order == 0 or not u.any():
        return u
    rows = np.lib.stride_tricks.sliding_window_view(u[:-1], order)  # (N − order, order)
    target = u[order:]
    coefficients = lstsq(rows.T @ rows, rows.T @ target, rcond=1e-12)
    return np.concatenate([np.zeros(order), target - rows @ coefficients])


def correlation(x: Array, lags: int) -> Array:
    """Return the autocorrelation of x (N,) at lags 0 … lags − 1, as (lags,)."""
    return np.concatenate([[1.0], lagged_correlation(x, x, lags - 1)])


def explained_share(rho: Array, own: Array) -> float:
    """Return the part of a variance, 0 … 1, that the past of a signal explains by linear regression.

    rho (lags,): correlations with past_{k−τ}; own (lags,): autocorrelation of the past signal at lags 0 … lags − 1.
    R² = ρᵀ T⁻¹ ρ, T the Toeplitz matrix of `own`: Σ ρ² of a signal that is not white counts the same variance several
    times over and is no share.
    """
    weights = lstsq(toeplitz(own), rho, rcond=1e-10)
    return float(np.clip(rho @ weights, 0.0, 1.0))
