"""Predict the deviations of an identification before there is a recording.

The windows v_k = [z_{k-p} … z_k] of VARX and PBSIDopt enter an identification by their Gram matrix Σ v vᵀ alone. Its
expectation under a design is known,
    E Σ v vᵀ = N Toeplitz(R_{i−j}),   R_τ = Σ z_{k+τ} z_kᵀ / N of the signal's answer + E z_{k+τ} z_kᵀ of the noise,
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


def expected_factor(covariances: Array, samples: int, inputs: int) -> WindowFactor:
    """Return the factor of the expected windows of p + 1 samples; covariances R_τ (p + 1, m, m), z = [u; y].

    Cost: O(q³), q = (p + 1) m.
    """
    past, m = len(covariances) - 1, covariances.shape[1]
    lags = np.arange(past + 1)[:, None] - np.arange(past + 1)  # row block − column block
    blocks = np.where((lags >= 0)[..., None, None], covariances[abs(lags)], covariances[abs(lags)].swapaxes(-1, -2))
    gram = blocks.transpose(0, 2, 1, 3).reshape((past + 1) * m, (past + 1) * m)
    values, vectors = np.linalg.eigh((gram + gram.T) / 2)
    windows = samples - past
    full = np.zeros((len(gram) + 1, len(gram) + 1))
    full[0, 0] = np.sqrt(windows)
    full[1:, 1:] = triangularise(np.sqrt(np.maximum(values, 0.0) * windows)[:, None] * vectors.T)
    return WindowFactor(full, past, inputs, m - inputs, windows, 0)


def predicted_poles(covariances: Array, samples: int, method: Method) -> PoleSpread:
    """Return the poles that PBSIDopt finds of the expected windows, and their covariance.

    covariances (p + 1, m, m) of [u; y], each channel in units of its deviation. An order beyond the singular values
    above rounding is lowered to them.
    """
    factor = expected_factor(covariances, samples, len(method.feedthrough))
    markov = estimate_markov(factor, method.feedthrough, "gcv")
    basis = find_states(factor, markov.theta, method.future)
    order = min(method.order, largest_useful_order(basis))
    model = system_matrices(factor, basis.state_map(order), method.feedthrough)
    spreader = Spreader(factor, basis, model, markov, method.feedthrough)
    return PoleSpread(spreader.values, spreader.covariances())
