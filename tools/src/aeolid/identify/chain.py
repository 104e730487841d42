"""Model inputs and outputs together as one autoregression, and say what it expects of single cells.

With z = [u; y] scaled about its mean, e_k = Σ a_s z_{k−s}, a_0 = I, s = 0 … q, is white with precision W. The loop
may be open or closed: the autoregression holds plant, controller and the spectra of both. The cells of a recording are
then jointly normal with the block-banded precision Q, block Q_d = Σ a_{s+d}ᵀ W a_s between z_k and z_{k+d}. Cells M
that are missing have, given all others before and after, the precision Q_MM and the mean −Q_MM⁻¹ (Q z)_M with z_M = 0:
a smoother over the gaps that costs one banded factorisation. Beyond the ends channels stand at their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded, solve_banded

from aeolid.decompositions import lstsq
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
FLOOR = 1e-10  # of a channel's variance: innovations below are rounding
RANK = 1e-10


@dataclass(frozen=True, eq=False)
class Chain:
    """Hold the autoregression: a (q + 1, m, m), a_0 = I, and the precision W (m, m) of its innovations."""

    a: Array
    W: Array

    @property
    def blocks(self) -> Array:
        """Return Q_d (q + 1, m, m), d = 0 … q: rows belong to z_k, columns to z_{k+d}."""
        q = len(self.a) - 1
        return np.array([np.einsum("sji,jk,skl->il", self.a[d:], self.W, self.a[: q + 1 - d]) for d in range(q + 1)])

    def innovations(self, z: Array) -> Array:
        """Return e_k (N + q, m) of z (N, m) with zeros before and after."""
        q = len(self.a) - 1
        out = np.zeros((len(z) + q, z.shape[1]))
        for s, a in enumerate(self.a):
            out[s : s + len(z)] += z @ a.T
        return out

    def pull(self, z: Array) -> Array:
        """Return Q z (N, m): the gradient of half the squared innovations to each cell."""
        weighted = self.innovations(z) @ self.W
        out = np.zeros_like(z)
        for s, a in enumerate(self.a):
            out += weighted[s : s + len(z)] @ a
        return out


def largest_order(lengths: Sequence[int], channels: int, most: int, rows: int) -> int:
    """Return the largest order up to `most` of an autoregression that recordings of these lengths tell, 0 where none.

    rows: samples a regressor, at least. Half of all samples lie in recordings of at least three times the order: there
    are cells with as many before and after them, and most samples are the end of a window.
    """
    longest_first = np.sort(np.asarray(lengths, np.int64))[::-1]
    held = np.cumsum(longest_first)
    typical = longest_first[np.searchsorted(held, held[-1] / 2)]
    return int(min(most, held[-1] // (rows * max(channels, 1)), typical // 3))


def fit_chain(factor: WindowFactor) -> Chain:
    """Return the autoregression of order p that the windows of p + 1 samples tell, the smallest where many do."""
    m, q = factor.inputs + factor.outputs, factor.past
    past, now = factor.R[:, : q * m], factor.R[:, q * m :]
    theta = lstsq(past, now, rcond=RANK).T  # (m, q m), oldest first
    error = now - past @ theta.T
    covariance = error.T @ error / max(factor.windows - 1, 1) + FLOOR * np.eye(m)
    lags = theta.reshape(m, q, m).transpose(1, 0, 2)[::-1]
    W = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return Chain(np.concatenate([np.eye(m)[None], -lags]), W)


def fill(chain: Chain, z: Array, missing: Flags, noise: Sequence[Array]) -> list[Array]:
    """Return one copy of z (N, m) an element of `noise`, its missing cells drawn given all the others.

    missing (N, m): cells to fill; noise: (number of missing cells,) standard normal each, zeros for the mean. Cost:
    cells × band², the band being the cells missing within q samples, q m at most.
    """
    known = np.where(missing, 0.0, z)
    time, channel = np.nonzero(missing)
    if len(time) == 0:
        return [known for _ in noise]
    root = cholesky_banded(_band(chain, time, channel), lower=True)
    mean = cho_solve_banded((root, True), -chain.pull(known)[time, channel])
    upper = _transposed(root)
    out = []
    for draw in noise:
        copy = known.copy()
        copy[time, channel] = mean + solve_banded((0, len(root) - 1), upper, draw)
        out.append(copy)
    return out


def predict_cells(chain: Chain, z: Array, missing: Flags, start: int, inputs: int) -> Array:
    """Return z (N, m) with the missing cells from sample `start` on at what the samples before say of them.

    missing (N, m): cells to fill, zero in z; those before `start` stay. Of the same sample inputs know the other
    inputs, outputs everything: no input is told by an output that it acts on. Cost: q m² a sample with missing cells.
    """
    out, q = z.copy(), len(chain.a) - 1
    lags = chain.a[1:][::-1]  # (q, m, m), oldest first
    covariance = np.linalg.inv(chain.W)
    for k in start + np.flatnonzero(missing[start:].any(axis=1)):
        past = out[max(k - q, 0) : k]
        mean = -np.einsum("sij,sj->i", lags[q - len(past) :], past)
        for first, stop in ((0, inputs), (inputs, len(mean))):
            sought = first + np.flatnonzero(missing[k, first:stop])
            known = np.setdiff1d(np.arange(stop), sought)
            if len(sought):
                gain = lstsq(covariance[np.ix_(known, known)], covariance[np.ix_(known, sought)], rcond=RANK).T
                out[k, sought] = mean[sought] + gain @ (out[k, known] - mean[known])
    return out


def _band(chain: Chain, time: NDArray[np.intp], channel: NDArray[np.intp]) -> Array:
    """Return Q_MM in lower banded form (band + 1, cells)."""
    blocks, q = chain.blocks, len(chain.a) - 1
    last = np.searchsorted(time, time + q, side="right") - 1
    width = int((last - np.arange(len(time))).max())
    out = np.zeros((width + 1, len(time)))
    for offset in range(width + 1):
        apart = time[offset:] - time[: len(time) - offset]
        value = blocks[np.minimum(apart, q), channel[: len(time) - offset], channel[offset:]]
        out[offset, : len(time) - offset] = np.where(apart <= q, value, 0.0)
    return out


def _transposed(root: Array) -> Array:
    """Return Lᵀ in the upper banded form of L (band + 1, cells) in the lower one."""
    width, count = root.shape
    out = np.zeros_like(root)
    for offset in range(min(width, count)):
        out[width - 1 - offset, offset:] = root[offset, : count - offset]
    return out
