"""Hold the frames of a log whose directory comes last in a spool that is readable at any moment, until it is closed."""

from __future__ import annotations

import io
import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aeolid.can.arrow import frames_schema, read_spool, to_batch
from aeolid.can.compact import merge_tail
from aeolid.can.leftover import lock, spool_of
from aeolid.can.wire import Frames, join_frames
from aeolid.formats.spare import SPARE, SpareFile
from aeolid.output import create

CHUNK = 1 << 16  # frames of a part
SPOOL_CHUNK = 1 << 12  # frames of a batch of it


class ChunkedLog(ABC):
    """Append frames to the spool NAME.part.arrows every second, and write the log from it when it is closed."""

    def __init__(self, path: Path, spool: Path | None = None) -> None:
        """Create the spool, under its own name or another. Raises OSError."""
        from pyarrow import ipc

        self.path = path
        self.frames = 0
        self.full = False
        self._held: list[Frames] = []
        self._count = 0
        os.close(create(path))  # a place that cannot be written to, or another's file, is told now
        path.unlink()
        self.spool = spool or spool_of(path)
        self._raw = SpareFile(self.spool)
        lock(self._raw.fileno())
        self._file = io.BufferedWriter(self._raw, 1 << 16)
        self._stream: Any = ipc.new_stream(self._file, frames_schema())
        self._file.flush()

    def write(self, frames: Frames) -> None:
        """Add frames, in the order of arrival."""
        if not len(frames):
            return
        self._held.append(frames)
        merge_tail(self._held, join_frames)
        self._count += len(frames)
        if self._count >= SPOOL_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Put what is held on the disk."""
        held, self._held, self._count = self._held, [], 0
        if held:
            frames = join_frames(held)
            self._stream.write_batch(to_batch(frames))
            self._file.flush()
            self.frames += len(frames)
            room = shutil.disk_usage(self.path.parent).free
            self.full = self._raw.full or room < self._raw.tell() + 2 * SPARE

    def close(self) -> None:
        """Write the log, then remove the spool. Raises OSError; the spool is kept then."""
        self.flush()
        self._stream.close()
        self._file.close()
        self._open()
        for frames in self._parts():
            self._put(frames)
        self._finish()
        self.spool.unlink()

    def _parts(self) -> Iterator[Frames]:
        """Yield what is in the spool in parts of about 65,536 frames."""
        held: list[Frames] = []
        count = 0
        for frames in read_spool(self.spool):
            held.append(frames)
            count += len(frames)
            if count >= CHUNK:
                yield join_frames(held)
                held, count = [], 0
        if held:
            yield join_frames(held)

    @abstractmethod
    def _open(self) -> None:
        """Begin the log."""

    @abstractmethod
    def _put(self, frames: Frames) -> None:
        """Write one part."""

    @abstractmethod
    def _finish(self) -> None:
        """End the file."""
