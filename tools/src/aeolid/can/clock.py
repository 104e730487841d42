"""Relate the controller's samples to the host's clock: when sample 0 was, and how far the two clocks drift apart."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.limits import PART_BYTES, PIECES_MAX
from aeolid.can.messages import DATED_MAX_S
from aeolid.can.theil_sen import fit_line
from aeolid.can.wire import BASE, SAMPLE, SAMPLE_FD, Frames, choose_layout, decode

Array = NDArray[np.float64]
Index = NDArray[np.int64]
STRAY = 50  # samples by which the index may differ from what the host's clock lets expect, and
STRAY_SHARE = 0.05  # this share of the samples that went by; beyond, the node was restarted
BACK = 16  # samples by which frames may overtake each other
JUMP = 1000  # a longer step, or one after a longer pause, is looked at with the host's clock
MOMENT_S = 2.0
PAIRS_MAX = 4096  # pairs that are kept: with more, neighbours are merged
BINS = 48  # earliest arrivals of so many stretches make the line
LEAST = 4  # stretches
CONFIDENCE = 0.95
NOT_REAL_TIME_PPM = 10_000.0
INDEX_MAX = 1 << 40  # no node counts so far; time stamps that leap may make believe it
RUNS_MAX = 16  # of one node that are kept, the newest
OLD_PAIRS = 512  # pairs that are kept of a run which another follows
LOOSE = 64  # batches that are held one by one before they are joined


@dataclass(frozen=True)
class ClockFit:
    """Hold how host time follows from the sample index: t = start_utc + index * sample_time * (1 + drift).

    start_utc: host time of sample 0, s since 1970: that of its arrival, the shortest way over bus and interface
    included. drift_ppm: above 0 when the controller's seconds are longer than the host's; half_width_ppm: half the 95 %
    interval. scatter_s: how far the earliest arrivals scatter about the line; None where too few samples arrived.
    """

    start_utc: float
    drift_ppm: float | None
    half_width_ppm: float | None
    scatter_s: float | None
    span_s: float
    pairs: int

    @property
    def is_real_time(self) -> bool:
        """Tell whether the controller runs in real time; no oscillator is off as far as 1 %."""
        return self.drift_ppm is not None and abs(self.drift_ppm) < NOT_REAL_TIME_PPM


class ClockPairs:
    """Collect (sample index, host time of arrival) of one run of a node, in bounded memory.

    Arrival is never early, often late: of neighbours the one that came earliest is kept.
    """

    def __init__(self, sample_time_s: float) -> None:
        self.sample_time_s = sample_time_s
        self.count = 0
        self.first: tuple[int, float] | None = None
        self.last: tuple[int, float] | None = None
        self._index: list[Index] = []
        self._time: list[Array] = []
        self._held = 0
        self._width = 1  # samples of which one pair is kept

    def add(self, index: Index, time_s: Array) -> None:
        """Take pairs (n,) in the order of arrival."""
        self.count += len(index)
        self.first = self.first or (int(index[0]), float(time_s[0]))
        self.last = int(index[-1]), float(time_s[-1])
        self._index.append(index)
        self._time.append(time_s)
        self._held += len(index)
        if self._held > 2 * PAIRS_MAX:
            self._thin(PAIRS_MAX // 2)
        elif len(self._index) >= LOOSE:
            self._index, self._time = [np.concatenate(self._index)], [np.concatenate(self._time)]

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return 16 * self._held + PART_BYTES * (1 + len(self._index))

    def end(self) -> None:
        """Keep less: another run has begun."""
        if self._held > OLD_PAIRS:
            self._thin(OLD_PAIRS)

    def rate(self) -> float:
        """Return the seconds a sample took so far: a simulated controller may run faster than the clock on the wall."""
        if self.first is None or self.last is None or self.last[0] - self.first[0] < 2 * STRAY:
            return self.sample_time_s
        took = (self.last[1] - self.first[1]) / (self.last[0] - self.first[0])
        return took if took > 0 else self.sample_time_s

    def _thin(self, most: int) -> None:
        index, time_s = self.pairs()
        index, time_s = earliest(index, time_s, index // self._width, self.sample_time_s)
        while len(index) > most:
            self._width *= 2
            index, time_s = earliest(index, time_s, index // self._width, self.sample_time_s)
        self._index, self._time, self._held = [index], [time_s], len(index)

    def pairs(self) -> tuple[Index, Array]:
        """Return the pairs that are kept (n,), by index."""
        index, time_s = np.concatenate(self._index), np.concatenate(self._time)
        order = np.argsort(index, kind="stable")
        return index[order], time_s[order]

    def fit(self, shift: int = 0) -> ClockFit | None:
        """Fit the line; shift is added to the indices. None where nothing has arrived, or sample 0 has no date."""
        if not self._index:
            return None
        index, time_s = self.pairs()
        fit = fit_clock(index + shift, time_s, self.sample_time_s, self.count)
        return fit if abs(fit.start_utc) < DATED_MAX_S else None


def earliest(index: Index, time_s: Array, group: Index, rate: float) -> tuple[Index, Array]:
    """Keep of each group (n,), which ascends, the pair that lies lowest above a line of slope `rate`."""
    delay = time_s - rate * index
    order = np.lexsort((delay, group))
    first = np.flatnonzero(np.diff(group[order], prepend=group[order][0] - 1))
    chosen = np.sort(order[first])
    return index[chosen], time_s[chosen]


def fit_clock(index: Index, time_s: Array, sample_time_s: float, count: int | None = None) -> ClockFit:
    """Fit host time over sample index (n,) by the earliest arrivals of 48 stretches and the Theil–Sen line.

    The median of all slopes stands up to a quarter of wrong pairs, and to delays that come and go. Its interval is that
    of Theil (1950) and Sen (1968), distribution-free.
    """
    h = sample_time_s
    pairs = len(index) if count is None else count
    first, x0 = float(time_s[0] - h * index[0]), index - index[0]
    lone = ClockFit(first, None, None, None, float(time_s[-1] - time_s[0]), pairs)
    if len(index) < LEAST or x0[-1] <= 0:
        return lone
    late = time_s - time_s[0] - h * x0  # (n,) s, against a controller without drift
    rate = 0.0
    for _ in range(3):  # which arrival is earliest depends a little on the slope
        bins = min(BINS, max(LEAST, len(index) // 8))
        group = np.minimum(x0 * bins // (x0[-1] + 1), bins - 1)
        x, y = earliest(x0, late, group, rate)
        if len(x) < LEAST:
            return lone
        slope, intercept, low, high = fit_line((x * h).astype(np.float64), y, CONFIDENCE)
        rate = float(slope) * h
    rest = y - slope * h * x - intercept
    scatter = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    start = float(time_s[0] + intercept - h * (1.0 + slope) * index[0])
    return ClockFit(start, 1e6 * float(slope), 5e5 * float(high - low), scatter, lone.span_s, pairs)


class ClockKeeper:
    """Follow the clocks of all nodes from the frames themselves; a restart of a node begins a new line."""

    def __init__(self, base: int = BASE) -> None:
        self._base = base
        self._runs: dict[int, list[ClockPairs]] = {}
        self._early: dict[int, list[tuple[Index, Array]]] = {}  # of nodes that have not described themselves yet

    def feed(self, frames: Frames, sample_times: dict[int, float]) -> None:
        """Take the data frames of a batch; sample_times: of the nodes that have described themselves, s a sample."""
        for node, index, time_s in first_channels(frames, self._base):
            h = sample_times.get(node)
            early = self._early.pop(node, [])
            if h is None:
                self._early[node] = self._wait(early, index, time_s)
                continue
            for low, at in [*early, (index, time_s)]:
                self._add(node, low, at, h)

    @staticmethod
    def _wait(early: list[tuple[Index, Array]], index: Index, time_s: Array) -> list[tuple[Index, Array]]:
        """Keep the first pairs of a node that has not described itself yet."""
        if sum(len(low) for low, _ in early) >= PAIRS_MAX:
            return early
        early = [*early, (index, time_s)]
        if len(early) < LOOSE:
            return early
        return [(np.concatenate([low for low, _ in early]), np.concatenate([at for _, at in early]))]

    def forget(self, nodes: Collection[int]) -> None:
        """Forget the early pairs of all nodes but these."""
        for number in [n for n in self._early if n not in nodes]:
            del self._early[number]

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        early = sum(16 * len(low) + PART_BYTES for parts in self._early.values() for low, _ in parts)
        return early + sum(run.nbytes for runs in self._runs.values() for run in runs)

    def runs(self, node: int) -> list[ClockPairs]:
        """Return the lines of a node, oldest first."""
        return [run for run in self._runs.get(node, []) if run.count]

    def _add(self, node: int, low: Index, time_s: Array, h: float) -> None:
        """Unwrap 16-bit indices: steps within a batch are short, across batches the host's clock counts the turns."""
        steps = (np.diff(low) + 32768) % 65536 - 32768
        index = low[0] + np.concatenate([[0], np.cumsum(steps)])
        breaks = np.flatnonzero((steps > JUMP) | (steps < -BACK)) + 1
        runs = self._runs.setdefault(node, [])
        pieces = np.split(np.arange(len(index)), breaks)
        if len(pieces) > PIECES_MAX:  # leaps to and fro: the longest tell most
            least = sorted((len(piece) for piece in pieces), reverse=True)[PIECES_MAX - 1]
            pieces = [piece for piece in pieces if len(piece) >= least][:PIECES_MAX]
        for piece in pieces:
            start = self._place(runs, int(index[piece[0]]), float(time_s[piece[0]]), h)
            runs[-1].add(index[piece] - index[piece[0]] + start, time_s[piece])

    @staticmethod
    def _place(runs: list[ClockPairs], index: int, time_s: float, h: float) -> int:
        start = index & 0xFFFF
        if runs and runs[-1].sample_time_s == h and runs[-1].last is not None:
            last, at = runs[-1].last
            passed_s = time_s - at
            near = last + (index - last + 32768) % 65536 - 32768
            if (
                -BACK <= near - last <= JUMP and abs(passed_s) < MOMENT_S
            ):  # what is read at once has one time for all of it
                return near
            expected = last + passed_s / runs[-1].rate()
            turned = index + round((expected - index) / 65536) * 65536
            if (
                turned < INDEX_MAX
                and abs(turned - expected) <= STRAY + STRAY_SHARE * (expected - last)
                and turned >= last - BACK
            ):
                return turned
            if -BACK <= near - last <= JUMP:  # the host's clock was set, and the node goes on
                start = near
        if runs:
            runs[-1].end()
        runs.append(ClockPairs(h))
        del runs[:-RUNS_MAX]
        return start


def first_channels(frames: Frames, base: int = BASE) -> list[tuple[int, Index, Array]]:
    """Find the frames that carry the first channel of a sample: node, sample index modulo 65536 (n,), host time (n,).

    Frames without a time, and damaged ones, are left out.
    """
    kind = frames.id - np.uint32(base) >> np.uint32(choose_layout(base).shift)
    rows = np.flatnonzero(((kind == SAMPLE) | (kind == SAMPLE_FD)) & (frames.data[:, 0] == 0))
    rows = rows[np.isfinite(frames.time_s[rows])]
    if not len(rows):
        return []
    messages = decode(frames.take(rows), base)
    first = np.flatnonzero(messages.lane == 0)
    index, node = messages.index[first].astype(np.int64), messages.node[first]
    time_s = frames.time_s[rows[messages.place[first]]]
    return [(n, index[node == n], time_s[node == n]) for n in np.unique(node).tolist()]
