"""Hold frames back until there are enough for a part of a log whose format is written in large parts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

from aeolid.can.wire import Frames, join_frames

CHUNK = 1 << 16  # frames of a part
_LOOSE = 1 << 10  # batches that are held one by one before they are joined


class ChunkedLog(ABC):
    """Collect batches and hand them on in parts of 65,536 frames, the last one when the log is closed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.frames = 0
        self.full = False
        self._held: list[Frames] = []
        self._count = 0

    def write(self, frames: Frames) -> None:
        """Add frames, in the order of arrival."""
        if not len(frames):
            return
        self._held.append(frames)
        self._count += len(frames)
        if self._count >= CHUNK:
            self._flush()
        elif len(self._held) >= _LOOSE:
            self._held = [join_frames(self._held)]

    def close(self) -> None:
        """Write what is held and complete the file."""
        self._flush()
        self._finish()

    def _flush(self) -> None:
        held, self._held, self._count = self._held, [], 0
        if held:
            frames = join_frames(held)
            self._put(frames)
            self.frames += len(frames)

    @abstractmethod
    def _put(self, frames: Frames) -> None:
        """Write one part."""

    @abstractmethod
    def _finish(self) -> None:
        """End the file."""
