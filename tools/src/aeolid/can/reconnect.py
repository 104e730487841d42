"""Keep a bus that breaks off: open it again with growing pauses, and say so while it is away."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from aeolid.can.wire import Frames, no_frames
from aeolid.errors import DataError

PAUSE_FIRST_S, PAUSE_MAX_S = 0.5, 15.0


class _Bus(Protocol):
    ended: str | None

    @property
    def overrun(self) -> int:
        """Return how many frames were dropped."""

    def read(self, timeout: float) -> Frames:
        """Return what has arrived."""

    def close(self) -> None:
        """Let go of the bus."""


class ReconnectingSource:
    """Read a bus, and open it anew whenever it breaks off; it never ends by itself.

    The pause between two attempts doubles from 0.5 to 15 s, and starts small again only after frames have come: an
    interface that opens but is down (ENETDOWN) is not tried in haste. away_s: how long no bus was open, in all.
    """

    is_log = False
    ended: str | None = None

    def __init__(self, name: str, connect: Callable[[], _Bus]) -> None:
        """Open the bus for the first time. Raises DataError when that fails: its name may be wrong."""
        self.name = name
        self.interruptions = 0
        self.away_s = 0.0
        self._connect = connect
        self._bus: _Bus | None = connect()
        self._pause = PAUSE_FIRST_S
        self._next = self._since = 0.0
        self._why = ""
        self._dropped = 0

    @property
    def status(self) -> str:
        """Say why there is no bus now and when the next attempt is due; empty while there is one."""
        if self._bus is not None:
            return ""
        now = time.monotonic()
        due = max(0.0, self._next - now)
        return f"no bus for {now - self._since:.0f} s ({self._why}); next attempt in {due:.0f} s"

    @property
    def overrun(self) -> int:
        """Return how many frames the interface says it has dropped, over all times it was open."""
        return self._dropped + (0 if self._bus is None else self._bus.overrun)

    def read(self, timeout: float) -> Frames:
        """Return what has arrived, waiting up to `timeout` seconds; while the bus is away, try to open it."""
        if self._bus is None and not self._try(timeout):
            return no_frames()
        assert self._bus is not None
        frames = self._bus.read(timeout)
        if len(frames):
            self._pause = PAUSE_FIRST_S
        if self._bus.ended is not None:
            self._lose(self._bus.ended)
        return frames

    def _lose(self, why: str) -> None:
        assert self._bus is not None
        self._dropped += self._bus.overrun
        self._bus.close()
        self._bus, self._why = None, why
        self.interruptions += 1
        self._since = time.monotonic()
        self._delay()

    def _delay(self) -> None:
        self._next = time.monotonic() + self._pause
        self._pause = min(2 * self._pause, PAUSE_MAX_S)

    def _try(self, timeout: float) -> bool:
        wait = self._next - time.monotonic()
        if wait > 0:
            time.sleep(min(wait, timeout))
            if wait > timeout:
                return False
        try:
            self._bus = self._connect()
        except DataError as error:
            self._why = str(error).removeprefix(f"{self.name}: ")
            self._delay()
            return False
        self.away_s += time.monotonic() - self._since
        return True

    def close(self) -> None:
        """Close the bus."""
        if self._bus is not None:
            self._bus.close()
