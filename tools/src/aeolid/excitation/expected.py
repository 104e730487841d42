"""Predict the deviations of an identification before there is a recording.

The windows v_k = [z_{k-p} … z_k] of VARX and PBSIDopt enter an identification by their Gram matrix Σ v vᵀ alone. Its
expectation under a design is known: that of what the signal causes, about its mean, and (N − p) Toeplitz(R_{i−j}) of
the noise, R_τ = E z_{k+τ} z_kᵀ,
and a factor of it goes through the very regressions, decompositions and first-order analysis that a recording goes
through (`markov`, `subspace`, `pole_spread`). What comes out are the deviations that `identify` will state, up to the
chance in the Gram matrix, including the cost of a finite past window and of directions that a signal leaves unexcited.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.markov import estimate_markov
from aeolid.identify.pole_spread import Spreader
from aeolid.identify.subspace import find_states, largest_useful_order, system_matrices
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Method:
    """Hold how the recording will be identified: past and future window, order, inputs with feedthrough."""

    past: int
    future: int
    order: int
    feedthrough: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class PoleSpread:
    """Hold poles (n,) and the covariance (n, 2, 2) of real and imaginary part of each."""

    values: ComplexArray
    covariance: Array

    def near(self, pole: complex) -> Array:
        """Return the covariance (2, 2) of the pole that is nearest to a value."""
        return np.asarray(self.covariance[int(np.argmin(abs(self.values - pole)))], dtype=np.float64)


def window_gram(z: Array, past: int) -> Array:
    """Return Σ (v_k − v̄)(v_k − v̄)ᵀ (q, q) of the windows of p + 1 samples of z (N, m), q = (p + 1) m.

    Blocks along a diagonal differ by a sample at either end, so that the cost is N q m and q² operations. Windows that
    hang over the ends, as in an estimate of covariances, would be other data: their errors are as large as signals.
    """
    windows, m = len(z) - past, z.shape[1]
    G = np.empty((past + 1, m, past + 1, m))
    for j in range(past + 1):
        G[0, :, j] = z[:windows].T @ z[j : j + windows]
        G[j, :, 0] = G[0, :, j].T
    for i in range(past):
        ends = np.einsum("a,jb->ajb", z[windows + i], z[windows : windows + past])
        G[i + 1, :, 1:] = G[i, :, :-1] + ends - np.einsum("a,jb->ajb", z[i], z[:past])
    mean = np.array([z[i : i + windows].mean(axis=0) for i in range(past + 1)]).ravel()
    out: Array = G.reshape(len(mean), len(mean)) - windows * np.outer(mean, mean)
    return out


def noise_gram(covariances: Array, windows: int) -> Array:
    """Return the expectation (q, q) of Σ v vᵀ of a stationary noise with R_τ (p + 1, m, m)."""
    past, m = len(covariances) - 1, covariances.shape[1]
    lags = np.arange(past + 1)[:, None] - np.arange(past + 1)  # row block − column block
    blocks = np.where((lags >= 0)[..., None, None], covariances[abs(lags)], covariances[abs(lags)].swapaxes(-1, -2))
    return windows * np.asarray(blocks.transpose(0, 2, 1, 3).reshape((past + 1) * m, (past + 1) * m))


def expected_factor(gram: Array, past: int, windows: int, inputs: int) -> WindowFactor:
    """Return the factor of windows with this Gram matrix (q, q); cost O(q³)."""
    m = len(gram) // (past + 1)
    values, vectors = np.linalg.eigh((gram + gram.T) / 2)
    full = np.zeros((len(gram) + 1, len(gram) + 1))
    full[0, 0] = np.sqrt(windows)
    full[1:, 1:] = triangularise(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
    return WindowFactor(full, past, inputs, m - inputs, windows, 0)


def predicted_poles(factor: WindowFactor, method: Method, regularization: str = "gcv") -> PoleSpread:
    """Return the poles that PBSIDopt finds of expected windows, and their covariance.

    factor: of [u; y], each channel in units of its deviation. regularization: cross-validation, the default of an
    identification, or "none". An order beyond the singular values above rounding is lowered to them.
    """
    markov = estimate_markov(factor, method.feedthrough, regularization)
    basis = find_states(factor, markov.theta, method.future)
    order = min(method.order, largest_useful_order(basis))
    model = system_matrices(factor, basis.state_map(order), method.feedthrough)
    spreader = Spreader(factor, basis, model, markov, method.feedthrough)
    return PoleSpread(spreader.values, spreader.covariances())
