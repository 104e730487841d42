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


Part = tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.uint32]]


class SampleStore:
    """Collect (channel, index modulo 65536, value) of one configuration, in the order of arrival."""

    def __init__(self, channels: int) -> None:
        self.arrived = 0
        self._channels = channels
        self._segments: list[_Segment] = []

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
        segment.index.append(index)
        segment.channel.append(channel.copy())
        segment.value.append(value.copy())
        segment.last = int(index[-1])

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
            expected += (segment.last - segment.first) // step + 1
        return max(0, expected * self._channels - self.arrived)

    def tables(self, every: int) -> list[SampleTable]:
        """Return one table for each uninterrupted run of the node, NaN where a value was lost.

        every: the node sends every k-th sample; rows are those only. A run ends where the index goes back (the
        node was restarted) or where almost everything is missing.
        """
        runs: list[list[Part]] = []
        last, total = None, 0
        for segment in self._segments:
            index = np.concatenate(segment.index) + self._shift(segment, last)
            hole = None if last is None else int(index.min()) - last
            if hole is None or hole < 0 or hole > JUMP + SPARSE * total * max(every, 1):
                runs.append([])
                total = 0
            runs[-1].append((index, np.concatenate(segment.channel), np.concatenate(segment.value)))
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
