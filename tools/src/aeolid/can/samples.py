"""Put sample messages of one node into a recording; lost ones and those that are not believed are NaN."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.can.garbling import MARGIN, Garbling
from aeolid.can.judging import SEAL, SHUFFLE, VALUE, Part, Rows, believe, drop_strays, gather, join_parts

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
JUMP = 1000  # a larger hole may be a restart or a silence longer than the index counts: a full index decides
SOON = 20_000  # after so few samples without a full index none of the 16 bits has been lost count of
ANCHOR = 20_000  # a full index told within one batch lies no farther from the newest sample; below half of 65536
VOTES = 16  # different full indices that a segment remembers; more are garbled or forged
RECENT = 64  # samples before the one asked for that are looked at again
SPARSE = 20  # rows per arrived value that a table may have
TABLE_BYTES_FREE = 1 << 28  # tables below this size may be as sparse as they like


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Hold one uninterrupted run of a node: index (N,), values (N, channels), lost values that never arrived.

    A value that arrived as NaN was missing in the controller already; it is not counted as lost. rejected: samples
    among them that arrived and were not believed; their values count as lost.
    """

    index: Integers
    values: Array
    lost: int
    rejected: int = 0


@dataclass
class _Segment:
    """Hold samples whose 16-bit indices follow each other; `turn` times 65536 is added once a full index is known.

    votes: how often full indices said which turn, and where first. settled: the turn of samples released from here.
    """

    parts: list[Part] = field(default_factory=list)
    first: int = 0
    last: int = 0
    votes: dict[int, tuple[int, int]] = field(default_factory=dict)
    settled: int | None = None
    dated: bool = True  # `settled` is certain
    floor: int | None = None  # samples below it have been released
    ceiling: int | None = None  # samples from here on are held elsewhere

    def joined(self) -> Part:
        """Return all messages in one piece."""
        if len(self.parts) != 1:
            self.parts = [join_parts(self.parts)]
        return self.parts[0]

    def size(self) -> int:
        """Count the messages."""
        return sum(len(p.index) for p in self.parts)

    def guess(self) -> int | None:
        """Return the turn that most full indices say, None without any."""
        if self.settled is not None:
            return self.settled
        return max(self.votes, key=lambda turn: self.votes[turn][0]) if self.votes else None


@dataclass
class _Piece:
    """Hold believed and rejected rows that lie in one run: full index (k,), bits and there (k, channels)."""

    index: Integers
    bits: NDArray[np.uint32]
    there: NDArray[np.bool_]
    rejected: int


def follows(first: int, last: int, values: int, every: int) -> bool:
    """Tell whether sample `first` goes on with a run of so many values that ended with sample `last`."""
    return 0 <= first - last <= JUMP + SPARSE * values * max(every, 1)


