"""Make an autoregression whose outputs have few states, for what it is to say of missing cells.

What measured cells tell leaves an autoregression of many lags free where cells are missing by a pattern: with every
third sample missing, any motion times (1 + w^k + w^2k)/3, w³ = 1, is zero at all others. Poles at the sums and
differences of frequencies then fit the measured cells as well, and draws hold them. Few states have no room for them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.chain import FLOOR, Chain, fit_chain
from aeolid.identify.markov import estimate_markov
from aeolid.identify.subspace import find_states, largest_useful_order, system_matrices
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
LONGEST = 200  # lags
FORGOTTEN = 1e-3  # of the predictor's state after the last lag


def fit_few_states(factor: WindowFactor, order: int, samples: Sequence[Array]) -> Chain:
    """Return the autoregression whose rows of outputs are the predictor of a model of n states.

    factor: of windows of p + 1 samples; order: n, fewer where the windows show fewer; samples: scaled stretches (N, m),
    of whose innovations the covariance is taken, inputs and outputs of one sample together. Rows of inputs have p lags.
    """
    short, r, m = fit_chain(factor), factor.inputs, factor.channels
    through = (False,) * r
    basis = find_states(factor, estimate_markov(factor, through, "gcv").theta, factor.past)
    order = min(order, largest_useful_order(basis))
    if order == 0:
        return short
    model = system_matrices(factor, basis.state_map(order), through)
    closed, answer = model.A - model.K @ model.C, np.hstack([model.B - model.K @ model.D, model.K])
    a = np.zeros((max(_lags(closed), factor.past) + 1, m, m))
    a[: len(short.a), :r], a[0] = short.a[:, :r], np.eye(m)
    for lag in a[1:]:
        lag[r:], answer = -model.C @ answer, closed @ answer
    chain = Chain(a, short.W)
    e = np.vstack([chain.innovations(z)[factor.past : len(z)] for z in samples])
    covariance = e.T @ e / max(len(e), 1) + FLOOR * np.eye(m)
    return Chain(a, np.asarray(np.linalg.inv(covariance), dtype=np.float64))


def _lags(closed: Array) -> int:
    """Return after how many samples a predictor has forgotten, LONGEST at most."""
    size = float(abs(np.linalg.eigvals(closed)).max())
    return LONGEST if size >= 1 else min(LONGEST, int(np.ceil(np.log(FORGOTTEN) / np.log(max(size, 1e-3)))))
