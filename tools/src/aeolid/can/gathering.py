"""Gather the frames of one snapshot, repair what was lost, and check it."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import Description
from aeolid.can.repair import GROUP_MAX, Repairs, restore_from
from aeolid.can.wire import BEGIN, END, PARAMETER, PARAMETER_FD, REPAIR, REPAIR_FD, Messages

Words = NDArray[np.uint32]
Mask = NDArray[np.bool_]
PAUSE_LEAST, PAUSE_SHARE = 8, 2  # messages before repair is tried again: 8, and half as many as have come


class Gathering:
    """Hold one snapshot under way: blocks of `width` parameters, 1 on classic CAN, 14 on CAN FD."""

    def __init__(self, number: int, description: Description, node: int) -> None:
        self.number = number
        self.messages = 0
        self.repaired = 0
        self.begin: int | None = None
        self.crc: int | None = None
        self.ends = 0
        self.done = False
        self.contradicted = False  # all parameters are there and the checksum is of others
        self.first_place: int | None = None
        self.last_place = 0
        self._node = node
        self._version = description.wire_version
        self._count = description.parameters
        self._width = description.values_a_frame
        blocks = -(-self._count // self._width)
        self._repairs_max = blocks + 8 * -(-blocks // GROUP_MAX)  # what 100 repair frames for 100 blocks make
        self._values = np.zeros((blocks, self._width), np.uint32)
        self._have = np.zeros((blocks, self._width), bool)
        self._have.ravel()[self._count :] = True  # what the last block lacks is zero
        self._torn = np.zeros((blocks, self._width), bool)  # came twice with different values
        self._repairs = Repairs(self._repairs_max, self._width)
        self._pause = 0  # messages at which repair is tried again
        self._was_whole = False  # at the last try
        self._low: int | None = None
        self._index: int | None = None

    def take(self, m: Messages) -> None:
        """Take messages of this number in the order of arrival."""
        if self.first_place is None:
            self.first_place = int(m.place[0])
        self.last_place = int(m.place[-1])
        begins = m.value[m.kind == BEGIN]
        if len(begins):
            self.begin = int(begins[-1])
        self._take_parameters(m)
        self._take_repairs(m)
        ends = np.flatnonzero(m.kind == END)
        if len(ends):
            self.crc, self._low = int(m.value[ends[-1]]), int(m.index[ends[-1]])
            self.ends += len(ends)

    def _take_parameters(self, m: Messages) -> None:
        index = m.index.astype(np.int64) + m.lane
        mine = (m.kind == (PARAMETER if self._width == 1 else PARAMETER_FD)) & (index < self._count)
        if not mine.any():
            return
        index, value = index[mine], m.value[mine]
        values, have, torn = self._values.reshape(-1), self._have.reshape(-1), self._torn.reshape(-1)
        again = have[index]
        torn[index[again][values[index[again]] != value[again]]] = True
        values[index] = value
        torn[index[values[index] != value]] = True  # twice in this batch
        have[index] = ~torn[index]

    def _take_repairs(self, m: Messages) -> None:
        width = self._width
        mine = (m.kind == REPAIR) if width == 1 else (m.kind == REPAIR_FD) & (m.lane == 0)
        at = np.flatnonzero(mine & (m.index < self._repairs_max))
        at = at[at + width <= len(m)]  # the values of one frame are neighbours
        at = at[m.lane[at + width - 1] == width - 1]
        self._repairs.put(m.index[at].astype(np.int64), m.value[at[:, None] + np.arange(width)])

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return self._values.nbytes + self._have.nbytes + self._torn.nbytes + self._repairs.nbytes

    def is_whole(self) -> bool:
        """Tell whether every parameter is there."""
        return bool(self._have.all())

    def _missing(self) -> int:
        """Count the blocks that are not there."""
        if self._width == 1:
            return len(self._have) - int(np.count_nonzero(self._have))
        return int(np.count_nonzero(~self._have.all(axis=1)))

    def may_be_complete(self) -> bool:
        """Tell whether it is time to look: the checksum is there, and all parameters or repairs enough for the rest.

        After a try that failed half as many messages again must come, so that all tries cost no more than three times
        the last: repair frames that do not fit must not be worth more of the processor than others.
        """
        if self.crc is None:
            return False
        missing = self._missing()
        if missing == 0 and not self._was_whole:
            return True
        return self.messages >= self._pause and (missing == 0 or self.ends >= 2 or missing < len(self._repairs))

    def wait(self) -> None:
        """Note that a try has failed."""
        self._was_whole = self.is_whole()
        self._pause = self.messages + max(PAUSE_LEAST, self.messages // PAUSE_SHARE)

    def repair(self) -> None:
        """Restore missing parameters from the repair frames."""
        if not self.is_whole() and len(self._repairs):
            whole: Mask = np.all(self._have, axis=1)
            before = int(np.count_nonzero(self._have))
            values = np.where(self._have, self._values, np.uint32(0))
            restore_from(values, whole, *self._repairs.all())
            self._values[whole], self._have[whole] = values[whole], True
            self.repaired += int(np.count_nonzero(self._have)) - before

    def parameters(self) -> tuple[Words, Mask]:
        """Return copies of the values (N,) and which of them are there."""
        return self._values.reshape(-1)[: self._count].copy(), self._have.reshape(-1)[: self._count].copy()

    def fits(self, newest: Sequence[int]) -> bool:
        """Tell whether all parameters are there and are those the checksum was made of.

        In version 2 node, number, count and sample index are part of it: it also finds the index where begin was lost.
        """
        if self.crc is None or not self.is_whole():
            return False
        theta = self._values.reshape(-1)[: self._count].astype("<u4").tobytes()
        if self._version == 1:
            self.contradicted = zlib.crc32(theta) != self.crc
            return not self.contradicted
        for index in (self.begin, *self._guesses(newest)):
            if index is not None:
                head = np.array(
                    [self.number | self._count - 1 << 8 | self._node << 24, index & 0xFFFFFFFF], "<u4"
                ).tobytes()
                self.contradicted = zlib.crc32(head + theta) != self.crc
                if not self.contradicted:
                    self._index = index & 0xFFFFFFFF
                    return True
        return False

    def _guesses(self, newest: Sequence[int]) -> list[int]:
        """Return the indices nearest to the newest sample that end like the one in the end frames."""
        if self._low is None:
            return []
        return [max(n + (self._low - n + 32768) % 65536 - 32768, 0) for n in newest]

    def sample_index(self, newest: Sequence[int]) -> int | None:
        """Return the sample index; where no checksum has proved one, what begin or end say."""
        if self._index is not None:
            return self._index
        return self.begin if self.begin is not None else next(iter(self._guesses(newest)), None)
