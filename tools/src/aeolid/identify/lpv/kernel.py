"""Compute the kernels of Theorem 10 of paper 001 without the extended data matrix.

With s(a, b) the product of two samples' channels and h(a, b) = μ_aᵀ μ_b, the kernel of depth d between samples a and b
is Horner's rule backwards in time,

    κ_d(a, b) = s(a − 1, b − 1) + h(a − 1, b − 1) κ_{d−1}(a − 1, b − 1),     κ_0 = 1 with a free constant, else 0,

so that ZᵀZ = κ_p(k, l) over the windows, and the sum of row i of eq. (25) is κ_{p−i}(k − i, l), i = 0 … f − 1: the
stages of one recursion. Where a matrix is constant its factor μᵀμ is left out. Each stage costs two products with an
inner dimension of m and of r + l: O(p N²) for the whole, no array beyond the block of rows at hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.lpv.data import Indices, LpvData, feedthrough_columns, lag_channels
from aeolid.identify.lpv.structure import Structure

Array = NDArray[np.float64]
BLOCK = 128  # rows at a time: the block stays in the cache while its stages are worked


@dataclass(frozen=True, eq=False)
class Kernel:
    """Hold what the kernels are made of: samples (T, ·) of one experiment set and its windows."""

    data: LpvData
    structure: Structure
    varying: Array
    rest: Array
    feedthrough: Array

    @classmethod
    def of(cls, data: LpvData, structure: Structure) -> Kernel:
        """Return the kernel of a set of windows."""
        return cls(data, structure, *lag_channels(data, structure), feedthrough_columns(data, structure, data.targets))

    @property
    def contiguous(self) -> slice | None:
        """Return the windows as a slice of samples where no sample lies between them, None elsewhere."""
        targets = self.data.targets
        whole = len(targets) > 0 and targets[-1] - targets[0] == len(targets) - 1
        return slice(int(targets[0]), int(targets[-1]) + 1) if whole else None

    def stages(self, rows: Indices) -> Iterator[tuple[int, Array]]:
        """Yield (i, κ_{p−i}(k − i, b)) for i = p − 1 … 0: windows k of `rows` (sample indices), all samples b (·, T).

        Values at samples b without p − i samples before them are meaningless. Column c of the array that the stages
        share stands for b = c − i, so that nothing is moved between stages.
        """
        past, count = self.data.past, len(self.data.u)
        width = count + past
        mu, varying, rest = (self._padded(v) for v in (self.data.mu, self.varying, self.rest))
        stage = np.full((len(rows), width), 1.0 if self.structure.constant else 0.0)
        work = np.empty_like(stage)
        for i in range(past - 1, -1, -1):
            at, columns = rows - i - 1, slice(past - i - 1, past - i - 1 + width)
            if varying.shape[0]:
                np.matmul(self.varying[at], varying[:, columns], out=work)
                if self.structure.state_varies:
                    stage += work
                else:
                    stage += work * (self.data.mu[at] @ mu[:, columns])
            if self.structure.state_varies:
                stage *= np.matmul(self.data.mu[at], mu[:, columns], out=work)
            if rest.shape[0]:
                stage += np.matmul(self.rest[at], rest[:, columns], out=work)
            yield i, stage[:, i : i + count]

    def _padded(self, values: Array) -> Array:
        """Return samples (T, c) as (c, p + T + p), zero at both ends."""
        past = self.data.past
        return np.ascontiguousarray(np.pad(values, ((past, past), (0, 0))).T)

    def regressor_rows(self, rows: Indices) -> Array:
        """Return rows (len(rows), N) of the kernel of the regression, [Z U]ᵀ[Z U] of eq. (19); rows: window numbers."""
        data = self.data
        at = data.targets[rows]
        *_, (_, stage) = self.stages(at)  # all stages are views of one array
        columns = self.contiguous
        out = stage[:, columns if columns is not None else data.targets]
        if self.structure.output_varies:
            out = out * (data.mu[at] @ data.mu[data.targets].T)
        if self.feedthrough.shape[1]:
            out = out + self.feedthrough[rows] @ self.feedthrough.T
        return np.ascontiguousarray(out)

    def diagonal(self) -> Array:
        """Return the diagonal (N,) of the kernel of the regression."""
        data = self.data
        at, total = data.targets, np.full(data.windows, 1.0 if self.structure.constant else 0.0)
        for i in range(data.past, 0, -1):
            h = (data.mu[at - i] ** 2).sum(axis=1)
            own = (self.varying[at - i] ** 2).sum(axis=1)
            total = (own + total) * h if self.structure.state_varies else total + own * h
            total = total + (self.rest[at - i] ** 2).sum(axis=1)
        if self.structure.output_varies:
            total = total * (data.mu[at] ** 2).sum(axis=1)
        return np.asarray(total + (self.feedthrough**2).sum(axis=1))

    def full(self) -> Array:
        """Return the kernel of the regression, (N, N)."""
        out = np.empty((self.data.windows, self.data.windows))
        for rows in self._blocks():
            out[rows] = self.regressor_rows(rows)
        return out

    def states_rows(self, alpha: Array, future: int, rows: Indices | None = None) -> Array:
        """Return Γ𝒦Z (f l, N) of eq. (25) from α (l, len(rows)); rows: windows α belongs to, default all."""
        outputs = alpha.shape[0]
        out = np.zeros((future * outputs, len(self.data.u)))
        chosen = np.arange(self.data.windows) if rows is None else rows
        for start in range(0, len(chosen), BLOCK):
            part = slice(start, start + BLOCK)
            for i, stage in self.stages(self.data.targets[chosen[part]]):
                if i < future:
                    out[i * outputs : (i + 1) * outputs] += alpha[:, part] @ stage
        return np.ascontiguousarray(out[:, self.data.targets])

    def _blocks(self) -> Iterator[Indices]:
        for start in range(0, self.data.windows, BLOCK):
            yield np.arange(start, min(start + BLOCK, self.data.windows))
