"""Put sample messages of one node into a recording; lost ones are NaN."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
JUMP = 1000  # a larger hole may be a restart or a silence longer than the index counts: a full index decides
SHUFFLE = 16  # gateways may swap neighbours; a longer way back is a restart, or a silence of 65536 samples
ANCHOR = 20_000  # a full index told within one batch lies no farther from the newest sample; below half of 65536
SPARSE = 20  # rows per arrived value that a table may have
TABLE_BYTES_FREE = 1 << 28  # tables below this size may be as sparse as they like


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Hold one uninterrupted run of a node: index (N,), values (N, channels), lost values that never arrived.

    A value that arrived as NaN was missing in the controller already; it is not counted as lost.
    """

    index: NDArray[np.int64]
    values: Array
    lost: int


@dataclass
class _Segment:
    """Hold samples whose 16-bit indices follow each other; `shift` is added once a full index is known."""

    index: list[NDArray[np.int64]] = field(default_factory=list)
    channel: list[NDArray[np.uint8]] = field(default_factory=list)
    value: list[NDArray[np.uint32]] = field(default_factory=list)
    first: int = 0
    last: int = 0
    shift: int | None = None
    floor: int | None = None  # samples below it have been released


Part = tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.uint32]]


def follows(first: int, last: int, values: int, every: int) -> bool:
    """Tell whether sample `first` goes on with a run of so many values that ended with sample `last`."""
    return 0 <= first - last <= JUMP + SPARSE * values * max(every, 1)


def _joined(segment: _Segment) -> Part:
    """Return index, channel and value of a segment in one piece each."""
    if len(segment.index) > 1:
        segment.index = [np.concatenate(segment.index)]
        segment.channel, segment.value = [np.concatenate(segment.channel)], [np.concatenate(segment.value)]
    if not segment.index:
        return np.zeros(0, np.int64), np.zeros(0, np.uint8), np.zeros(0, np.uint32)
    return segment.index[0], segment.channel[0], segment.value[0]


