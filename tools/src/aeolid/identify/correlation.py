"""Correlate one signal with the past of another, and whiten it first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from aeolid.decompositions import lstsq

Array = NDArray[np.float64]
NEARLY = 0.02  # of the largest variance over lags
WHITENING_ORDER = 30  # of the autoregression that whitens an input before it is correlated
FLOOR = 1e-4  # of an input's deviation: whitened rests below are rounding and the ends of windows, and noise is added


def lagged_correlation(x: Array, past: Array, lags: int) -> Array:
    """Return the correlation of x_k with past_{k−τ}, τ = 1 … lags, as (lags,)."""
    x, past = x - x.mean(), past - past.mean()
    size = float(np.sqrt((x @ x) * (past @ past))) or 1.0
    return np.array([x[t:] @ past[:-t] / size for t in range(1, lags + 1)])


def whiten(u: Array, order: int = WHITENING_ORDER, lengths: Sequence[int] = ()) -> Array:
    """Return the prediction errors (N,) of an autoregression fitted to u; the first `order` samples are zero.

    An input of few lines is predicted to rounding, whose correlations are those of no noise: where less than FLOOR of
    its deviation is left, white noise of that size is added to it first, the same in every call. lengths: samples of
    the stretches that u is made of, default one; the first `order` samples of each are zero.
    """
    u = u - u.mean()
    order = min(order, len(u) // 10)
    if order == 0 or not u.any():
        return u
    left = _predicted(u, order, lengths)
    if left.std() >= FLOOR * u.std():
        return left
    return _predicted(u + FLOOR * u.std() * np.random.default_rng(0).standard_normal(len(u)), order, lengths)


def _predicted(u: Array, order: int, lengths: Sequence[int]) -> Array:
    """Return the errors (N,) of an autoregression of u (N,) about its mean, zero for the first `order` of a stretch."""
    pieces = np.split(u, np.cumsum(lengths[:-1], dtype=np.intp))
    windows = [np.lib.stride_tricks.sliding_window_view(p[:-1], order) for p in pieces if len(p) > order]
    rows, target = np.concatenate(windows), np.concatenate([p[order:] for p in pieces])  # (N − pieces order, order)
    coefficients = lstsq(rows.T @ rows, rows.T @ target, rcond=1e-12)
    errors = iter(np.split(target - rows @ coefficients, np.cumsum([len(w) for w in windows[:-1]], dtype=np.intp)))
    return np.concatenate(
        [np.zeros(len(p)) if len(p) <= order else np.concatenate([np.zeros(order), next(errors)]) for p in pieces]
    )


@dataclass(frozen=True, eq=False)
class Spaced:
    """Hold a signal about its mean, its stretches apart by `lags` samples, so that no lag joins two of them.

    values (M,): zero where missing and between the stretches; known (M,): 1 where there is a sample, else 0.
    """

    values: Array
    known: Array
    stretches: int
    lags: int

    @classmethod
    def of(cls, x: Array, lengths: Sequence[int], lags: int) -> Spaced:
        """Return a signal (N,), not a number where missing, of stretches of these lengths."""
        at = np.arange(len(x)) + lags * np.repeat(np.arange(len(lengths)), lengths)
        there = np.isfinite(x)
        values, known = np.zeros((2, int(at[-1]) + 1))
        values[at] = np.where(there, x - (x[there].mean() if there.any() else 0.0), 0.0)
        known[at] = there
        return cls(values, known, len(lengths), lags)

    def after(self, past: Spaced, lags: int) -> tuple[Array, Array]:
        """Return the correlation with past_{k−τ}, τ = 1 … lags, and by how many samples it is known, both (lags,).

        Of one stretch without gaps that is `lagged_correlation`, known by all samples.
        """
        rho, here, there = lagged_correlation(self.values, past.values, lags), self.known.sum(), past.known.sum()
        pairs = np.array([self.known[t:] @ past.known[:-t] + self.stretches * t for t in range(1, lags + 1)])
        pairs = np.clip(pairs, 1.0, min(here, there))  # those that an end of a stretch takes count as before
        return rho * (np.sqrt(here * there) / pairs), pairs

    def own(self) -> Array:
        """Return the autocorrelation at lags 0 … lags − 1, as (lags,)."""
        return np.concatenate([[1.0], self.after(self, self.lags - 1)[0]])


def explained_share(rho: Array, own: Array) -> float:
    """Return the part of a variance, 0 … 1, that the past of a signal explains by linear regression.

    rho (lags,): correlations with past_{k−τ}; own (lags,): autocorrelation of the past signal at lags 0 … lags − 1.
    R² = ρᵀ T⁻¹ ρ, T the Toeplitz matrix of `own`: Σ ρ² of a signal that is not white counts the same variance several
    times over and is no share.
    """
    weights = lstsq(toeplitz(own), rho, rcond=1e-10)
    return float(np.clip(rho @ weights, 0.0, 1.0))


def free_of_spectrum(rho: Array, own: Array) -> tuple[float, int]:
    """Return ρᵀ T⁺ ρ and the rank of T⁺: times N it is χ² of so many degrees for a white x, whatever the past signal.

    rho, own: as in `explained_share`. Directions of T below NEARLY of its largest are left out: whitening leaves them
    where an input is of few lines, and there the ends of the recording outweigh it.
    """
    values, vectors = np.linalg.eigh(toeplitz(own))
    kept = values > NEARLY * values[-1]
    return float(np.sum((vectors[:, kept].T @ rho) ** 2 / values[kept])), int(kept.sum())
