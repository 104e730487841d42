"""Bring a simulator's runs and the recordings to windows of one length, one rate and one scale.

Outputs are means over blocks of q samples; every sample of the inputs in a block stays a regressor of its own, so that
no operator on an input brings back what decimation took away. Blade outputs go to the fixed frame (Coleman, Feingold
1958): mean, cosine and sine part of three blades or more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from aeolid.diagnose.run_prior.grams import Gram, Moments, lagged_gram, total, with_noise, with_noisy_outputs
from aeolid.diagnose.run_prior.turning import turned
from aeolid.errors import NotIdentifiable
from aeolid.models.angles import radians_a_unit
from aeolid.models.multiblade import fixed_frame
from aeolid.record import Record

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Operator = Callable[[Array, float], Array]  # of a channel (N,) and its sample time in s
_SETTLE = 20  # blocks left out at the start: operators begin at rest
NOISE = 3e-3  # of a channel's deviation: what no linear law of a turbine, no converter and no rounding lets be known
_SHORTEST = 10  # windows of a stretch without a missing sample


@dataclass(frozen=True, eq=False)
class Side:
    """Hold one recording or run: u (N, r), y (N, l), azimuth (N,) in rad or None, where samples are missing, source.

    turned (N,): the angle in rad that the rotor has turned by, from anywhere, or None; d (N, k): recorded
    disturbances, None for none; region: place of its region of operation; start_s: time of its first sample in s.
    """

    u: Array
    y: Array
    azimuth: Array | None
    missing: Mask
    step: float
    source: str
    turned: Array | None = None
    d: Array | None = None
    region: int = 0
    start_s: float = 0.0

    def __len__(self) -> int:
        return len(self.u)


@dataclass(frozen=True, eq=False)
class Change:
    """Say what a hypothesis does to the data.

    inputs: operators on recorded inputs, by place; outputs: operators on outputs of the run, by place; extra: further
    regressors (N, e) of a recording, at its sample time; runs: what is added to a run's blocks of outputs (n, l).
    order: which of the run's outputs stands at each place, () for each at its own; turned: angle in rad that is added
    to the run's rotor angle.
    """

    inputs: Mapping[int, Operator] = field(default_factory=dict)
    outputs: Mapping[int, Operator] = field(default_factory=dict)
    extra: Callable[[Side], Array] | None = None
    runs: Callable[[Side], Array] | None = None
    order: tuple[int, ...] = ()
    turned: float = 0.0

    @property
    def is_of_recordings(self) -> bool:
        """Tell whether the runs stay as they are."""
        return not self.outputs and self.runs is None and not self.order and self.turned == 0.0

    def after(self, first: Change) -> Change:
        """Return both changes, `first` before this one."""
        return Change(
            _chained(first.inputs, self.inputs), _chained(first.outputs, self.outputs),
            _beside(first.extra, self.extra), _added(first.runs, self.runs), _ordered(first.order, self.order),
            first.turned + self.turned,
        )  # fmt: skip


def _chained(first: Mapping[int, Operator], then: Mapping[int, Operator]) -> dict[int, Operator]:
    both = dict(first)
    for i, f in then.items():
        inner = first.get(i)
        both[i] = f if inner is None else _compose(inner, f)
    return both


def _ordered(first: tuple[int, ...], then: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(first[j] for j in then) if first and then else first or then


def _compose(inner: Operator, outer: Operator) -> Operator:
    return lambda x, step: outer(inner(x, step), step)


def _beside(a: Callable[[Side], Array] | None, b: Callable[[Side], Array] | None) -> Callable[[Side], Array] | None:
    if a is None or b is None:
        return b if a is None else a
    return lambda side: np.hstack([a(side), b(side)])


def _added(a: Callable[[Side], Array] | None, b: Callable[[Side], Array] | None) -> Callable[[Side], Array] | None:
    if a is None or b is None:
        return b if a is None else a
    return lambda side: a(side) + b(side)


NOTHING = Change()


@dataclass(frozen=True, eq=False)
class Pair:
    """Hold recordings and runs as windows see them.

    inputs, outputs: names as recorded; shown: names of the outputs in the fixed frame; stride: samples a block; past:
    blocks a window; blades: places of each set of blade outputs; offset (regions, m), scale (m,): of the
    runs; disturbances: names of what is recorded of wind and waves on both sides, block means of which are regressors
    that nothing changes; noise (shown,): of the recordings' outputs in blocks, which the runs lack, in deviations;
    passing: how many blades pass in a revolution, of which outputs need not tell.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    shown: tuple[str, ...]
    recordings: tuple[Side, ...]
    runs: tuple[Side, ...]
    step: float
    stride: int
    past: int
    blades: tuple[tuple[int, ...], ...]
    offset: Array
    scale: Array
    disturbances: tuple[str, ...] = ()
    noise: Array | None = None
    passing: int = 3

    @property
    def held(self) -> int:
        """Return how many columns of a block are no outputs: all samples of the inputs, means of the disturbances."""
        return len(self.inputs) * self.stride + len(self.disturbances)

    @property
    def block_s(self) -> float:
        """Return the time of a block in s."""
        return self.step * self.stride

    @property
    def grain_s(self) -> float:
        """Return the time in s that values of hypotheses are graded by: a fortieth of the window."""
        return self.past * self.block_s / 40

    def regressors(self) -> int:
        """Return how many regressors a window has, the constant included."""
        return self.past * (self.held + len(self.shown)) + self.held + 1

    def of_recordings(self, change: Change = NOTHING, first: float = 0.0, last: float = 1.0) -> Moments:
        """Return the moments of the recordings' windows that end in a part of each, 0 … 1, with a change of them."""
        return self._of(self.recordings, Change(change.inputs, extra=change.extra), first, last)

    def of_runs(self, change: Change = NOTHING, first: float = 0.0, last: float = 1.0) -> Moments:
        """Return the moments of the runs' windows that end in a part of each, with what a change does to them."""
        return self._of(self.runs, replace(change, inputs={}, extra=None), first, last)

    def of_runs_changed(self, change: Change, first: float, last: float) -> Moments:
        """Return the moments of the runs' windows when a change acts on them as it does on recordings."""
        return self._of(self.runs, change, first, last)

    def _of(self, sides: Sequence[Side], change: Change, first: float, last: float) -> Moments:
        found: list[list[Gram]] = [[] for _ in self.offset]
        for s in sides:
            found[s.region].append(self._moments(s, change, first, last))
        regions = tuple(map(total, found))
        if sides is self.runs and self.noise is not None:
            regions = tuple(with_noisy_outputs(g, self.noise, self.held) for g in regions)
        return Moments(regions)

    def scaled(self, side: Side, blocks: Array) -> Array:
        """Return blocks of a side about the runs' means in its region, in the runs' deviations."""
        out: Array = (blocks - self.offset[side.region]) / self.scale
        return out

    def rewired(self, change: Change) -> Pair:
        """Return the pair whose runs' outputs are scaled, late and placed as a change has them."""

        def side(s: Side) -> Side:
            y = _changed(s.y, change.outputs, s.step)
            return replace(s, y=y[:, list(change.order)] if change.order else y)

        return replace(self, runs=tuple(map(side, self.runs)))

    def predicted(self, side: Side, change: Change, theta: Array, first: float) -> tuple[Array, Array, Array]:
        """Return times (n,), outputs (n, l) and one-step predictions (n, l) of a recording from a part on, in units.

        Outputs are means over blocks of `stride` samples, and each stands at the middle of its samples.
        theta (q, l): coefficients of the recording's region.
        """
        z = self.scaled(side, self.blocks(side, _changed(side.u, change.inputs, side.step), side.y))
        start = max(round(first * len(z)), self.past)
        held = self.held
        k = np.arange(start, len(z))
        rows = [z[k - i] for i in range(1, self.past + 1)] + [z[k][:, :held], np.ones((len(k), 1))]
        if change.extra is not None:
            rows.append(_before(_in_blocks(change.extra(side), self.stride)[:, -1])[k])
        scale, offset = self.scale[held:], self.offset[side.region][held:]
        time_s = np.asarray(side.start_s + k * self.block_s + 0.5 * (self.stride - 1) * side.step, dtype=np.float64)
        return time_s, z[k][:, held:] * scale + offset, np.hstack(rows) @ theta * scale + offset

    def _moments(self, side: Side, change: Change, first: float, last: float) -> Gram:
        u, y = _changed(side.u, change.inputs, side.step), _changed(side.y, change.outputs, side.step)
        if change.order:
            y = y[:, list(change.order)]
        if change.turned and side.azimuth is not None:
            side = replace(side, azimuth=side.azimuth + change.turned)
        z = self.scaled(side, self.blocks(side, u, y))
        if change.runs is not None:
            z[:, -len(self.shown) :] += change.runs(side) / self.scale[-len(self.shown) :]
        n = len(z)
        missing: Mask = np.any(side.missing[: n * self.stride].reshape(n, self.stride), axis=1)
        added = None if change.extra is None else _in_blocks(change.extra(side), self.stride)[:, -1]
        start = max(round(first * len(z)), _SETTLE + self.past) - self.past
        stop = round(last * len(z))
        parts = []
        for a, b in stretches(missing[start:stop], self.past + _SHORTEST):
            rows = slice(start + a, start + b)
            more = None if added is None else _before(added)[rows]
            parts.append(lagged_gram(z[rows], self.past, self.held, more))
        if not parts:
            raise NotIdentifiable(
                f"{side.source}: no stretch of {self.past + _SHORTEST} blocks of {self.block_s:g} s without a missing"
                " sample; record longer or fill the gaps"
            )
        return with_noise(total(parts), NOISE)

    def blocks(self, side: Side, u: Array, y: Array) -> Array:
        """Return blocks (n, r q + k + l) of a side with other inputs u and outputs y.

        All samples of the inputs, means of the disturbances, means of the outputs in the fixed frame.
        """
        held = _in_blocks(u, self.stride)
        mean = _in_blocks(fixed_frame(y, side.azimuth, self.blades), self.stride).mean(axis=1)
        known = [] if side.d is None else [_in_blocks(side.d, self.stride).mean(axis=1)]
        return np.hstack([held.reshape(len(held), -1), *known, mean])


