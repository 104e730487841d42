"""Compress recordings into one triangular factor of all their windows of p + 1 samples.

A window row is v_k = [z_{k-p} … z_{k-1}, u_k, y_k], z = [u; y] scaled: the regressor of paper 000 eq. (9) followed by
its target. With innovations estimated beforehand it is that of eq. (14), z = [u; y; e], and e_k ends the row. The
factor of the rows [1, v_k] holds everything VARX, VARMAX and PBSIDopt ask of the data, with a free constant in every
regression: RᵀR = Σ (v_k − v̄)(v_k − v̄)ᵀ, R (q, q), q = (p + 1) m, is the block beside the constant. Factors of several
recordings merge by another QR. Only the factor and one chunk are in memory at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray
from scipy.linalg import lapack

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.magnitudes import require_magnitude
from aeolid.record import Record, require_same_layout
from aeolid.wording import counted

Array = NDArray[np.float64]
CONSTANT = 1e-10  # spread below this fraction of the size is rounding, not signal


@dataclass(frozen=True, eq=False)
class Scaling:
    """Hold what makes channels comparable: z = (value − offset)/scale, inputs first, then outputs.

    offset (m,): mean over all valid samples of all recordings; scale (m,): their standard deviation. innovations names
    the channels of e in VARMAX windows, none in VARX ones; e is scaled like y, without an offset.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    offset: Array
    scale: Array
    innovations: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Return the channels of a block, in its order."""
        return self.inputs + self.outputs + self.innovations

    @property
    def channels(self) -> int:
        """Return m = r + l, with innovations r + 2 l."""
        return len(self.names)

    def without_innovations(self) -> Scaling:
        """Return the scaling of the inputs and outputs alone."""
        count = len(self.inputs) + len(self.outputs)
        return replace(self, innovations=(), offset=self.offset[:count], scale=self.scale[:count])

    def apply(self, values: Array) -> Array:
        """Scale samples (N, m)."""
        scaled: Array = (values - self.offset) / self.scale
        return scaled


@dataclass(frozen=True, eq=False)
class WindowFactor:
    """Hold the triangular factor (q + 1, q + 1) of all rows [1, v_k]; `skipped` windows held a missing sample."""

    full: Array
    past: int
    inputs: int
    outputs: int
    windows: int
    skipped: int
    innovations: int = 0

    @property
    def channels(self) -> int:
        """Return m = r + l, with innovations r + 2 l."""
        return self.inputs + self.outputs + self.innovations

    @property
    def u_now(self) -> Array:
        """Return the columns of R that hold u_k, (q, r)."""
        first = self.past * self.channels
        return self.R[:, first : first + self.inputs]

    @property
    def y_now(self) -> Array:
        """Return the columns of R that hold y_k, (q, l)."""
        first = self.past * self.channels + self.inputs
        return self.R[:, first : first + self.outputs]

    @property
    def R(self) -> Array:
        """Return the factor (q, q) of the windows about their mean."""
        return self.full[1:, 1:]

    @property
    def mean(self) -> Array:
        """Return the mean window (q,)."""
        out: Array = self.full[0, 1:] / self.full[0, 0]
        return out

    @property
    def _layout(self) -> tuple[int, ...]:
        return (*self.full.shape, self.past, self.inputs, self.outputs, self.innovations)

    def merge(self, other: WindowFactor) -> WindowFactor:
        """Return the factor of both sets of windows together; the order of merging changes rounding only."""
        if self._layout != other._layout:
            raise UsageError("factors of different window length or channels do not merge")
        full = triangularise(np.vstack([self.full, other.full]))
        return replace(self, full=full, windows=self.windows + other.windows, skipped=self.skipped + other.skipped)


def triangularise(rows: Array) -> Array:
    """Return the triangular factor (q, q) of rows (N, q), padded with zero rows where N < q."""
    count, width = rows.shape
    work = np.zeros((max(count, width), width), order="F")
    work[:count] = rows
    return _factor_in_place(work)


def find_scaling(records: Sequence[Record], *, driven: bool = False) -> Scaling:
    """Return the common offset and scale of all recordings' inputs and outputs.

    driven: whether the method needs an input; the others take recordings of outputs alone. Raises NotIdentifiable on a
    constant channel, DataError on a channel without samples or none of a role.
    """
    require_same_layout(records, ordered=False)
    inputs, outputs = records[0].names("input"), records[0].names("output")
    if not outputs or (driven and not inputs):
        role = "input" if outputs else "output"
        raise DataError(f"{records[0].source}: no channel has the role {role!r}; name one in the roles file")
    count, mean, square = (np.zeros(len(inputs + outputs)) for _ in range(3))
    for record in records:
        columns = _columns(record, inputs + outputs)
        for name, column in zip(inputs + outputs, columns, strict=True):
            require_magnitude(record.source, name, record.values[:, column])
        for start in range(0, len(record), 1 << 16):
            chunk = record.values[start : start + (1 << 16), columns]
            if np.isinf(chunk).any():
                row, col = np.argwhere(np.isinf(chunk))[0]
                name = (inputs + outputs)[col]
                raise DataError(
                    f"{record.source}: channel {name!r} is infinite at sample {start + row + 1}; mark it missing"
                )
            count, mean, square = _merge_moments(count, mean, square, chunk)
    _refuse_dead_channels(records, inputs + outputs, count, mean, square)
    return Scaling(inputs, outputs, mean, np.sqrt(square / count))


def factorise(
    records: Sequence[Record], scaling: Scaling, past: int, *, first: float = 0.0, last: float = 1.0
) -> WindowFactor:
    """Return the factor of all complete windows of p + 1 samples of the recordings.

    first, last: take windows whose target lies in this part of each recording, 0…1; [0, s) and [s, 1] together are the
    whole without loss. Windows with a missing sample are left out and counted; no window spans two recordings. Cost:
    2 N q² operations, memory q² and one chunk.
    """
    m = scaling.channels
    width = (past + 1) * m + 1
    chunk = max(8 * width, 2048)
    work = np.zeros((width + chunk, width), order="F")
    windows = skipped = 0
    for record in records:
        columns = _columns(record, scaling.names)
        start, stop = (max(round(part * len(record)), past) for part in (first, last))
        for rows in _window_chunks(record, columns, scaling, past, start, stop, chunk):
            good = np.isfinite(rows).all(axis=1)
            kept = int(np.count_nonzero(good))
            skipped += len(rows) - kept
            windows += kept
            work[width : width + kept, 0] = 1.0
            work[width : width + kept, 1:] = rows if kept == len(rows) else rows[good]
            work[width + kept :] = 0.0
            work[:width] = _factor_in_place(work[: width + kept])
    full, r, outputs = np.ascontiguousarray(work[:width]), len(scaling.inputs), len(scaling.outputs)
    return WindowFactor(full, past, r, outputs, windows, skipped, len(scaling.innovations))


def window_rows(record: Record, scaling: Scaling, past: int, chunk: int) -> Iterator[Array]:
    """Yield all windows of a recording, (≤ chunk, (p + 1) m) scaled, not a number where a sample is missing."""
    yield from _window_chunks(record, _columns(record, scaling.names), scaling, past, past, len(record), chunk)


def require_windows(
    records: Sequence[Record], past: int, channels: int, windows: int | None = None, lead: int | None = None
) -> None:
    """Refuse a set with fewer complete windows than unknowns; the text says how many are needed.

    windows: number of complete windows, default the most the recordings' lengths allow (a check before any work).
    lead: samples before the target of the first window, default p; 2 p where the p regressors are themselves found from
    the p samples before each.
    """
    lead = past if lead is None else lead
    most = sum(max(len(r) - lead, 0) for r in records)
    found = most if windows is None else windows
    needed = (past + 1) * channels + 1
    if found >= needed:
        return
    lost = f" ({most - found} more hold a missing sample)" if most > found else ""
    raise NotIdentifiable(
        f"{records[0].source}: {counted(found, 'complete window')} of {lead + 1} samples{lost}; past window "
        f"{past} with {channels}"
        f" channels needs at least {needed}, that is {needed + lead} samples without a gap;"
        " record longer or use a shorter past window"
    )


def _columns(record: Record, names: Sequence[str]) -> list[int]:
    place = {c.name: i for i, c in enumerate(record.channels)}
    return [place[n] for n in names]


def _window_chunks(
    record: Record, columns: list[int], scaling: Scaling, past: int, start: int, stop: int, chunk: int
) -> Iterator[Array]:
    """Yield windows (≤ chunk, (p + 1) m) with targets start … stop − 1 as views of one scaled chunk of samples."""
    m = len(columns)
    for low in range(start, stop, chunk):
        high = min(low + chunk, stop)
        z = np.ascontiguousarray(scaling.apply(record.values[low - past : high, columns]))
        # row i of the view starts at sample i: successive windows overlap in memory, nothing is copied
        yield as_strided(z, (high - low, (past + 1) * m), (z.strides[0], z.strides[1]), writeable=False)


def _factor_in_place(work: Array) -> Array:
    """Return R (q, q) of a Fortran-ordered work array (≥ q, q); its content is lost."""
    width = work.shape[1]
    result, _, _, info = lapack.dgeqrf(work, lwork=64 * width, overwrite_a=1)
    if info != 0:
        raise DataError("the windows hold a value that is not finite")
    R: Array = np.triu(result[:width])
    return R


def _merge_moments(count: Array, mean: Array, square: Array, chunk: Array) -> tuple[Array, Array, Array]:
    """Add a chunk (k, m) to running count, mean and sum of squared deviations; NaN left out (pairwise update)."""
    good = np.isfinite(chunk)
    added = good.sum(axis=0).astype(np.float64)
    safe = np.maximum(added, 1.0)
    values = np.where(good, chunk, 0.0)
    middle = values.sum(axis=0) / safe
    spread = (np.where(good, chunk - middle, 0.0) ** 2).sum(axis=0)
    total = np.maximum(count + added, 1.0)
    shift = np.where(added > 0, middle - mean, 0.0)
    return count + added, mean + shift * added / total, square + spread + shift**2 * count * added / total


def _refuse_dead_channels(
    records: Sequence[Record], names: Sequence[str], count: Array, mean: Array, square: Array
) -> None:
    for i, name in enumerate(names):
        if count[i] == 0:
            raise NotIdentifiable(
                f"{records[0].source}: channel {name!r} has no sample; all {len(records[0])} are missing"
            )
        if np.sqrt(square[i] / count[i]) <= CONSTANT * abs(mean[i]) or square[i] == 0:
            raise NotIdentifiable(
                f"{records[0].source}: channel {name!r} is constant at {mean[i]:g} {records[0].unit(name)}; "
                "give it the role 'ignore' or record with excitation"
            )
