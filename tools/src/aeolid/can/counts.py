"""Tell apart the counts of samples that arrive under one node's number: the one believed, restarts, strays, a twin."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from aeolid.can.judging import SHUFFLE, Part, join_parts
from aeolid.can.limits import PART_BYTES, RIVALS_MAX, RUN_LEAST

SILENT = 4  # a count takes the place of another that sent less than a fourth as much meanwhile
COUNT_BYTES = 400


@dataclass
class Count:
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
    taken: int = 0  # messages so far
    other_at: int = 0  # what the count believed had taken when this one began
    touched: int = 0  # when it was last heard
    fresh: int = 0  # values not yet collected
    into: Count | None = None  # the count that it has turned out to go on with, and …
    shift: int = 0  # … what is added to its indices there

    def joined(self) -> Part:
        """Return all messages in one piece."""
        if len(self.parts) != 1:
            self.parts = [join_parts(self.parts)]
        return self.parts[0]

    def size(self) -> int:
        """Count the messages."""
        return sum(len(p) for p in self.parts)

    def guess(self) -> int | None:
        """Return the turn that most full indices say, None without any."""
        if self.settled is not None:
            return self.settled
        return max(self.votes, key=lambda turn: self.votes[turn][0]) if self.votes else None


class Counts:
    """Sort messages by the count they belong to; memory does not depend on how indices leap.

    believed: the counts of the node, one after the other, the newest going on. Beside it a few rivals are followed: one
    that reaches RUN_LEAST samples while the newest is silent is a restart and takes its place; one that goes on while
    the newest does is a second node of this number, or a forgery, and is left out. contested: its messages; strays:
    those of counts that came to nothing.
    """

    def __init__(self, channels: int, jump: int, every: int = 1) -> None:
        """Prepare. jump: samples that may be missing within a count; every: the node sends every k-th one."""
        self.believed: list[Count] = []
        self.latest: Count | None = None
        self.contested = 0
        self.strays = 0
        self._jump, self._near, self._least = jump, min(SHUFFLE * max(every, 1), jump), RUN_LEAST * channels
        self._rivals: list[Count] = []
        self._clock = 0

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return sum(
            COUNT_BYTES + sum(p.nbytes + PART_BYTES for p in count.parts)
            for group in (self.believed, self._rivals)
            for count in group
        )

    def sort(self, part: Part) -> Iterator[tuple[Count, Part]]:
        """Yield the counts that messages (n ≥ 1) belong to, with theirs, their indices unwrapped."""
        step = np.zeros(len(part), np.int64)
        step[1:] = (np.diff(part.index) + 32768) % 65536 - 32768
        breaks = np.flatnonzero((step > self._near) | (step < -SHUFFLE))
        step[breaks] = 0
        along = np.cumsum(step)
        starts = [0, *breaks.tolist()]
        stops = [*starts[1:], len(part)]
        heads, begins, ends = (x.tolist() for x in (part.index[starts], along[starts], along[np.array(stops) - 1]))
        owners, shifts = [], []
        for number, (low, begin, end) in enumerate(zip(heads, begins, ends, strict=True)):
            owner, start = self._find(low)
            owners.append(owner)
            shifts.append(start - begin)
            self._note(owner, end + start - begin, stops[number] - starts[number])
        for number, owner in enumerate(owners):
            if owner.into is not None:  # it has turned out to be the same count, after a hole
                owners[number], shifts[number] = owner.into, shifts[number] + owner.shift
        part = replace(part, index=along + np.repeat(shifts, np.diff([*starts, len(part)])))
        if len(starts) == 1:
            yield owners[0], part
            return
        stretch = np.repeat(np.arange(len(starts)), np.diff([*starts, len(part)]))
        groups: dict[int, list[int]] = {}
        for number, owner in enumerate(owners):
            groups.setdefault(id(owner), []).append(number)
        for numbers in groups.values():
            owner = owners[numbers[0]]
            if any(owner is other for other in (*self._rivals, *self.believed)):
                yield owner, part.take(np.isin(stretch, numbers))

    def _find(self, low: int) -> tuple[Count, int]:
        """Return the count that an index goes on with, and the index in its counting; a new one where none does.

        After a hole a new one begins too: which of two nodes goes on is seen only when the other one has fallen silent.
        """
        best, found = None, 0
        for count in (*self.believed[-1:], *self._rivals):
            step = (low - count.last + 32768) % 65536 - 32768
            if -SHUFFLE <= step <= self._near and (best is None or abs(step) < abs(found)):
                best, found = count, step
                if step > 0 and count is self.believed[-1]:
                    break  # the count believed goes first, whatever strays lie about
        if best is None:
            best, found = self._after_hole(low)
        if best is not None:
            return best, best.last + found
        count = Count(first=low, last=low)
        if not self.believed:
            self.believed.append(count)
            return count, low
        count.other_at = self.believed[-1].taken
        if len(self._rivals) >= RIVALS_MAX:
            self._drop(min(self._rivals, key=lambda rival: (rival.taken, rival.touched)))
        self._rivals.append(count)
        return count, low

    def _after_hole(self, low: int) -> tuple[Count | None, int]:
        """Return the rival that an index goes on with over a hole, and the step, while the count believed is silent.

        A bursty link brings fewer samples between two holes than a rival needs; as long as the count believed sends
        nothing beside it, the bursts are one rival's.
        """
        for rival in sorted(self._rivals, key=lambda rival: -rival.touched):
            step = (low - rival.last + 32768) % 65536 - 32768
            if 0 < step <= self._jump and rival.other_at == self.believed[-1].taken:
                return rival, step
        return None, 0

    def _note(self, count: Count, last: int, messages: int) -> None:
        """Note that a count went on; a rival may take the place of the one believed."""
        self._clock += 1
        count.last, count.touched, self.latest = last, self._clock, count
        count.taken += messages
        if count.taken < self._least or not any(count is rival for rival in self._rivals):
            return
        believed = self.believed[-1]
        if (believed.taken - count.other_at) * SILENT <= count.taken:
            self._believe(count)
        else:
            self.contested += count.taken
            count.parts, count.taken, count.fresh = [], 0, 0
            count.first, count.other_at = last, believed.taken

    def _believe(self, count: Count) -> None:
        """Let a rival take the place of the count believed, or go on with it where only a hole lies between."""
        self._rivals = [rival for rival in self._rivals if rival is not count]
        for rival in list(self._rivals):
            self._drop(rival)
        before = self.believed[-1]
        step = (count.first - before.last + 32768) % 65536 - 32768
        if not 0 < step <= self._jump or before.ceiling is not None:
            self.believed.append(count)
            return
        shift = before.last + step - count.first  # turns of 65536
        before.parts += [replace(p, index=p.index + shift) for p in count.parts]
        before.last, before.touched, self.latest = count.last + shift, count.touched, before
        before.taken, before.fresh = before.taken + count.taken, before.fresh + count.fresh
        for turn, (votes, place) in count.votes.items():
            told, first = before.votes.get(turn - shift, (0, place))
            before.votes[turn - shift] = (told + votes, first)
        count.into, count.shift, count.parts = before, shift, []

    def _drop(self, rival: Count) -> None:
        self._rivals = [other for other in self._rivals if other is not rival]
        self.strays += rival.taken

    def collect(self) -> int:
        """Return how many values have come to the counts believed since this was asked last."""
        values = sum(count.fresh for count in self.believed)
        for count in self.believed:
            count.fresh = 0
        return values

    def holds(self) -> bool:
        """Tell whether anything is held that may become part of a recording."""
        return any(count.size() for count in self.believed) or self._pending() is not None

    def _pending(self) -> Count | None:
        """Return the rival that the node went on with last: a restart just before the end."""
        latest = self.latest
        if latest is None or self.contested or not any(latest is rival for rival in self._rivals) or not latest.parts:
            return None
        return latest

    def shown(self, closed: bool) -> list[Count]:
        """Return the counts that make a recording; closed: nothing more will come."""
        pending = self._pending() if closed else None
        return self.believed if pending is None else [*self.believed, pending]

    def close(self) -> None:
        """Decide about what is pending: nothing more will come."""
        pending = self._pending()
        if pending is not None:
            self._believe(pending)
        for rival in list(self._rivals):
            self._drop(rival)

    def clear(self) -> None:
        """Forget everything."""
        self.believed, self._rivals, self.latest = [], [], None