class SampleStore:
    """Collect (channel, index modulo 65536, value) of one configuration, in the order of arrival."""

    def __init__(self, channels: int, every: int = 1, garbling: Garbling | None = None, head: int = 0) -> None:
        """Prepare. head: first word under the seals, node + 256 tag."""
        self._head = head
        self.arrived = 0
        self._channels = channels
        self._jump = min(max(JUMP, 8 * every), 30_000)
        self._garbling = garbling
        self._segments: list[_Segment] = []
        self._newest_place = 0
        self._sealing = 0  # 1 once a seal has come
        self._before: int | None = None  # newest index that has been released
        self._gone = (0, 0)  # values that arrived for released samples, and that were lost

    def add(
        self,
        channel: NDArray[np.uint8],
        index: NDArray[np.uint16],
        value: NDArray[np.uint32],
        place: Integers | None = None,
        what: NDArray[np.uint8] | None = None,
    ) -> None:
        """Take a batch; channels that the description does not know are left out.

        place (n,): numbers of the frames; what (n,): VALUE, SURE or SEAL, whose channel is the number of channels.
        """
        count = len(index)
        place = np.zeros(count, np.int64) if place is None else place
        what = np.full(count, VALUE, np.uint8) if what is None else what
        known = np.where(what == SEAL, channel == self._channels, channel < self._channels)
        if self._garbling is not None:
            self._garbling.add(place[(what == SEAL) & ~known])
        part = Part(index.astype(np.int64), channel, value, place, what)
        part = self._drop_jumps(part if known.all() else part.take(known))
        if not len(part.index):
            return
        seals = int(np.count_nonzero(part.what == SEAL))
        self._sealing |= seals > 0
        self.arrived += len(part.index) - seals
        self._newest_place = int(part.place[-1])
        previous = np.append(self._segments[-1].last & 0xFFFF if self._segments else part.index[0], part.index[:-1])
        step = (part.index - previous + 32768) % 65536 - 32768
        breaks = np.flatnonzero((step > self._jump) | (step < -SHUFFLE))
        start = 0
        for stop in [*breaks.tolist(), len(step)]:
            if stop > start:
                self._extend(part.take(slice(start, stop)), step[start:stop])
            if stop < len(step):
                self._segments.append(_Segment(first=int(part.index[stop]), last=int(part.index[stop])))
                step[stop] = 0
            start = stop

    def _drop_jumps(self, part: Part) -> Part:
        """Leave out single messages that jump away from where the next one goes on: garbled, or of another node."""
        if len(part.index) < 3:
            return part
        step = (np.diff(part.index) + 32768) % 65536 - 32768
        jumps = (step > self._jump) | (step < -SHUFFLE)
        over = (part.index[2:] - part.index[:-2] + 32768) % 65536 - 32768
        strays = jumps[:-1] & jumps[1:] & (over <= self._jump) & (over >= -SHUFFLE)
        if not strays.any():
            return part
        return part.take(~np.concatenate([[False], strays, [False]]))

    def _extend(self, part: Part, step: Integers) -> None:
        if not self._segments:
            first = int(part.index[0])
            self._segments.append(_Segment(first=first, last=first))
        segment = self._segments[-1]
        index = segment.last + np.cumsum(step)
        segment.last = int(index[-1])
        part = replace(part, index=index, channel=part.channel.copy(), value=part.value.copy())
        if segment.floor is not None and index.min() < segment.floor:
            late = index < segment.floor
            self.arrived -= int(np.count_nonzero(late & (part.what != SEAL)))
            part = part.take(~late)
        segment.parts.append(part)

    def anchor(self, full: int, place: int = 0) -> None:
        """Take a full sample index that the node sent about now; garbled ones are outvoted."""
        if not self._segments:
            return
        segment = self._segments[-1]
        turn = round((full - segment.last) / 65536) * 65536
        if abs(full - segment.last - turn) <= ANCHOR and (turn in segment.votes or len(segment.votes) < VOTES):
            count, first = segment.votes.get(turn, (0, place))
            segment.votes[turn] = (count + 1, first)

    def last_indices(self) -> list[int]:
        """Return what the newest sample index may be, the likeliest first."""
        if not self._segments:
            return []
        segment = self._segments[-1]
        turns = [segment.guess() or 0, *segment.votes, self._expect(segment, self._before)]
        return [segment.last + turn for turn in dict.fromkeys(turns)]

    def is_empty(self) -> bool:
        """Tell whether no message is held."""
        return not any(segment.size() for segment in self._segments)

    def last_index(self) -> int | None:
        """Return the newest sample index as far as it is known."""
        if not self._segments:
            return None
        return self._segments[-1].last + (self._segments[-1].guess() or 0)

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
        before a full index has dated it, unless much more than `keep` has come without one; and, before the bus is
        closed, nothing on which frames to come may throw doubt.
        """
        bus = self._garbling
        if bus is not None and not bus.closed and self._newest_place + MARGIN >= bus.frames:
            keep = max(keep, MARGIN)
        many = keep * (self._channels + self._sealing)
        held = sum(segment.size() for segment in self._segments)
        if held <= many or (self._segments[-1].guess() is None and not self._sealing and held <= 8 * many):
            return []
        head = SampleStore(self._channels, garbling=self._garbling, head=self._head)
        head._before = self._before
        while held > many:
            segment = self._segments.pop(0)
            size = segment.size()
            if held - size < many:
                segment, rest = self._split(segment, held - many, max(every, 1))
                self._segments.insert(0, rest)
                held = many
            head.arrived += sum(int(np.count_nonzero(p.what != SEAL)) for p in segment.parts)
            head._segments.append(segment)
            held -= size
        lost = head.lost(every)
        tables = head.tables(every)
        if tables:
            self._before = int(tables[-1].index[-1])
        self._gone = (self._gone[0] + head.arrived, self._gone[1] + lost)
        return tables

    def _split(self, segment: _Segment, count: int, step: int) -> tuple[_Segment, _Segment]:
        """Part a segment at the sample of its message number `count`; its turn is settled with that."""
        part = segment.joined()
        cut = segment.first + (int(part.index[count]) - segment.first) // step * step
        old = part.index < cut
        head = _Segment([part.take(old)], segment.first, cut - step, segment.votes, segment.settled)
        head.dated, head.floor, head.ceiling = segment.dated, segment.floor, cut
        rows = self._rows(head, step)
        turn, certain = self._turn(segment, self._before)
        if rows is not None:
            _, turns, proved = believe(rows, {turn}, self._garbling)
            turn, certain = (int(turns[-1]), True) if proved.any() else (turn, certain)
        rest = _Segment([part.take(~old)], cut, segment.last, {}, turn, certain, cut)
        return head, rest

    def _rows(self, segment: _Segment, every: int) -> Rows | None:
        part = segment.joined()
        if len(part.index):
            part = drop_strays(part, every, None if segment.floor is None else segment.floor - 1, segment.ceiling)
        return gather(part, self._channels, self._head) if len(part.index) else None

    def tables(self, every: int) -> list[SampleTable]:
        """Return one table for each uninterrupted run of the node, NaN where a value was lost or is not believed.

        every: the node sends every k-th sample; rows are those only. A run ends where the index goes back (the
        node was restarted) or where almost everything is missing.
        """
        runs: list[list[_Piece]] = []
        last, total = self._before, 0
        for segment in self._segments:
            for piece in self._pieces(segment, max(every, 1), last):
                if not runs or last is None or not follows(int(piece.index[0]), last, total, every):
                    runs.append([])
                    total = 0
                runs[-1].append(piece)
                total += int(np.count_nonzero(piece.there))
                last = int(piece.index[-1])
        return [table for run in runs if (table := self._table(run, max(every, 1))) is not None]

    def newest(self, after: int | None, every: int) -> list[SampleTable]:
        """Return what `tables` would, but where one run goes on only its rows about and after sample `after`."""
        if after is None or len(self._segments) != 1:
            return self.tables(every)
        segment = self._segments[0]
        turn, certain = self._turn(segment, self._before)
        part = segment.joined()
        recent = part.index >= after - turn * 65536 - RECENT * max(every, 1)
        if not recent.any():
            return self.tables(every)
        view = SampleStore(self._channels, garbling=self._garbling, head=self._head)
        view._before = self._before
        piece = replace(segment, parts=[part.take(recent)], settled=turn, dated=certain)
        view._segments = [piece]
        return view.tables(every)

    def _pieces(self, segment: _Segment, every: int, last: int | None) -> list[_Piece]:
        """Judge a segment; rows with full indices, parted where the node began to count anew."""
        rows = self._rows(segment, every)
        if rows is None:
            return []
        turn, certain = self._turn(segment, last)
        believed, turns, proved = believe(rows, {turn, *segment.votes}, self._garbling)
        if not certain and self._garbling is not None:
            believed &= proved | self._garbling.is_quiet(rows.first, rows.last)
        index = rows.index + np.where(proved, turns, turn)
        cuts = (np.flatnonzero(np.diff(turns)) + 1).tolist()
        pieces = []
        for start, stop in zip([0, *cuts], [*cuts, len(index)], strict=True):
            good = np.flatnonzero(believed[start:stop])
            if len(good):
                span = slice(start + int(good[0]), start + int(good[-1]) + 1)
                there = rows.have[span] & believed[span, None]
                pieces.append(_Piece(index[span], rows.bits[span], there, int(np.count_nonzero(~believed[span]))))
        return pieces

    def _turn(self, segment: _Segment, last: int | None) -> tuple[int, bool]:
        """Decide the turn of what no seal dates, and whether it is certain.

        Certain are two full indices that agree, one on a quiet bus, or a start soon after sample `last`.
        """
        if segment.settled is not None:
            return segment.settled, segment.dated
        likely, told = self._expect(segment, last), segment.guess()
        count, place = (0, 0) if told is None else segment.votes[told]
        if told is not None and (count > 1 or self._garbling is None or self._garbling.quiet_at(place)):
            return told, True
        if last is not None and 0 <= segment.first + likely - last <= SOON:
            return likely, True
        return (likely if told is None else told), False

    @staticmethod
    def _expect(segment: _Segment, last: int | None) -> int:
        first = segment.first
        if last is None or first > last or first < JUMP:
            return 0  # never told otherwise: a low index after a high one is a restart
        return -((first - last) // 65536) * 65536

    def _table(self, run: list[_Piece], every: int) -> SampleTable | None:
        index = np.concatenate([piece.index for piece in run])
        low, high = int(index.min()), int(index.max())
        rows = (high - low) // every + 1
        if rows * self._channels * 8 > TABLE_BYTES_FREE and rows > SPARSE * len(index) * self._channels:
            return None  # forged indices, not a recording
        table = np.full((rows, self._channels), np.nan)
        arrived = np.zeros((rows, self._channels), bool)
        for piece in run:
            row, channel = np.nonzero(piece.there)
            at = (piece.index[row] - low) // every
            table[at, channel] = piece.bits[row, channel].view(np.float32).astype(np.float64)
            arrived[at, channel] = True
        lost = int(arrived.size - np.count_nonzero(arrived))
        rejected = sum(piece.rejected for piece in run)
        return SampleTable(low + every * np.arange(rows, dtype=np.int64), table, lost, rejected)