def _before(added: Array) -> Array:
    """Return regressors of the block before: a filter's end at the same block would know of the present output."""
    return np.vstack([np.zeros((1, added.shape[1])), added[:-1]])


def _in_blocks(values: Array, stride: int) -> Array:
    n = len(values) // stride
    return values[: n * stride].reshape(n, stride, values.shape[1])


def _changed(values: Array, operators: Mapping[int, Operator], step: float) -> Array:
    if not operators:
        return values
    out = values.copy()
    for i, f in operators.items():
        out[:, i] = f(out[:, i], step)
    return out


def stretches(missing: Mask, shortest: int) -> list[tuple[int, int]]:
    """Return start and stop of every run of blocks without a missing sample, at least so long."""
    good = np.concatenate([[False], ~missing, [False]])
    edges = np.flatnonzero(np.diff(good.astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= shortest]


def side_of(
    record: Record, inputs: Sequence[str], outputs: Sequence[str], context: Mapping[str, Any],
    disturbances: Sequence[str] = (),
) -> Side:  # fmt: skip
    """Return a recording's channels with missing samples filled in: marked, but for single ones of a channel."""
    u, y, d = (record.columns(names) for names in (inputs, outputs, disturbances))
    missing: Mask = np.any([lost_for_long(x) for x in np.hstack([u, d, y]).T], axis=0)
    angle = record.names("azimuth")
    azimuth = None
    if angle:
        values = record.column(angle[0])
        missing |= ~np.isfinite(values)
        azimuth = np.nan_to_num(values) * radians_a_unit(record.unit(angle[0]), values)
    angle_turned = azimuth if azimuth is not None else turned(record, context)
    known = _filled(d) if disturbances else None
    return Side(
        _filled(u), _filled(y), azimuth, missing, record.sample_time_s, record.source, angle_turned, known,
        start_s=float(record.time_s[0]),
    )  # fmt: skip


def lost_for_long(values: Array) -> Mask:
    """Tell which samples of a channel (N,) are missing together with a neighbour, or at an end: no spline knows them.

    >>> lost_for_long(np.array([1.0, np.nan, 2.0, np.nan, np.nan, 3.0])).tolist()
    [False, False, False, True, True, False]
    """
    known = np.isfinite(values)
    beside = np.concatenate([[False], known, [False]])
    alone: Mask = beside[:-2] & beside[2:]
    out: Mask = ~known & ~alone
    return out


def _filled(values: Array) -> Array:
    """Return channels (N, n) without gaps: single samples by cubic splines, longer gaps by lines."""
    out = values.copy()
    for j in range(out.shape[1]):
        good = np.isfinite(out[:, j])
        if good.all() or not good.any():
            continue
        places = np.arange(len(out))
        line = np.interp(places, np.flatnonzero(good), out[good, j])
        single = ~good & ~lost_for_long(out[:, j])
        if np.any(single):
            line[single] = CubicSpline(places[~single], line[~single])(places[single])
        out[:, j] = line
    return out
