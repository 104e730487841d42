"""Follow a plant sample by sample: recursive state space from streamed Markov parameters, without an SVD a sample.

Steps 2 and 3 of the recursive method behind paper 000. With Ξ from any filter, ΓK(Ξ) of its eq. (22) and a fixed S
(n, f l), the propagator, x_k = S ΓK z̄_k is a state whose coordinates stay what they are. Two small recursive
least-squares problems then follow
    y_k = C x_k + D u_k + e_k,        x_{k+1} = A x_k + B u_k + K e_k,
and the poles are those of A. S is chosen once, with the first snapshot.

Beyond the published method: a new Ξ moves all states, those in the memory of step 3 too. Left as they are, they bias
the poles and double their scatter and lag; so with each snapshot the states of the last samples are computed anew and
both problems started from them. The result is then that of a refit with an SVD (tests/studies/propagator.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from math import ceil

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.propagator_states import choose_states
from aeolid.identify.small_rls import SmallRls
from aeolid.identify.subspace import gamma_k
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
LONGEST_MEMORY = 5000  # samples kept; λ nearer to 1 forgets what lies further back with each snapshot
BATCH = 64  # samples that step 3 takes at once


class Propagator:
    """Track A, B, C, D, K from samples and Markov parameters, in fixed coordinates.

    Feed `update_markov` whenever a snapshot arrives (every sample or every minute) and `update` with every sample;
    between snapshots the states keep coming from the last one.
    """

    def __init__(
        self,
        *,
        inputs: int,
        outputs: int,
        past: int,
        order: int,
        future: int | None = None,
        forgetting: float = 0.99,
        memory: int | None = None,
        feedthrough: Sequence[int] = (),
        selection: str = "combined",
        model_set: str = "varx",
        offset: ArrayLike | None = None,
        scale: ArrayLike | None = None,
    ) -> None:
        """Prepare a tracker of n = order states for r inputs and l outputs.

        past, feedthrough (indices of inputs whose present value is a regressor), model_set: those of the filter.
        future: f ≤ p block rows of ΓK, default p. forgetting: λ of step 3, 0.5 … 1, default 0.99; that of the filter is
        a good choice. memory: samples whose states a snapshot computes anew, default 3/(1 − λ), at most 5000; 0 keeps
        old states, as published. selection: "combined" takes S from the left singular vectors of ΓK Z, "rows" the n
        rows of ΓK that are most independent, as published. offset, scale (r + l,), inputs first: what brings the
        channels to size one (the filter's own, or mean and standard deviation), default 0 and 1. Raises UsageError for
        a setting out of range.
        """
        if model_set not in ("varx", "varmax"):
            raise UsageError(f"model set {model_set!r} is none of varx, varmax")
        chosen = past if future is None else future
        if not 1 <= chosen <= past:
            raise UsageError(f"future window {chosen} is not within 1 … past window {past}")
        if not 1 <= order <= chosen * outputs:
            raise UsageError(f"order {order} is not within 1 … {chosen * outputs} (future window times outputs)")
        if not 0.5 <= forgetting <= 1:
            raise UsageError(f"forgetting {forgetting} is not within 0.5 … 1")
        if selection not in ("combined", "rows"):
            raise UsageError(f"selection {selection!r} is none of combined, rows")
        if memory is not None and not 0 <= memory <= LONGEST_MEMORY:
            raise UsageError(f"memory {memory} is not within 0 … {LONGEST_MEMORY} samples")
        if any(not 0 <= i < inputs for i in feedthrough):
            raise UsageError(f"feedthrough {tuple(feedthrough)} names an input that is not within 0 … {inputs - 1}")
        self.inputs, self.outputs, self.past, self.future, self.order = inputs, outputs, past, chosen, order
        self.feedthrough = tuple(sorted(set(feedthrough)))
        self.block = inputs + outputs * (2 if model_set == "varmax" else 1)
        self.combined = selection == "combined"
        self.memory = min(ceil(3 / max(1 - forgetting, 1e-9)), LONGEST_MEMORY) if memory is None else memory
        self.selection: Array | None = None  # S, (n, f l)
        channels = inputs + outputs
        self._offset = np.zeros(channels) if offset is None else _table(offset, channels, "offset")
        self._scale = np.ones(channels) if scale is None else _table(scale, channels, "scale")
        if np.any(self._scale <= 0):
            raise UsageError("scale must be above 0")
        self._theta: Array | None = None
        self._map: Array | None = None  # S ΓK, (n, p m)
        # blocks kept: for the states of `memory`, for the choice of S, and for all windows of a batch
        self._span = max(self.memory, 2 * past * self.block, BATCH) + past
        self._blocks_kept: Array = np.zeros((2 * self._span, self.block))
        self._kept = self._filled = 0
        self.updates = 0
        present = len(self.feedthrough)
        self._outer = SmallRls(outputs, order + present, forgetting)
        self._inner = SmallRls(order, order + inputs + outputs, forgetting)

    def update_markov(self, theta: ArrayLike) -> None:
        """Take a snapshot Ξ (l, p m + d) in the channels' units, order of paper 000 eq. (9) or (14).

        The first one chooses S. Raises DataError where the shape is another or a value is not finite,
        NotIdentifiable where ΓK has fewer than n independent rows.
        """
        values = np.asarray(theta, dtype=np.float64)
        expected = (self.outputs, self.past * self.block + len(self.feedthrough))
        if values.shape != expected:
            raise DataError(f"Markov parameters have shape {values.shape}, {expected} is needed")
        if not np.isfinite(values).all():
            raise DataError("Markov parameters hold a value that is not finite; the snapshot is incomplete")
        self._theta = self.scaled(values)
        stacked = gamma_k(self._theta[:, : self.past * self.block], self.past, self.future, self.block)
        if self.selection is None:
            self.selection = choose_states(stacked, self._windows(self.past)[0], self.order, self.combined)
        self._map = self.selection @ stacked
        if self.memory:
            self._compute_again()

    def scaled(self, theta: Array) -> Array:
        """Return Ξ (l, p m + d) in scaled units."""
        r = self.inputs
        sizes = np.concatenate([np.tile(self._block_scale, self.past), self._scale[:r][list(self.feedthrough)]])
        out: Array = theta * sizes / self._scale[r:, None]
        return out

    def _windows(self, length: int, newest: int | None = None) -> tuple[Array, Array]:
        """Return the windows of `length` good samples kept, (N, length · m), oldest first, and their last blocks.

        newest: only those that end in the newest so many samples.
        """
        span = self._span if newest is None else min(newest + length - 1, self._span)
        kept = self._blocks_kept[max(self._kept - span, 0) : self._kept]
        if len(kept) < length:
            return np.zeros((0, length * self.block)), np.zeros((0, self.block))
        rows = sliding_window_view(kept, length, axis=0).transpose(0, 2, 1).reshape(-1, length * self.block)
        good = np.isfinite(rows).all(axis=1)
        return rows[good], kept[length - 1 :][good]

    def _compute_again(self) -> None:
        """Start step 3 again from the states that the present Ξ gives the samples in memory."""
        assert self._map is not None
        rows, last = self._windows(self.past + 1)
        rows, last = rows[-self.memory :], last[-self.memory :]
        channels = self.inputs + self.outputs
        if len(rows) < self.order + channels:
            return
        now, following = rows[:, : -self.block] @ self._map.T, rows[:, self.block :] @ self._map.T
        u, y = last[:, : self.inputs], last[:, self.inputs : channels]
        regressors = np.hstack([now, u[:, list(self.feedthrough)]])
        self._outer.restart(regressors, y)
        e = y - regressors @ self._outer.theta.T
        self._inner.restart(np.hstack([now, u, e]), following)
        self.updates = max(self.updates, len(rows))

    @property
    def _block_scale(self) -> Array:
        """Return the scales of a block (m,)."""
        innovations = self.block - self.inputs - self.outputs
        return np.concatenate([self._scale, self._scale[self.inputs :][:innovations]])

    def update(self, u: ArrayLike, y: ArrayLike, e: ArrayLike | None = None) -> bool:
        """Take one sample u (r,), y (l,) in the channels' units; returns whether the estimate moved.

        e (l,): the filter's residual, for VARMAX; where it is left out it is y − Ξ z. A missing value (NaN) empties the
        window: p good samples later estimation goes on. So it must be called with NaN for samples that were lost.
        Raises UsageError where a length is wrong. Cost: 2 n p m + 3 (n + r + l)² operations.
        """
        sample = np.concatenate([_table(u, self.inputs, "u"), _table(y, self.outputs, "y")])
        z = (sample - self._offset) / self._scale
        if not np.isfinite(z).all():
            self._keep(np.full(self.block, np.nan))
            self._filled = 0
            return False
        window, filled = self._blocks_kept[self._kept - self.past : self._kept].ravel(), self._filled
        block = np.concatenate([z, self._innovation(z, e, window)])
        self._keep(block)
        if filled < self.past or self._map is None:
            return False
        now = self._map @ window
        following = self._map @ np.concatenate([window[self.block :], block])
        residual = self._outer.update(np.concatenate([now, z[list(self.feedthrough)]]), z[self.inputs :])
        self._inner.update(np.concatenate([now, z[: self.inputs], residual]), following)
        self.updates += 1
        return True

    def update_many(self, u: ArrayLike, y: ArrayLike, e: ArrayLike | None = None) -> Array:
        """Take samples u (N, r), y (N, l), oldest first; returns the windows (k, (p + 1) m) that are complete, scaled.

        As `update` one by one, but e of step 3 is taken with the last C of each batch. Cost a sample of a long batch:
        2 n p m + 2 (n + r + l)² operations without the interpreter's; VARMAX goes one by one. Raises UsageError where a
        shape is wrong.
        """
        us, ys = _rows(u, self.inputs, "u"), _rows(y, self.outputs, "y")
        es = None if e is None else _rows(e, self.outputs, "e")
        if len({len(v) for v in (us, ys, es) if v is not None}) > 1:
            raise UsageError(f"u, y and e hold {len(us)}, {len(ys)} and {len(us) if es is None else len(es)} samples")
        if self.block != self.inputs + self.outputs:
            windows = [self._follow(us[k], ys[k], None if es is None else es[k]) for k in range(len(us))]
            done = [w[None, :] for w in windows if len(w)]
        else:
            done = [self._take(us[i : i + BATCH], ys[i : i + BATCH]) for i in range(0, len(us), BATCH)]
        return np.concatenate([np.zeros((0, (self.past + 1) * self.block)), *done])

    def _follow(self, u: Array, y: Array, e: Array | None) -> Array:
        """Take one sample; returns the window that it completes, nothing where one of its samples is missing."""
        self.update(u, y, e)
        window = self._blocks_kept[max(self._kept - self.past - 1, 0) : self._kept].ravel()
        whole = len(window) == (self.past + 1) * self.block and bool(np.isfinite(window).all())
        return window if whole else window[:0]

    def _take(self, u: Array, y: Array) -> Array:
        z = (np.hstack([u, y]) - self._offset) / self._scale
        z[~np.isfinite(z).all(axis=1)] = np.nan
        for block in z:
            self._keep(block)
        bad = np.flatnonzero(np.isnan(z[:, 0]))
        self._filled = min(self._filled, len(z) - 1 - int(bad[-1])) if len(bad) else self._filled
        rows, last = self._windows(self.past + 1, newest=len(z))
        if self._map is None or not len(rows):
            return rows
        now, following = rows[:, : -self.block] @ self._map.T, rows[:, self.block :] @ self._map.T
        inputs = last[:, : self.inputs]
        regressors = np.hstack([now, inputs[:, list(self.feedthrough)]])
        residual = self._outer.update_many(regressors, last[:, self.inputs :])
        self._inner.update_many(np.hstack([now, inputs, residual]), following)
        self.updates += len(rows)
        return rows

    def windows(self) -> Array:
        """Return the complete windows kept (k, (p + 1) m), scaled, oldest first."""
        return self._windows(self.past + 1)[0]

    def with_order(self, order: int) -> Propagator:
        """Return a tracker of another order with the samples of this one; its next snapshot chooses S."""
        other = copy(self)
        other.order, other.selection, other._map, other.updates = order, None, None, 0
        other._blocks_kept = self._blocks_kept.copy()
        forgetting, present = self._inner.forgetting, len(self.feedthrough)
        other._outer = SmallRls(self.outputs, order + present, forgetting)
        other._inner = SmallRls(order, order + self.inputs + self.outputs, forgetting)
        return other

    def _keep(self, block: Array) -> None:
        if self._kept == len(self._blocks_kept):
            self._blocks_kept[: self._span] = self._blocks_kept[-self._span :]
            self._kept = self._span
        self._blocks_kept[self._kept] = block
        self._kept, self._filled = self._kept + 1, min(self._filled + 1, self.past)

    def _innovation(self, z: Array, e: ArrayLike | None, window: Array) -> Array:
        """Return e scaled: the filter's where it is given and known, else y − Ξ z, zero before a window is full."""
        if self.block == len(z):
            return np.zeros(0)
        if e is not None:
            given: Array = _table(e, self.outputs, "e") / self._scale[self.inputs :]
            if np.isfinite(given).all():
                return given
        if self._filled < self.past or self._theta is None:
            return np.zeros(self.outputs)
        own: Array = z[self.inputs :] - self._theta @ np.concatenate([window, z[list(self.feedthrough)]])
        return own

    @property
    def ready(self) -> bool:
        """Return whether as many samples were used as there are unknowns a row: before, poles mean nothing."""
        return self.updates >= self.order + self.inputs + self.outputs

    @property
    def A(self) -> Array:
        """Return A (n, n)."""
        return self._inner.theta[:, : self.order].copy()

    @property
    def theta(self) -> Array:
        """Return Ξ (l, p m + d) of the last snapshot, scaled; zeros before."""
        width = self.past * self.block + len(self.feedthrough)
        return np.zeros((self.outputs, width)) if self._theta is None else self._theta

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return A, B, C, D, K in scaled units."""
        n, r = self.order, self.inputs
        D = np.zeros((self.outputs, r))
        D[:, list(self.feedthrough)] = self._outer.theta[:, n:]
        inner, outer = self._inner.theta, self._outer.theta
        return inner[:, :n].copy(), inner[:, n : n + r], outer[:, :n], D, inner[:, n + r :]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Return the poles (n,), largest magnitude first; NaN before `ready`."""
        if not self.ready:
            return np.full(self.order, np.nan + 0j)
        values = np.linalg.eigvals(self._inner.theta[:, : self.order]).astype(complex)
        return values[np.argsort(-abs(values), kind="stable")]

    def model(self, inputs: Sequence[Signal], outputs: Sequence[Signal], sample_time_s: float) -> StateSpace:
        """Return the present model in the channels' units; inputs, outputs give names and units.

        Raises NotIdentifiable before `ready`.
        """
        if not self.ready:
            needed = self.order + self.inputs + self.outputs
            raise NotIdentifiable(f"{self.updates} samples have come with a full window, {needed} are needed")
        r = self.inputs
        su, sy = self._scale[:r], self._scale[r:]
        A, B, C, D, K = self.matrices

        def named(signals: Sequence[Signal], offsets: Array) -> tuple[Signal, ...]:
            return tuple(Signal(s.name, s.unit, float(o)) for s, o in zip(signals, offsets, strict=True))

        return StateSpace(
            A, B / su, sy[:, None] * C, sy[:, None] * D / su, K / sy, np.zeros(len(A)), None, sample_time_s,
            named(inputs, self._offset[:r]), named(outputs, self._offset[r:]),
            tuple(Signal(f"x{i + 1}") for i in range(len(A))),
        )  # fmt: skip


def _rows(values: ArrayLike, width: int, name: str) -> Array:
    table = np.asarray(values, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != width:
        raise UsageError(f"{name} has shape {table.shape}, (samples, {width}) is needed")
    return table


def _table(values: ArrayLike, length: int, name: str) -> Array:
    table = np.asarray(values, dtype=np.float64).ravel()
    if table.shape != (length,):
        raise UsageError(f"{name} holds {table.size} values, {length} are needed")
    return table
