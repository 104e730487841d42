"""Test the innovations of a node as they come: are they white, and as large as they were?

A priori innovations e_k = y_k − Ξ z_k are formed on the host, z_k of regressor.h in deviations from the offsets, Ξ that
of the newest snapshot, which ended before sample k. So no sample has been fitted by the Ξ it is held against. Blocks of
`BLOCK` innovations do not overlap; each gives, for every output,

  whiteness  Q = (1 + 2/n) Σ_τ n_τ ρ_τ²,  ρ_τ = (n/n_τ) Σ_k ẽ_k ẽ_{k−τ} / Σ_k ẽ_k²,  τ = 1 … LAGS,  ẽ = e − ē,

the statistic of Ljung and Box (1978) where nothing is missing (n_τ = n − τ: the pairs of which both are there), about
χ² with LAGS degrees of freedom where e is white (outside 99 % in 1.7 % of the blocks at this length); and

  variance   F = s²/s₀²,  s² of the block, s₀² of the up to `BEFORE` blocks before it,

of Fisher's distribution with n − 1 and n₀ − n₀/n degrees of freedom where e is white, Gaussian and as large as before.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, fdtri

from aeolid.can.description import Description

Array = NDArray[np.float64]
BLOCK = 256  # innovations of a block
LAGS = 20
BEFORE = 16  # blocks that say what is usual
LEVEL = 0.01  # chance of either test to alarm on a block of an exact model
SEEN = 20  # samples an entry of z that a snapshot has to have seen; the error of Ξ is part of e, n/N of its power
SPAN = 8  # blocks' lengths within which a block has to be full


@dataclass(frozen=True, eq=False)
class Block:
    """Hold the tests of one block: last sample, and for each output (l,) Q, F and the standard deviation of e.

    ratio is NaN in the first block; low, high: bounds of F; bound: of Q.
    """

    index: int
    whiteness: Array
    ratio: Array
    deviation: Array
    bound: float
    low: float
    high: float

    def outside(self) -> NDArray[np.bool_]:
        """Tell (2, l) which outputs are outside the bounds: of whiteness, of variance."""
        return np.stack([self.whiteness > self.bound, (self.ratio < self.low) | (self.ratio > self.high)])


class InnovationTest:
    """Form the innovations of one run of a node and test them block by block."""

    def __init__(self, description: Description) -> None:
        """Prepare; the description says what z is made of."""
        d = self._d = description
        self.waiting = "waiting for a snapshot"
        self._theta: Array | None = None
        self._width = d.inputs + d.outputs * (2 if d.model_set == "varmax" else 1)
        self._past = np.full((d.past, self._width), np.nan)  # the blocks before the next sample, oldest first
        self._last: int | None = None
        self._e: list[Array] = []  # of the block under way, NaN where a window was not whole
        self._good = 0
        self._before: deque[Array] = deque(maxlen=BEFORE)  # variances of blocks

    @property
    def caution(self) -> str:
        """Say why alarms prove little here; empty where they do."""
        d = self._d
        memory = np.inf if d.forgetting >= 1 else 1 / (1 - d.forgetting)
        if memory >= SEEN * d.regressors:
            return ""
        return (
            f"the filter remembers {memory:.0f} samples for {d.regressors} parameters of an output, so the error of Ξ"
            f" colours e: compare over time, not with the bounds"
        )

    def snapshot(self, theta: Array, sample_index: int | None) -> None:
        """Take Ξ (l, n) in the channels' units; sample_index: the last sample in it."""
        needed = SEEN * self._d.regressors
        if sample_index is None or sample_index < needed:
            at = "unknown" if sample_index is None else str(sample_index + 1)
            self.waiting = f"waiting for a snapshot that has seen {needed} samples; the newest has seen {at}"
        else:
            self._theta = theta

    def add(self, index: NDArray[np.int64], u: Array, y: Array, e: Array | None) -> list[Block]:
        """Take samples u (N, r), y (N, l) and innovations the node sent, e (N, l) or None; returns blocks now full."""
        d = self._d
        if self._last is not None and index[0] > self._last + 1:  # a hole: as many empty blocks, a window at most
            self._past = np.vstack(
                [self._past, np.full((min(int(index[0]) - self._last - 1, d.past), self._width), np.nan)]
            )
            self._past = self._past[-d.past :]
        self._last = int(index[-1])
        centre = d.offset[: d.inputs + d.outputs]
        rows = np.hstack([u, y]) - centre
        found = self._recurse(rows, e) if d.model_set == "varmax" else self._predict(rows)
        if self._theta is None:
            return []
        return self._collect(index, found)

    def _predict(self, rows: Array) -> Array:
        """Return the innovations (N, l) of a VARX predictor: all windows at once."""
        d, N = self._d, len(rows)
        together = np.vstack([self._past, rows])  # (p + N, m)
        self._past = together[-d.past :]
        if self._theta is None:
            return np.full((N, d.outputs), np.nan)
        windows = np.lib.stride_tricks.sliding_window_view(together[:-1], d.past, axis=0)  # (N, m, p)
        z = np.hstack([windows.transpose(0, 2, 1).reshape(N, -1), rows[:, list(d.feedthrough)]])
        found: Array = rows[:, d.inputs :] - z @ self._theta.T
        return found

    def _recurse(self, rows: Array, sent: Array | None) -> Array:
        """Return the innovations (N, l) of a VARMAX predictor; its window has those the node sent, else these."""
        d = self._d
        found = np.full((len(rows), d.outputs), np.nan)
        for k, row in enumerate(rows):
            whole = np.isfinite(self._past[:, : d.inputs + d.outputs]).all()
            if self._theta is not None and whole:
                window = np.nan_to_num(self._past, nan=0.0)  # e before the first one: at rest
                with np.errstate(over="ignore", invalid="ignore"):
                    found[k] = row[d.inputs :] - self._theta @ np.append(window.ravel(), row[list(d.feedthrough)])
                if not np.isfinite(found[k]).all() or not (abs(found[k]) < 1e30).all():
                    found[k] = np.nan
            now = found[k] if sent is None or not np.isfinite(sent[k]).all() else sent[k]
            self._past = np.vstack([self._past[1:], np.append(row, now)])
        return found

    def _collect(self, index: NDArray[np.int64], found: Array) -> list[Block]:
        blocks = []
        for k, row in zip(index.tolist(), found, strict=True):
            if not self._e and not np.isfinite(row).all():
                continue
            self._e.append(row)
            self._good += bool(np.isfinite(row).all())
            if self._good == BLOCK:
                blocks.append(self._judge(k))
            if self._good == BLOCK or len(self._e) > SPAN * BLOCK:
                self._e, self._good = [], 0
        self.waiting = "" if self._before else f"{self._good} of {BLOCK} innovations of the first block are there"
        return blocks

    def _judge(self, index: int) -> Block:
        e = np.array(self._e)
        variance = np.nanvar(e, axis=0, ddof=1)
        ratio, low, high = np.full(len(variance), np.nan), 0.0, np.inf
        if self._before:
            usual = np.mean(self._before, axis=0)
            ratio = np.divide(variance, usual, out=ratio, where=usual > 0)
            degrees = BLOCK - 1, (BLOCK - 1) * len(self._before)
            low, high = (float(x) for x in fdtri(*degrees, [LEVEL / 2, 1 - LEVEL / 2]))
        self._before.append(variance)
        bound = float(chdtri(LAGS, LEVEL))
        return Block(index, whiteness(e), ratio, np.sqrt(variance), bound, low, high)


def whiteness(e: Array, lags: int = LAGS) -> Array:
    """Return Q (l,) of innovations e (N, l), rows with NaN left out; NaN for an output that does not move."""
    there: NDArray[np.bool_] = np.asarray(np.isfinite(e).all(axis=1), dtype=np.bool_)
    n = int(there.sum())
    x = np.where(there[:, None], e - e[there].mean(axis=0), 0.0)
    power = (x**2).sum(axis=0)
    total = np.zeros(e.shape[1])
    for lag in range(1, lags + 1):
        pairs = int(np.count_nonzero(there[lag:] & there[:-lag]))
        if pairs:
            rho = np.divide((x[lag:] * x[:-lag]).sum(axis=0), power, out=np.full(len(power), np.nan), where=power > 0)
            total += pairs * (n / pairs * rho) ** 2
    result: Array = (1 + 2 / n) * total
    return result
