"""Read raw CAN logs in batches, and say when one was cut short or damaged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.can.wire import Frames, no_frames
from aeolid.confined import Failure, Running, start
from aeolid.errors import DataError
from aeolid.formats.bounds import log_limits
from aeolid.inputs import regular_size

LOG_SUFFIXES = (".blf", ".asc", ".log", ".mf4", ".parquet", ".trc", ".asc.gz", ".log.gz", ".arrows")
_LAYOUT = {"id": ("u4", 1), "flags": ("u1", 1), "length": ("u1", 1), "data": ("u1", 2), "time_s": ("f8", 1)}


def is_log(path: str) -> bool:
    """Tell whether a text names a log by its suffix."""
    return path.lower().endswith(LOG_SUFFIXES)


def open_log(path: str) -> LogSource:
    """Open a raw log; its reader runs confined. Raises DataError when it is none, naming the file."""
    if regular_size(path) == 0:
        raise DataError(f"{path}: the file is empty (0 bytes); copy or export it again")
    asked = {"path": str(Path(path).absolute()), "source": path}
    running = start("aeolid.can.log_frames:send_frames", asked, log_limits(path))
    try:
        return LogSource(path, running)
    except BaseException as error:
        running.close()
        if isinstance(error, Failure):
            raise DataError(f"{path}: not a CAN log that can be read: {error}") from None
        raise


class LogSource:
    """Deliver the frames of a log, batch by batch; `ended` is "end of file" or says how the log is damaged."""

    is_log = True

    def __init__(self, path: str, running: Running) -> None:
        """Take the first batch: what is no log at all is told when it is opened."""
        self.name = path
        self.ended: str | None = None
        self.status = ""
        self.interruptions = 0
        self._running = running
        self._damage: str | None = None
        self._batches = self._receive()
        self._first = next(self._batches, None)

    def read(self, timeout: float) -> Frames:
        """Return the next batch; what came before a damaged place is delivered."""
        try:
            frames = self._first if self._first is not None else next(self._batches, None)
        except (Failure, DataError) as error:  # a log cut short: keep what came before
            self._damage, frames = str(error), None
        self._first = None
        if frames is not None:
            return frames
        self.ended = f"damaged: {self._damage}" if self._damage else "end of file"
        self._running.close()
        return no_frames()

    def _receive(self) -> Iterator[Frames]:
        for facts, arrays in self._running:
            if "damage" in facts:
                self._damage = str(facts["damage"] or facts["failed"] or "") or None
            else:
                yield _frames(arrays, facts.get("garbled"))

    def close(self) -> None:
        """Close the file."""
        self._running.close()


def _frames(arrays: dict[str, Any], garbled: Any) -> Frames:
    """Check what the confined reader sent before it is taken for frames."""
    count = len(arrays["id"]) if arrays.keys() == _LAYOUT.keys() and arrays["id"].ndim == 1 else -1
    fits = count >= 0 and all(
        arrays[name].dtype == np.dtype(kind) and arrays[name].ndim == axes and len(arrays[name]) == count
        for name, (kind, axes) in _LAYOUT.items()
    )
    if not fits or arrays["data"].shape[1] not in (8, 64) or np.any(arrays["length"] > arrays["data"].shape[1]):
        raise Failure("the process that reads it sent nonsense")
    return Frames(**arrays, garbled=garbled if type(garbled) is int and garbled >= 0 else 0)
