"""Solve Algorithm 1 of paper 001: the extended data matrix Z, its Markov parameters, and the states.

A row of Z holds, for each lag j = 1 … p, μ_{k-1} ⊗ … ⊗ μ_{k-j} ⊗ z_{k-j} (eq. (12), Definition 5; the most recent
factor varies slowest, so that the columns of the first local model stand first). Columns whose matrix does not depend
on the scheduling leave out their factor. Only a triangular factor of all rows and one chunk are in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import Indices, LpvData, feedthrough_columns, lag_channels, spread
from aeolid.identify.lpv.states import Estimate, StateSequence, largest_kept
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.ridge import Spectrum, filter_factors
from aeolid.identify.windows import triangularise

Array = NDArray[np.float64]
ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class LpvFactor:
    """Hold the triangular factor of all rows [Z, U, Y]: Z (N, q), U those with feedthrough, Y the outputs."""

    R: Array
    regressors: int
    feedthrough: int
    windows: int

    def merge(self, other: LpvFactor) -> LpvFactor:
        """Return the factor of both sets of windows together."""
        stacked = triangularise(np.vstack([self.R, other.R]))
        return replace(self, R=stacked, windows=self.windows + other.windows)


def lag_blocks(data: LpvData, structure: Structure, index: Indices) -> list[Array]:
    """Return the blocks of lag 1 … p for the windows `index`, and the one of the free constant where there is one."""
    varying, rest = lag_channels(data, structure)
    before = np.ones((len(index), 1))  # product of the factors of Ã between the lag and the target
    blocks = []
    for lag in range(1, data.past + 1):
        at = index - lag
        own = np.hstack([spread(data.mu[at], varying[at]), rest[at]])  # (N, w)
        blocks.append(spread(before, own))
        if structure.state_varies:
            before = spread(before, data.mu[at])
    return [*blocks, before] if structure.constant else blocks


def extended_rows(data: LpvData, structure: Structure, index: Indices) -> Array:
    """Return the rows of Z (len(index), q); μ_k ⊗ each where C depends on the scheduling."""
    rows = np.hstack(lag_blocks(data, structure, index))
    return spread(data.mu[index], rows) if structure.output_varies else rows


def factorise_lpv(data: LpvData, structure: Structure) -> LpvFactor:
    """Return the factor of all windows, chunk by chunk: 2 N q² operations, memory q² and a chunk."""
    width = structure.regressors(data.past) + structure.feedthrough_width + structure.outputs
    R = np.zeros((0, width))
    for index in chunks(data, width):
        rows = np.hstack(
            [extended_rows(data, structure, index), feedthrough_columns(data, structure, index), data.y[index]]
        )
        R = triangularise(np.vstack([R, rows]))
    return LpvFactor(R, structure.regressors(data.past), structure.feedthrough_width, data.windows)


def chunks(data: LpvData, width: int) -> Iterator[Indices]:
    """Yield the targets in pieces as long as a row is wide, so that merging costs no more than the factor itself."""
    step = max(2 * width, 1024)
    for start in range(0, data.windows, step):
        yield data.targets[start : start + step]


def solve_primal(data: LpvData, structure: Structure, future: int, regularization: str | float) -> Estimate:
    """Estimate the states by Algorithm 1; raises NotIdentifiable where the windows are fewer than the regressors."""
    factor = factorise_lpv(data, structure)
    q, size = factor.regressors, factor.regressors + factor.feedthrough
    R = factor.R
    P, s, Vt = svd(R[:size, :size])
    rank = int(np.count_nonzero(s > s[0] * max(factor.windows, size) * np.finfo(float).eps))
    projected = P[:, :rank].T @ R[:size, size:]
    outside = np.maximum((R[:, size:] ** 2).sum(axis=0) - (projected**2).sum(axis=0), 0.0)
    penalty, factors = filter_factors(Spectrum(s[:rank], projected, outside, factor.windows), regularization)
    theta = (factors / s[:rank] * projected.T) @ Vt[:rank]  # (l, q + feedthrough)
    stacked = gamma_k(theta[:, :q], structure, data.past, future)
    width = stacked.shape[1]
    left, values, _ = svd(stacked @ _lag_factor(factor, structure, data.past).T)
    kept = largest_kept(values, ROUNDING)
    selector = left[:, :kept].T / np.sqrt(values[:kept])[:, None]
    T = selector @ stacked  # (kept, q of one output factor)
    X = np.concatenate(
        [np.hstack(lag_blocks(data, structure, index)) @ T.T for index in chunks(data, width)]
    )  # (N, kept)
    return Estimate(
        StateSequence(values / np.sqrt(factor.windows), X), rank, size, penalty / s[0], factors.sum(axis=1), {}
    )


def gamma_k(theta: Array, structure: Structure, past: int, future: int) -> Array:
    """Return Γ𝒦 (f l, q) of eq. (14) from C𝒦 (l, q).

    Row i holds C Ã₁ⁱ 𝓛_j in the columns of lag j: the first columns of C 𝓛_{j+i}, those whose i most recent factors
    are the leading one. Lags beyond p − i are zero.
    """
    outputs, width = theta.shape[0], structure.depth_width(past)
    m = structure.parameters if structure.state_varies else 1
    widths = [structure.lag_width * m**j for j in range(past)]
    starts = np.concatenate([[0], np.cumsum(widths)])
    out = np.zeros((future * outputs, width))
    for i in range(future):
        rows = slice(i * outputs, (i + 1) * outputs)
        for j in range(past - i):
            out[rows, starts[j] : starts[j] + widths[j]] = theta[:, starts[j + i] : starts[j + i] + widths[j]]
        if structure.constant:  # its columns: products over p lags; the state's own ends i lags earlier
            first = starts[past]
            out[rows, first : first + m**past : m**i] = theta[:, first : first + m ** (past - i)]
    return out


def require_primal(data: LpvData, structure: Structure, source: str, limit_bytes: float) -> None:
    """Refuse fewer windows than regressors, and a factor beyond the memory limit, before anything is allocated."""
    q = structure.regressors(data.past) + structure.feedthrough_width
    if data.windows <= q:
        raise NotIdentifiable(
            f"{source}: {data.windows} complete windows, the extended data matrix of past window {data.past} with "
            f"{structure.parameters} scheduling entries has q = {q} columns; record more than {q + data.past} samples, "
            "shorten the past window, or use lpv-kernel, which needs no more windows than states times entries"
        )
    size = q + structure.outputs
    needed = 8.0 * size * (3 * size + max(2 * size, 1024))
    if needed > limit_bytes:
        raise NotIdentifiable(
            f"{source}: q = {q} columns need {needed / 1e9:.1f} GB, the limit is {limit_bytes / 1e9:.1f} GB; "
            "shorten the past window, use lpv-kernel, or raise --memory"
        )


def _lag_factor(factor: LpvFactor, structure: Structure, past: int) -> Array:
    """Return the columns of R that hold the lag blocks alone: the first, where C depends on the scheduling."""
    return factor.R[:, : structure.depth_width(past)]
