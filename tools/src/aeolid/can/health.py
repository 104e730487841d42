"""Follow the health messages of a node; what only a CRC-8 vouches for is told when something else agrees with it."""

from __future__ import annotations

from collections import deque

from aeolid.can.garbling import Garbling
from aeolid.can.wire import STOPPED, health_names

DEPTH = 8  # messages of an item that are kept
GROWTH = 16  # times as much as in the messages before may a counter grow around one that is believed, and …
GROWTH_FREE = 256  # … so much at any time
GOODBYES = 2  # closing messages that end a stream; one is enough once nothing more can come
BACK_LEAST, BACK_SHARE = (
    16,
    4,
)  # times the index leapt back and forth, and of so many told, before two nodes are supposed


class Health:
    """Hold flags, counters and the end of a node's stream."""

    def __init__(self, garbling: Garbling) -> None:
        self._garbling = garbling
        self._items: dict[str, deque[tuple[int, int]]] = {}  # (value, place), the newest last
        self._flags: deque[tuple[int, int]] = deque(maxlen=DEPTH)
        self._goodbyes: dict[tuple[int, int], int] = {}  # (flags, value) -> how often
        self._told: dict[str, int] = {}
        self._indices = self._back = 0  # sample indices told, and how often they leapt back and forth again
        self._left: tuple[int, int] | None = None  # the index before the last leap back, and the one after it

    def take(self, tag: int, flags: int, value: int, place: int) -> None:
        """Take one message."""
        name = health_names().get(tag)
        if name is None:
            return
        self._flags.append((flags & ~STOPPED, place))
        told = self._items.setdefault(name, deque(maxlen=DEPTH))
        if tag == 0:
            self._indices += 1
            self._compare(told[-1][0] if told else value, value)
        told.append((value, place))
        if flags & STOPPED and tag == 0:
            key = (flags, value)
            if key in self._goodbyes or len(self._goodbyes) < DEPTH:
                self._goodbyes[key] = self._goodbyes.get(key, 0) + 1

    def _compare(self, before: int, value: int) -> None:
        """Note leaps to and fro; a count that starts anew, however often, comes back by its own steps."""
        if value < before:
            self._left = before, value
        elif self._left is not None and value > self._left[0]:
            high, low = self._left
            self._back += 2 * (value - before) > high - low
            self._left = None

    @property
    def is_double(self) -> bool:
        """Tell whether the sample indices told go to and fro, as those of two nodes with one number do."""
        return self._back >= BACK_LEAST and self._back * BACK_SHARE >= self._indices

    def go_on(self) -> None:
        """Note that the node goes on sending: a goodbye before was none."""
        self._goodbyes.clear()

    @property
    def stopped(self) -> bool:
        """Tell whether the node has ended its stream on purpose."""
        needed = 1 if self._garbling.closed else GOODBYES
        return max(self._goodbyes.values(), default=0) >= needed

    @property
    def flags(self) -> int:
        """Return the newest flags that are believed: on a quiet bus, or told twice running."""
        told = list(self._flags)
        for i in range(len(told) - 1, -1, -1):
            if self._garbling.quiet_at(told[i][1]) or (i > 0 and told[i - 1][0] == told[i][0]):
                return told[i][0]
        return 0

    @property
    def counters(self) -> dict[str, int]:
        """Return the newest value of each counter that is believed: on a quiet bus, or in between its neighbours."""
        for name, told in self._items.items():
            for i in range(len(told) - 1, -1, -1):
                value, place = told[i]
                between = 0 < i < len(told) - 1 and _grows(told[0][0], told[i - 1][0], value, told[i + 1][0])
                if between or self._garbling.quiet_at(place):
                    self._told[name] = value
                    break
        return dict(self._told)

    def newest_index(self) -> int | None:
        """Return the sample index told last, believed or not."""
        told = self._items.get(health_names()[0])
        return told[-1][0] if told else None


def _grows(oldest: int, before: int, value: int, after: int) -> bool:
    """Tell whether a counter (modulo 2^32) goes up over three messages, and not much faster than it did before."""
    step, span, usual = ((b - a) % (1 << 32) for a, b in ((before, value), (before, after), (oldest, before)))
    return step <= span <= GROWTH * min(usual, 1 << 24) + GROWTH_FREE
