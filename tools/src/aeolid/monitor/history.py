"""Remember a run of any length in so many rows: the newest as they came, the whole run ever more coarsely."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Row = TypeVar("Row")


def newer(_: Row, row: Row) -> Row:
    """Merge two rows into the newer one."""
    return row


class History(Generic[Row]):
    """Keep at most `recent` + `whole` rows, whatever the time.

    Rows 0 … count − 1 have been pushed. The newest `recent` are kept as they are. Beside them stand groups of `stride`
    rows merged into one, from the first row on; whenever there are `whole` of them, neighbours are merged and the
    stride is doubled. So after n rows the stride is the least power of two s with ⌊n/s⌋ < whole.
    """

    def __init__(self, recent: int, whole: int, merge: Callable[[Row, Row], Row] = newer) -> None:
        """Prepare. whole: even; merge: makes one row of two neighbours, the older first, no larger than either."""
        self.count, self.stride = 0, 1
        self._most, self._merge = whole, merge
        self._recent: deque[Row] = deque(maxlen=recent)
        self._groups: list[Row] = []
        self._open: Row | None = None  # of a group that is not full yet
        self._filled = 0

    def __len__(self) -> int:
        """Return how many rows are held, the open group among them."""
        return len(self._recent) + len(self._groups) + (self._open is not None)

    def push(self, row: Row) -> None:
        """Take a row."""
        self.count += 1
        self._recent.append(row)
        self._open = row if self._open is None else self._merge(self._open, row)
        self._filled += 1
        if self._filled < self.stride:
            return
        self._groups.append(self._open)
        self._open, self._filled = None, 0
        if len(self._groups) >= self._most:
            pairs = zip(self._groups[::2], self._groups[1::2], strict=True)
            self._groups = [self._merge(older, row) for older, row in pairs]
            self.stride *= 2

    def rows(self) -> list[Row]:
        """Return the groups that are older than the newest rows, then these."""
        first = self.count - len(self._recent)
        return self._groups[: first // self.stride] + list(self._recent)

    def since(self, count: int) -> tuple[bool, list[Row]]:
        """Return what came after the first `count` rows, and whether that is a fresh start: all rows there are."""
        missing = self.count - count
        if count <= 0 or not 0 <= missing <= len(self._recent):
            return True, self.rows()
        return False, list(self._recent)[len(self._recent) - missing :]