class SampleStore:
    """Collect (channel, index modulo 65536, value) of one configuration, in the order of arrival."""

    def __init__(self, channels: int) -> None:
        self.arrived = 0
        self._channels = channels
        self._segments: list[_Segment] = []
        self._before: int | None = None  # newest index that has been released
        self._gone = (0, 0)  # values that arrived for released samples, and that were lost

    def add(self, channel: NDArray[np.uint8], index: NDArray[np.uint16], value: NDArray[np.uint32]) -> None:
        """Take a batch; channels that the description does not know are left out."""
        known = channel < self._channels
        if not known.all():
            channel, index, value = channel[known], index[known], value[known]
        if not len(index):
            return
        self.arrived += len(index)
        previous = np.concatenate([[self._segments[-1].last & 0xFFFF if self._segments else index[0]], index[:-1]])
        step = (index.astype(np.int64) - previous.astype(np.int64) + 32768) % 65536 - 32768
        breaks = np.flatnonzero((step > JUMP) | (step < -SHUFFLE))
        start = 0
        for stop in [*breaks.tolist(), len(index)]:
            if stop > start:
                self._extend(channel[start:stop], step[start:stop], value[start:stop], int(index[start]))
            if stop < len(index):
                self._segments.append(_Segment(first=int(index[stop]), last=int(index[stop])))
                step[stop] = 0
            start = stop

    def _extend(
        self, channel: NDArray[np.uint8], step: NDArray[np.int64], value: NDArray[np.uint32], first: int
    ) -> None:
        if not self._segments:
            self._segments.append(_Segment(first=first, last=first))
        segment = self._segments[-1]
        index = segment.last + np.cumsum(step)
        segment.last = int(index[-1])
        if segment.floor is not None and index.min() < segment.floor:
            late = index < segment.floor
            self.arrived -= int(np.count_nonzero(late))
            index, channel, value = index[~late], channel[~late], value[~late]
        segment.index.append(index)
        segment.channel.append(channel.copy())
        segment.value.append(value.copy())

    def anchor(self, full: int) -> None:
        """Take a full sample index that the node sent about now."""
        if not self._segments:
            return
        segment = self._segments[-1]
        shift = round((full - segment.last) / 65536) * 65536
        if abs(full - segment.last - shift) <= ANCHOR and segment.shift is None:
            segment.shift = shift

    def last_index(self) -> int | None:
        """Return the newest sample index as far as it is known."""
        if not self._segments:
            return None
        return self._segments[-1].last + (self._segments[-1].shift or 0)

    def lost(self, every: int) -> int:
        """Return how many values are missing between the first and the newest sample, holes between segments aside."""
        step, expected = max(every, 1), 0
        for segment in self._segments:
            expected += max(0, (segment.last - segment.first) // step + 1)
        arrived, lost = self._gone
        return lost + max(0, expected * self._channels - (self.arrived - arrived))

    def release(self, keep: int, every: int) -> list[SampleTable]:
        """Return the tables of all but about the newest `keep` samples, and forget them: memory stays bounded.

        The first table may go on with the run that an earlier release ended with (`follows` tells). Nothing is released
        before a full index has dated it, unless much more than `keep` has come without one.
        """
        many = keep * self._channels
        held = sum(len(part) for segment in self._segments for part in segment.index)
        if held <= many or (self._segments[-1].shift is None and held <= 8 * many):
            return []
        head = SampleStore(self._channels)
        head._before = self._before
        while held > many:
            segment = self._segments.pop(0)
            size = sum(map(len, segment.index))
            if held - size < many:
                segment, rest = self._split(segment, held - many, max(every, 1))
                self._segments.insert(0, rest)
                held = many
            head.arrived += sum(map(len, segment.index))
            head._segments.append(segment)
            held -= size
        lost = head.lost(every)
        tables = head.tables(every)
        if tables:
            self._before = int(tables[-1].index[-1])
        self._gone = (self._gone[0] + head.arrived, self._gone[1] + lost)
        return tables

    def _split(self, segment: _Segment, count: int, step: int) -> tuple[_Segment, _Segment]:
        """Part a segment at the sample of its value number `count`; its shift is settled with that."""
        shift = self._shift(segment, self._before)
        index, channel, value = _joined(segment)
        cut = segment.first + (int(index[count]) - segment.first) // step * step
        old = index < cut
        head = _Segment([index[old]], [channel[old]], [value[old]], segment.first, cut - step, shift)
        rest = _Segment([index[~old]], [channel[~old]], [value[~old]], cut, segment.last, shift, cut)
        return head, rest

    def tables(self, every: int) -> list[SampleTable]:
        """Return one table for each uninterrupted run of the node, NaN where a value was lost.

        every: the node sends every k-th sample; rows are those only. A run ends where the index goes back (the
        node was restarted) or where almost everything is missing.
        """
        runs: list[list[Part]] = []
        last, total = self._before, 0
        for segment in self._segments:
            index, channel, value = _joined(segment)
            if not len(index):
                continue
            index = index + self._shift(segment, last)
            if not runs or last is None or not follows(int(index.min()), last, total, every):
                runs.append([])
                total = 0
            runs[-1].append((index, channel, value))
            total += len(index)
            last = int(index.max())
        return [table for run in runs if (table := self._table(run, max(every, 1))) is not None]

    @staticmethod
    def _shift(segment: _Segment, last: int | None) -> int:
        if segment.shift is not None:
            return segment.shift
        first = segment.first
        if last is None or first > last or first < JUMP:
            return 0  # never told otherwise: a low index after a high one is a restart
        return -((first - last) // 65536) * 65536

    def _table(self, run: list[Part], every: int) -> SampleTable | None:
        index, channel, value = (np.concatenate([part[i] for part in run]) for i in range(3))
        low, high = int(index.min()), int(index.max())
        rows = (high - low) // every + 1
        if rows * self._channels * 8 > TABLE_BYTES_FREE and rows > SPARSE * len(index):
            return None  # forged indices, not a recording
        table = np.full((rows, self._channels), np.nan)
        arrived = np.zeros((rows, self._channels), bool)
        at = (index - low) // every
        table[at, channel] = value.view(np.float32).astype(np.float64)
        arrived[at, channel] = True
        return SampleTable(low + every * np.arange(rows, dtype=np.int64), table, int(arrived.size - arrived.sum()))
