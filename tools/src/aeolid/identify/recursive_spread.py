"""Say how uncertain Markov parameters are that a filter found recursively, from the samples that came with them.

A filter that forgets and starts at zero gives Ξ̂ = argmin Σ_k λ^{N−k} |y_k − Ξ φ_k|² + λ^{N+1} ρ |Ξ|², so that with
W = Σ λ^{N−k} φ φᵀ + λ^{N+1} ρ I and P = W⁻¹
    Ξ̂ − Ξ = Σ_k λ^{N−k} e_k φ_kᵀ P − λ^{N+1} ρ Ξ P + c sᵀ P,        cov(vec Ξ̂) = Λ ⊗ P (Σ λ^{2(N−k)} φ φᵀ) P,
s = Σ λ^{N−k} φ_k and c the constant that is left when the filter's offsets are not the channels' means. The state-space
matrices are then fitted to all windows ψ of the recording, not only to those the filter still remembers, so the noise
acts twice: through Ξ̂ and through Σ e_k ψ_kᵀ. Both are sums over the same e_k; their joint covariance is that of
Σ e_k [λ^{N−k} φ_k; ψ_k]ᵀ, which is what `RecursiveSpread` hands on in two factors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.record import Record

Array = NDArray[np.float64]
CHUNK = 4096  # windows at once
FORGOTTEN = 1e-9  # weight below which a sample counts no longer
LEAST_SHARE = 0.9  # of the information in Ξ that the recording must hold
NULL = 1e-11  # eigenvalues of the windows below this share of the largest are rounding
BEYOND_CHANCE = 3.0  # standard deviations from which on a constant is believed


@dataclass(frozen=True, eq=False)
class FilterMemory:
    """Hold what the estimate's weights hang on.

    forgetting λ, regularisation ρ, offset and scale (r + l,) of the filter; growth_max: of a variance over 1/ρ, where
    forgetting stops; last: index of the last sample the filter had seen, None where Ξ is of the recording's last one.
    """

    forgetting: float
    regularisation: float
    offset: Array
    scale: Array
    growth_max: float
    last: int | None


@dataclass(frozen=True, eq=False)
class RecursiveSpread:
    """Hold the noise of Ξ̂ and of the fit to all windows, in the scaled units of the windows.

    cov(vec [ΔΞ, ΔΞ_fit]) = residual_covariance ⊗ [spread; direct] [spread; direct]ᵀ, each (p m + r, rank). bias
    (l, p m + r): what the start at zero and the offsets add, as far as the data tell. share: of the information in Ξ̂
    that the recording holds, 0 … 1.
    """

    spread: Array
    direct: Array
    bias: Array
    residual_covariance: Array
    share: float


class Moments:
    """Hold weighted sums over regressors φ (size,) and targets y (l,): w = λ^{N−k}.

    gram Σ w [φ; y] [φ; y]ᵀ, first Σ w [φ; y], square Σ w² φ φᵀ; weight Σ w, weight_square Σ w².
    """

    def __init__(self, size: int, outputs: int) -> None:
        self.size = size
        self.gram: Array = np.zeros((size + outputs, size + outputs))
        self.first: Array = np.zeros(size + outputs)
        self.square: Array = np.zeros((size, size))
        self.weight = self.weight_square = 0.0

    def fade(self, weight: float) -> None:
        """Forget: all weights so far times this one."""
        self.gram *= weight
        self.first *= weight
        self.square *= weight**2
        self.weight *= weight
        self.weight_square *= weight**2

    def add(self, phi: Array, y: Array, w: Array) -> Array:
        """Add samples (N, size), (N, l) with weights (N,); returns w φ (N, size)."""
        both = np.hstack([phi, y])
        weighted = both * w[:, None]
        self.gram += weighted.T @ both
        self.first += weighted.sum(axis=0)
        self.square += weighted[:, : self.size].T @ weighted[:, : self.size]
        self.weight += float(w.sum())
        self.weight_square += float((w**2).sum())
        return weighted[:, : self.size]

    def without(self, other: Moments) -> Moments:
        """Return these sums less those of samples that are among them, weighted alike."""
        rest = Moments(self.size, len(self.first) - self.size)
        rest.gram, rest.first = self.gram - other.gram, self.first - other.first
        rest.square, rest.weight = self.square - other.square, self.weight - other.weight
        rest.weight_square = self.weight_square - other.weight_square
        return rest

    def noise(self, theta: Array, start: float, floor: float, unit: Array) -> tuple[Array, Array, Array]:
        """Return P (size, size), the residuals' covariance Λ (l, l) and the bias (l, size) of Ξ̂ = theta (l, size).

        start: what is left of ρ; floor ≥ start: below which the filter's bounded variances keep no direction; unit
        (size,): of the filter's regressors over that of φ.
        """
        n = self.size
        gram = self.gram[:n, :n]
        P = inverse(gram + floor * np.diag(unit**2))
        left = np.hstack([-theta, np.eye(len(theta))])
        power, constant = left @ self.gram @ left.T, left @ self.first
        freedom = self.weight - 2 * float(np.sum(P * self.square)) + float(np.sum((P @ gram) * (P @ self.square).T))
        covariance = np.asarray(power / max(freedom, 1e-9))
        # a constant in the residuals, from offsets that are not the means; one within chance is none
        reach = P @ self.first[:n]
        room = max(self.weight - float(self.first[:n] @ reach), 1e-9)
        real = (constant / room) ** 2 > BEYOND_CHANCE**2 * np.diag(covariance) / room
        bias = np.outer(np.where(real, constant / room, 0.0), reach) - start * (theta * unit**2) @ P
        return P, covariance, bias


def measure(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor, theta: Array, keep: Sequence[int],
    memory: FilterMemory,
) -> RecursiveSpread:  # fmt: skip
    """Return the noise of Ξ̂ = theta (l, p m + r) in scaled units; keep: its columns that are regressors.

    records: what the filter saw, with the channels of `scaling`; the factor: of all their windows. Cost: 6 N q²
    operations over the N windows that are remembered, and 8 q³, q = p m + r.
    """
    columns, targets, r, outputs = list(keep), theta.shape[1], factor.inputs, factor.outputs
    shift = _shift(scaling, memory)
    wide, narrow = _per_column(shift, factor, columns), shift[r : r + outputs]
    moments, cross = Moments(len(columns), outputs), np.zeros((len(columns), targets))
    for rows, exponent in _remembered(records, scaling, factor, memory):
        y = rows[:, targets : targets + outputs] + narrow
        cross += moments.add(rows[:, columns] + wide, y, memory.forgetting**exponent).T @ (
            rows[:, :targets] - factor.mean[:targets]
        )
    own = np.concatenate([memory.scale, memory.scale[r:][: len(scaling.innovations)]])
    unit = _per_column(own / scaling.scale, factor, columns)
    updates = float(factor.windows if memory.last is None else memory.last + 1)
    P, covariance, bias = moments.noise(theta[:, columns], *remainder(memory, updates), unit)
    within = np.zeros_like(theta)
    within[:, columns] = bias
    of_all = factor.R[:, :targets].T @ factor.R[:, :targets]
    return joint_spread(moments, P, cross, of_all, of_all, columns, covariance, within, known_share(moments, memory))


def joint_spread(
    moments: Moments, P: Array, cross: Array, square: Array, of_all: Array, keep: Sequence[int], covariance: Array,
    bias: Array, share: float,
) -> RecursiveSpread:  # fmt: skip
    """Put together what Ξ̂ and the fit to all windows ψ owe to the same noise.

    cross Σ w ω φ ψᵀ, square Σ ω² ψ ψᵀ, of_all Σ ω ψ ψᵀ, ω the weights of the fit.
    """
    root = _root(np.block([[moments.square, cross], [cross.T, square]]))
    spread = np.zeros((len(of_all), root.shape[1]))
    spread[list(keep)] = P @ root[: moments.size]
    return RecursiveSpread(spread, inverse(of_all, NULL) @ root[moments.size :], bias, covariance, share)


def remainder(memory: FilterMemory, updates: float) -> tuple[float, float]:
    """Return what is left of ρ after so many updates, and below which its bounded variances keep no direction."""
    start = memory.regularisation * memory.forgetting**updates
    return start, start if memory.forgetting == 1 else max(start, memory.regularisation / memory.growth_max)


def known_share(moments: Moments, memory: FilterMemory) -> float:
    """Return the share of Σ w² over all samples that the filter had seen which the moments hold."""
    if memory.last is None:
        return 1.0
    square, count = memory.forgetting**2, memory.last + 1
    return moments.weight_square / (float(count) if square == 1 else (1 - square**count) / (1 - square))


def _remembered(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor, memory: FilterMemory
) -> Iterator[tuple[Array, Array]]:
    """Yield windows (k, (p + 1) m), newest first, and how often each was forgotten (k,).

    Over a bus the index says so; in a recording that was filtered the filter forgot only what came after.
    """
    after = 0
    length = factor.past + 1
    for record in reversed(records):
        z = scaling.apply(record.columns(scaling.names))
        index = sample_indices(record)
        for high in range(len(z), factor.past, -CHUNK):
            low = max(high - CHUNK, factor.past)
            rows = sliding_window_view(z[low - factor.past : high], length, axis=0)
            rows = rows.transpose(0, 2, 1).reshape(high - low, -1)
            good = np.isfinite(rows).all(axis=1)
            if memory.last is None:
                exponent = after + np.arange(int(good.sum()), dtype=np.float64)[::-1]
            else:
                good &= index[low:high] <= memory.last
                exponent = (memory.last - index[low:high][good]).astype(np.float64)
            after += int(good.sum())
            if len(exponent) and memory.forgetting ** float(exponent.min()) < FORGOTTEN:
                return
            yield np.ascontiguousarray(rows[good]), exponent


def sample_indices(record: Record) -> NDArray[np.int64]:
    """Return the controller's sample index of each row (N,): time over sample time."""
    return np.asarray(np.rint(record.time_s / record.sample_time_s), dtype=np.int64)


def _shift(scaling: Scaling, memory: FilterMemory) -> Array:
    """Return what takes scaled channels from the windows' offset to the filter's (m,); e has none."""
    count = len(memory.offset)
    shift: Array = (scaling.offset[:count] - memory.offset) / scaling.scale[:count]
    return np.concatenate([shift, np.zeros(len(scaling.innovations))])


def _per_column(values: Array, factor: WindowFactor, keep: Sequence[int]) -> Array:
    """Return the value of each regressor's channel (len(keep),) from those of the channels (m,)."""
    columns: Array = np.concatenate([np.tile(values, factor.past), values[: factor.inputs]])[list(keep)]
    return columns


def inverse(matrix: Array, null: float = 0.0) -> Array:
    """Return the inverse of a positive semidefinite matrix on the directions that are not rounding."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    least = max(null, float(np.finfo(float).eps)) * max(float(values[-1]), 1e-300)
    inverse = np.where(values > least, 1 / np.maximum(values, least), 0.0)
    out: Array = (vectors * inverse) @ vectors.T
    return out


def _root(matrix: Array) -> Array:
    """Return L with L Lᵀ = matrix, positive semidefinite but for rounding."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    out: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return out
