"""Remember where on a bus something was garbled: what only a CRC-8 vouches for is not believed near to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.int64]
MARGIN = 4096  # frames before and after a garbled one in which others may be garbled unseen
STRETCHES_MAX = 1 << 14  # kept; the oldest are forgotten, what lay in them has been judged long ago


class Garbling:
    """Count the frames of a bus and hold the stretches of them that are not quiet.

    frames: so many have come; closed: no more will.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.closed = False
        self._start = np.zeros(0, np.int64)  # disjoint stretches in order
        self._stop = np.zeros(0, np.int64)

    def add(self, places: Places) -> None:
        """Note garbled frames by their places (n,)."""
        self._merge(places - MARGIN, places + MARGIN)

    def add_stretch(self, first: int, last: int) -> None:
        """Note that something was garbled between two frames."""
        self._merge(np.array([first - MARGIN]), np.array([last + MARGIN]))

    def _merge(self, start: Places, stop: Places) -> None:
        if not len(start):
            return
        early = int(np.searchsorted(self._stop, start.min()))  # what ended before lies apart from what is new
        start, stop = np.append(self._start[early:], start), np.append(self._stop[early:], stop)
        order = np.argsort(start, kind="stable")
        start, stop = start[order], np.maximum.accumulate(stop[order])
        first = np.append(True, start[1:] > stop[:-1])  # begins a stretch of its own
        self._start = np.append(self._start[:early], start[first])[-STRETCHES_MAX:]
        self._stop = np.append(self._stop[:early], stop[np.append(first[1:], True)])[-STRETCHES_MAX:]

    def is_quiet(self, first: Places, last: Places) -> NDArray[np.bool_]:
        """Tell for spans of frames first … last (n,) whether nothing garbled is known near to them."""
        before = np.searchsorted(self._start, last, side="right") - 1  # the last stretch that begins before the end
        quiet = np.ones(len(first), bool)
        some = before >= 0
        quiet[some] = self._stop[before[some]] < first[some]
        return quiet

    def quiet_at(self, place: int) -> bool:
        """Tell the same of one frame."""
        return bool(self.is_quiet(np.array([place]), np.array([place]))[0])
