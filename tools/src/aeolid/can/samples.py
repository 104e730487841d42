"""Put sample messages of one node into a recording; lost ones and those that are not believed are NaN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.can.compact import merge_tail
from aeolid.can.counts import Count, Counts
from aeolid.can.garbling import MARGIN, Garbling
from aeolid.can.judging import SEAL, SHUFFLE, VALUE, Part, Rows, believe, drop_strays, gather, join_parts
from aeolid.can.limits import TWIN_LEAST
from aeolid.can.tables import SPARSE, Piece, SampleTable, cut_before, follows, tables_of

__all__ = ["SampleStore", "SampleTable", "follows"]
Integers = NDArray[np.int64]
JUMP = 1000  # a larger hole may be a restart or a silence longer than the index counts: a full index decides
SOON = 20_000  # after so few samples without a full index none of the 16 bits has been lost count of
ANCHOR = 20_000  # a full index told within one batch lies no farther from the newest sample; below half of 65536
VOTES = 16  # different full indices that a count remembers; more are garbled or forged
RECENT = 64  # samples before the one asked for that are looked at again
PATIENCE = 8  # times what is to be kept that waits for a full index


class SampleStore:
    """Collect (channel, index modulo 65536, value) of one configuration, in the order of arrival.

    contradicted: samples of which two different versions came. refused: so many that two nodes must bear the number;
    nothing more is taken then. left_out: messages that were not taken for this reason, or as strays.
    """

    def __init__(self, channels: int, every: int = 1, garbling: Garbling | None = None, head: int = 0) -> None:
        """Prepare. head: first word under the seals, node + 256 tag."""
        self._head = head
        self.arrived = 0
        self.contradicted = 0
        self.refused = False
        self.refused_out = 0
        self._channels = channels
        self._garbling = garbling
        self._counts = Counts(channels, min(max(JUMP, 8 * every), 30_000), every)
        self._newest_place = 0
        self._sealing = 0  # 1 once a seal has come
        self._before: int | None = None  # newest index that has been released
        self._gone = (0, 0)  # values that arrived for released samples, and that were lost

    @property
    def _segments(self) -> list[Count]:
        return self._counts.believed

    @property
    def rival_messages(self) -> int:
        """Count the messages of a second count of samples that went on beside the one believed."""
        return self._counts.contested

    @property
    def left_out(self) -> int:
        """Count the messages that were not taken."""
        return self.refused_out + self._counts.contested + self._counts.strays

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return self._counts.nbytes

    @property
    def messages(self) -> int:
        """Count the messages that are held for release."""
        return sum(count.size() for count in self._segments)

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
        if self.refused:
            self.refused_out += len(index)
            return
        count = len(index)
        place = np.zeros(count, np.int64) if place is None else place
        what = np.full(count, VALUE, np.uint8) if what is None else what
        known = np.where(what == SEAL, channel == self._channels, channel < self._channels)
        if self._garbling is not None:
            self._garbling.add(place[(what == SEAL) & ~known])
        part = Part(index.astype(np.int64), channel, value, place, what)
        part = part if known.all() else part.take(known)
        if not len(part):
            return
        self._sealing |= bool((part.what == SEAL).any())
        self._newest_place = int(part.place[-1])
        for owner, mine in self._counts.sort(part):
            self._extend(owner, mine)
        self.arrived += self._counts.collect()

    @staticmethod
    def _extend(owner: Count, part: Part) -> None:
        part = replace(part, channel=part.channel.copy(), value=part.value.copy())
        if owner.floor is not None and part.index.min() < owner.floor:
            part = part.take(part.index >= owner.floor)
        owner.parts.append(part)
        owner.fresh += int(np.count_nonzero(part.what != SEAL))
        merge_tail(owner.parts, join_parts)

    def anchor(self, full: int, place: int = 0) -> None:
        """Take a full sample index that the node sent about now; garbled ones are outvoted."""
        segment = self._counts.latest
        if segment is None:
            return
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
        found = [segment.last + turn for turn in dict.fromkeys(turns)]
        latest = self._counts.latest
        return found if latest is None or latest is segment else [*found, latest.last]

    def is_empty(self) -> bool:
        """Tell whether no message is held."""
        return not self._counts.holds()

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

    def release(
        self, keep: int, every: int, *, patience: int = PATIENCE, share: int = SPARSE, least: int = 0
    ) -> list[SampleTable]:
        """Return the tables of all but about the newest `keep` samples, and forget them: memory stays bounded.

        The first table may go on with the run that an earlier release ended with (`follows` tells). Nothing is released
        before a full index has dated it, unless `patience` times `keep` has come without one; and, before the bus is
        closed, nothing on which frames to come may throw doubt. share: rows a table may have for each with a value;
        least: messages for which it is worth while. With keep 0 nothing more is expected.
        """
        if keep == 0:
            self._counts.close()
            self.arrived += self._counts.collect()
        many, held = keep * (self._channels + self._sealing), self.messages
        rest = max(many, self._doubtful())
        undated = bool(self._segments) and self._segments[-1].guess() is None and not self._sealing
        if held <= rest or (keep and held - rest < least) or (undated and held <= patience * many):
            return []
        head = SampleStore(self._channels, garbling=self._garbling, head=self._head)
        head._before = self._before
        while held > rest:
            segment = self._segments.pop(0)
            size = segment.size()
            if held - size < rest or not self._segments:
                segment, left = self._split(segment, held - rest, max(every, 1))
                self._segments.insert(0, left)
                held = rest
            head.arrived += sum(int(np.count_nonzero(p.what != SEAL)) for p in segment.parts)
            head._segments.append(segment)
            held -= size
        return self._let_go(head, every, share)

    def _let_go(self, head: SampleStore, every: int, share: int) -> list[SampleTable]:
        """Return the tables of what leaves; samples that contradict each other end the recording of this number."""
        lost = head.lost(every)
        tables, torn = head._tables(every, share)
        self.contradicted += len(torn)
        if self.contradicted >= TWIN_LEAST or (torn and self._counts.contested):
            # a second node that is ahead by what frames may overtake each other has begun within so many samples
            tables = cut_before(tables, torn[0] - 2 * (SHUFFLE + 1) * max(every, 1)) if torn else tables
            self.refused = True
            self.refused_out += sum(s.size() for s in self._segments)
            self._counts.clear()
        if tables:
            self._before = int(tables[-1].index[-1])
        self._gone = (self._gone[0] + head.arrived, self._gone[1] + lost)
        return tables

    def _doubtful(self) -> int:
        """Count the newest messages on which frames to come may throw doubt."""
        bus = self._garbling
        if bus is None or bus.closed or self._newest_place + MARGIN < bus.frames:
            return 0
        return sum(
            len(part) - int(np.searchsorted(part.place, bus.frames - MARGIN))
            for segment in self._segments
            for part in segment.parts
        )

    def _split(self, segment: Count, number: int, step: int) -> tuple[Count, Count]:
        """Part a segment at the sample of its message `number`; its turn is settled with that."""
        part = segment.joined()
        if number >= len(part):
            cut = segment.last + step
        else:
            cut = segment.first + (int(part.index[number]) - segment.first) // step * step
        old = part.index < cut
        head = replace(segment, parts=[part.take(old)], last=cut - step, ceiling=cut)
        rows = self._rows(head, step)
        turn, certain = self._turn(segment, self._before)
        if rows is not None:
            _, turns, proved = believe(rows, {turn}, self._garbling)
            turn, certain = (int(turns[-1]), True) if proved.any() else (turn, certain)
        segment.parts = [part.take(~old)]
        segment.first, segment.votes, segment.settled, segment.dated, segment.floor = cut, {}, turn, certain, cut
        return head, segment

    def _rows(self, segment: Count, every: int) -> Rows | None:
        part = segment.joined()
        if len(part.index):
            part = drop_strays(part, every, None if segment.floor is None else segment.floor - 1, segment.ceiling)
        return gather(part, self._channels, self._head) if len(part.index) else None

    def tables(self, every: int, share: int = SPARSE) -> list[SampleTable]:
        """Return one table for each uninterrupted run of the node, NaN where a value was lost or is not believed.

        every: the node sends every k-th sample; rows are those only. A run ends where the index goes back (the
        node was restarted) or where almost everything is missing: more than `share` times what is there.
        """
        return self._tables(every, share)[0]

    def _tables(self, every: int, share: int) -> tuple[list[SampleTable], list[int]]:
        pieces: list[Piece] = []
        torn: list[int] = []
        last, step = self._before, max(every, 1)
        closed = self._garbling is None or self._garbling.closed
        for segment in self._counts.shown(closed):
            found, contradicted = self._pieces(segment, step, last)
            pieces += found
            torn += contradicted
            last = int(found[-1].index[-1]) if found else last
        return tables_of(pieces, self._channels, step, share), torn

    def judge(self, every: int) -> None:
        """Count the samples held of which two versions came, as `release` does: so many, and two nodes sent them."""
        torn = self._tables(every, SPARSE)[1]
        self.contradicted += len(torn)
        self.refused |= self.contradicted >= TWIN_LEAST or bool(torn and self._counts.contested)

    def newest(self, after: int | None, every: int) -> list[SampleTable]:
        """Return what `tables` would, but where one run goes on only its rows about and after sample `after`."""
        if after is None or len(self._segments) != 1:
            return self.tables(every)
        segment = self._segments[0]
        turn, certain = self._turn(segment, self._before)
        low = after - turn * 65536 - RECENT * max(every, 1)
        recent = [p for p in segment.parts if len(p) and int(p.index.max()) >= low]
        if not recent:
            return self.tables(every)
        part = join_parts(recent)
        view = SampleStore(self._channels, garbling=self._garbling, head=self._head)
        view._before = self._before
        view._counts.believed = [replace(segment, parts=[part.take(part.index >= low)], settled=turn, dated=certain)]
        return view.tables(every)

    def _pieces(self, segment: Count, every: int, last: int | None) -> tuple[list[Piece], list[int]]:
        """Judge a segment; rows with full indices, parted where the node began to count anew.

        Returns also the samples of which two versions came, on a quiet bus or with seals.
        """
        rows = self._rows(segment, every)
        if rows is None:
            return [], []
        turn, certain = self._turn(segment, last)
        believed, turns, proved = believe(rows, {turn, *segment.votes}, self._garbling)
        if not certain and self._garbling is not None:
            believed &= proved | self._garbling.is_quiet(rows.first, rows.last)
        index = rows.index + np.where(proved, turns, turn)
        torn = rows.torn
        if torn.any() and self._garbling is not None:
            torn = torn & (rows.sealed | self._garbling.is_quiet(rows.first, rows.last))
        cuts = (np.flatnonzero(np.diff(turns)) + 1).tolist()
        pieces = []
        for start, stop in zip([0, *cuts], [*cuts, len(index)], strict=True):
            good = np.flatnonzero(believed[start:stop])
            if len(good):
                span = slice(start + int(good[0]), start + int(good[-1]) + 1)
                there = rows.have[span] & believed[span, None]
                pieces.append(Piece(index[span], rows.bits[span], there, believed[span]))
        return pieces, index[torn].tolist()

    def _turn(self, segment: Count, last: int | None) -> tuple[int, bool]:
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
    def _expect(segment: Count, last: int | None) -> int:
        first = segment.first
        if last is None or first > last or first < JUMP:
            return 0  # never told otherwise: a low index after a high one is a restart
        return -((first - last) // 65536) * 65536
