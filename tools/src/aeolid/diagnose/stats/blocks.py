"""Judge what a direction says block by block: its spread and, by weights drawn anew, its null (S4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_DRAWS = 2000  # of the blocks of a sum
_NONE = 1e-9  # variance below which a direction has none
_ALL = 1e-9  # share of a direction's length outside one block, below which the rest is rounding


@dataclass(frozen=True, eq=False)
class Blocks:
    """Hold where blocks of rows start, a sign and a normal weight for each of them: starts (B,), others (draws, B)."""

    starts: NDArray[np.int64]
    signs: Array
    weights: Array


def blocks_of(samples: int, outputs: int, known: int, seed: int, draws: int) -> Blocks:
    """Cut residuals into blocks of N^(1/3) samples, all outputs of one together, each of the prior's rows alone."""
    length = max(1, round(samples ** (1 / 3)))
    starts = np.concatenate([np.arange(0, samples, length) * outputs, samples * outputs + np.arange(known)])
    rng = np.random.default_rng(seed)
    shape = (draws, len(starts))
    return Blocks(starts, rng.choice(np.array([-1.0, 1.0]), size=shape), rng.standard_normal(shape))


def shares_of(basis: Array, residual: Array, blocks: Blocks) -> Array:
    """Return what each block adds to the projection Hᵀ r by noise alone: (B, df), Σ sᵦ sᵦᵀ its covariance.

    sᵦ = (I − Hᵦᵀ Hᵦ)^(−1/2) Hᵦᵀ w, w what H leaves over, so that the effect itself does not widen its own null. The
    root gives back what the fit of few blocks takes away: on white noise the covariance is I on average, however
    few blocks a direction lives in (MacKinnon & White 1985, HC2); a block that holds all of it leaves nothing over,
    and white noise's share is taken. Cost O(N df²).
    """
    freedom = basis.shape[1]
    left = residual - basis @ (basis.T @ residual)
    said = np.add.reduceat(basis * left[:, None], blocks.starts, axis=0)
    outer = np.einsum("ni,nj->nij", basis, basis).reshape(len(basis), -1)
    held = np.add.reduceat(outer, blocks.starts, axis=0).reshape(-1, freedom, freedom)
    values, vectors = np.linalg.eigh(np.eye(freedom) - held)
    turned = np.einsum("bij,bi->bj", vectors, said)
    turned = np.where(values > _ALL, turned / np.sqrt(np.maximum(values, _ALL)), 1.0)
    result: Array = np.einsum("bij,bj->bi", vectors, turned)
    return result


def standardiser(spread: Array, least: float = 1.0) -> Array:
    """Return W with |Wᵀ p|² = pᵀ C⁻¹ p, no direction's variance counting for less than `least`: that of white noise, 1.

    Of few blocks the spread may come out too small by chance; it never makes a score larger than the model's own noise.
    """
    values, vectors = np.linalg.eigh(spread)
    result: Array = vectors / np.sqrt(np.maximum(values, least))
    return result


def redrawn(shares: Array, blocks: Blocks) -> Array:
    """Return what normal weights make of the standardised projection: (draws, df), of covariance I.

    Signs of ±1 have no tails where a direction lives in few blocks (a level of 1 % was 2 to 3 %). And never less: where
    a spread came out below white noise's by chance, the statistic keeps 1 and so does its null.
    """
    result: Array = blocks.weights @ (shares @ standardiser(shares.T @ shares, _NONE))
    return result


def block_interval(values: Array, seed: int, level: float = 0.9) -> tuple[float, float]:
    """Return the block-bootstrap interval of a sum; blocks of N^(1/2) samples keep slow correlation."""
    length = max(1, int(np.sqrt(len(values))))
    blocks = np.add.reduceat(values, np.arange(0, len(values), length))
    rng = np.random.default_rng(seed)
    sums = rng.choice(blocks, size=(_DRAWS, len(blocks))).sum(axis=1)
    low, high = np.quantile(sums, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
