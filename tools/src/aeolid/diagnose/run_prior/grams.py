"""Gram matrices of all windows of a recording, from lagged products alone.

A regressor row is [z_{k−1} … z_{k−p}, u_k, 1, x_k], z = [u; y]: the window of paper 000 eq. (9), newest first, the
inputs of the same sample, a constant, and what a hypothesis adds; y_k is its target. Since successive windows overlap,
S_ij = Σ_k z_{k−i} z_{k−j}ᵀ obeys S_{i+1,j+1} = S_ij + z_{p−1−i} z_{p−1−j}ᵀ − z_{n−1−i} z_{n−1−j}ᵀ: only the products
S_0j are formed from the samples, and no window is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gram:
    """Hold the moments of one or several recordings' windows.

    Z (q, q): of the regressors, q = p m + r + 1 + e; ZY (q, l): with the targets; YY (l, l); count: windows; extra: e.
    """

    Z: Array
    ZY: Array
    YY: Array
    count: int
    extra: int = 0

    def __add__(self, other: Gram) -> Gram:
        """Return the moments of both sets of windows."""
        return Gram(self.Z + other.Z, self.ZY + other.ZY, self.YY + other.YY, self.count + other.count, self.extra)


@dataclass(frozen=True, eq=False)
class Moments:
    """Hold the moments of windows by region of operation: each region has a predictor of its own."""

    regions: tuple[Gram, ...]

    @property
    def count(self) -> int:
        """Return how many windows there are in all."""
        return sum(g.count for g in self.regions)

    def __add__(self, other: Moments) -> Moments:
        """Return the moments of both sets of windows, region by region."""
        return Moments(tuple(a + b for a, b in zip(self.regions, other.regions, strict=True)))


def lagged_gram(z: Array, past: int, inputs: int, extra: Array | None = None) -> Gram:
    """Return the moments of all windows of z (n, m), whose first `inputs` columns are inputs; extra (n, e).

    z must be finite and longer than `past`. Cost: 2 n p m² operations, memory (p m)².
    """
    n, m = z.shape
    stacked = np.empty((past + 1, m, past + 1, m))
    now = np.ascontiguousarray(z[past:].T)
    first = np.stack([now @ z[past - j : n - j] for j in range(past + 1)])  # S_0j
    for d in range(past + 1):
        block = np.empty((past + 1 - d, m, m))
        block[0] = first[d]
        i = np.arange(past - d)
        enter = z[past - 1 - i][:, :, None] * z[past - 1 - i - d][:, None, :]
        leave = z[n - 1 - i][:, :, None] * z[n - 1 - i - d][:, None, :]
        block[1:] = block[0] + np.cumsum(enter - leave, axis=0)
        rows = np.arange(past + 1 - d)
        stacked[rows, :, rows + d, :] = block
        stacked[rows + d, :, rows, :] = block.transpose(0, 2, 1)
    full = stacked.reshape((past + 1) * m, (past + 1) * m)
    order = np.r_[m : (past + 1) * m, 0:inputs]  # lags 1 … p, then the inputs of the sample
    targets = np.arange(inputs, m)
    added = np.ones((n, 1)) if extra is None else np.hstack([np.ones((n, 1)), extra])
    with_lags = np.vstack([z[past - i : n - i].T @ added[past:] for i in range(past + 1)])
    e = added.shape[1]
    q = len(order) + e
    Z = np.empty((q, q))
    Z[:-e, :-e] = full[np.ix_(order, order)]
    Z[:-e, -e:] = with_lags[order]
    Z[-e:, :-e] = Z[:-e, -e:].T
    Z[-e:, -e:] = added[past:].T @ added[past:]
    ZY = np.vstack([full[np.ix_(order, targets)], with_lags[targets].T])
    return Gram(Z, ZY, full[np.ix_(targets, targets)], n - past, e - 1)


def with_noise(gram: Gram, deviation: float) -> Gram:
    """Return the moments that the same windows have on average when every channel has white noise of that deviation."""
    k = len(gram.Z) - 1 - gram.extra
    power, Z = gram.count * deviation**2, gram.Z.copy()
    Z[np.arange(k), np.arange(k)] += power
    return Gram(Z, gram.ZY, gram.YY + power * np.eye(len(gram.YY)), gram.count, gram.extra)


def with_noisy_outputs(gram: Gram, deviations: Array, held: int) -> Gram:
    """Return the moments on average when outputs have white noise of these deviations (l,); held: other columns."""
    k, channels = len(gram.Z) - 1 - gram.extra, held + len(deviations)
    past = (k - held) // channels
    places = np.arange(past * channels).reshape(past, channels)[:, held:]
    power, Z = gram.count * deviations**2, gram.Z.copy()
    Z[places, places] += power
    return Gram(Z, gram.ZY, gram.YY + np.diag(power), gram.count, gram.extra)


_M = TypeVar("_M", Gram, Moments)


def total(moments: Sequence[_M]) -> _M:
    """Return the moments of all windows together."""
    result = moments[0]
    for more in moments[1:]:
        result = result + more
    return result
