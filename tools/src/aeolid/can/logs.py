"""Read raw CAN logs in batches, and say when one was cut short or damaged."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.can.damage import find_damage
from aeolid.can.messages import pack_messages
from aeolid.can.wire import GARBLED, Frames, no_frames
from aeolid.display import token, without_quotes
from aeolid.errors import DataError
from aeolid.formats.binary import FRAMES_COLUMNS, FRAMES_MARK
from aeolid.formats.mdf import quiet

LOG_SUFFIXES = (".blf", ".asc", ".log", ".mf4", ".parquet", ".trc", ".asc.gz", ".log.gz")
BATCH = 4096


def is_log(path: str) -> bool:
    """Tell whether a text names a log by its suffix."""
    return path.lower().endswith(LOG_SUFFIXES)


def open_log(path: str) -> LogSource:
    """Open a raw log. Raises DataError when it is none, naming the file."""
    try:
        with open(path, "rb") as handle:
            head = handle.read(8)
    except OSError as error:
        why = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise DataError(f"{path}: {why}") from None
    if not head:
        raise DataError(f"{path}: the file is empty (0 bytes); copy or export it again")
    why = ""
    with quiet() if path.lower().endswith(".mf4") else nullcontext():
        try:
            return LogSource(path, _parquet(path) if path.lower().endswith(".parquet") else _by_python_can(path))
        except DataError:
            raise
        except Exception as error:  # each reader raises its own kinds
            why = reason_of(error)
    raise DataError(f"{path}: not a CAN log that can be read: {why}")


class LogSource:
    """Deliver the frames of a log, batch by batch; `ended` is "end of file" or says how the log is damaged."""

    is_log = True

    def __init__(self, path: str, batches: Iterator[Frames]) -> None:
        self.name = path
        self.ended: str | None = None
        self.status = ""
        self.interruptions = 0
        self._batches = batches
        self._count = 0
        self._first = next(batches, None)  # what is no log at all is told when it is opened

    def read(self, timeout: float) -> Frames:
        """Return the next batch; what came before a damaged place is delivered."""
        try:
            frames = self._first if self._first is not None else next(self._batches, None)
        except Exception as error:  # a log cut short: keep what came before
            self.ended = f"damaged: {self._damage() or reason_of(error)}"
            return no_frames()
        self._first = None
        if frames is not None:
            self._count += len(frames)
            return frames
        damage = self._damage()
        self.ended = f"damaged: {damage}" if damage else "end of file"
        return no_frames()

    def _damage(self) -> str | None:
        try:
            return find_damage(Path(self.name), self._count)
        except Exception as error:  # readers of a damaged file raise anything
            return reason_of(error)

    def close(self) -> None:
        """Close the file."""
        close = getattr(self._batches, "close", None)
        if close is not None:
            close()


def _by_python_can(path: str) -> Iterator[Frames]:
    """Yield batches of a log that one of python-can's readers knows; those before a damaged place come whole."""
    import can

    options = {"relative_timestamp": False} if path.lower().endswith(".asc") else {}
    reader: Any = can.LogReader(path, **options)
    return _batches(reader)


def _batches(reader: Any) -> Iterator[Frames]:
    failure: Exception | None = None

    def guarded() -> Iterator[Any]:
        nonlocal failure
        try:
            yield from reader
        except Exception as error:
            failure = error

    messages = guarded()
    try:
        while batch := list(islice(messages, BATCH)):
            yield pack_messages(batch)
    finally:
        with suppress(Exception):
            reader.stop()
    if failure is not None:
        raise failure


def _parquet(path: str) -> Iterator[Frames]:
    from pyarrow import parquet

    file = parquet.ParquetFile(path)
    if FRAMES_MARK not in (file.schema_arrow.metadata or {}) or tuple(file.schema_arrow.names) != FRAMES_COLUMNS:
        file.close()
        raise DataError(
            f"{path}: no raw CAN frames in this Parquet file (columns {', '.join(file.schema_arrow.names[:8])});"
            f" if it is a recording, give it to the other commands as it stands"
        )
    version = json.loads(file.schema_arrow.metadata[FRAMES_MARK])
    if version != 1:
        raise DataError(f"{path}: frames are laid out as version {version}; this tool reads version 1")
    return _rows(file)


def _rows(file: Any) -> Iterator[Frames]:
    with file:
        for batch in file.iter_batches(batch_size=16 * BATCH):
            yield _unpack(*(batch.column(i) for i in range(len(FRAMES_COLUMNS))))


def _unpack(stamps: Any, ids: Any, flags: Any, data: Any) -> Frames:
    """Convert Arrow columns; data longer than a frame can be were none."""
    from pyarrow import compute

    length = np.asarray(compute.binary_length(data).fill_null(0)).astype(np.int64)
    flag = np.asarray(flags.fill_null(GARBLED)).astype(np.uint8)
    flag = np.where(length > 64, np.uint8(GARBLED), flag)
    count, width = len(flag), 64 if (length > 8).any() else 8
    table = np.zeros((count, width), np.uint8)
    offsets = np.frombuffer(data.buffers()[1], np.int32)[data.offset : data.offset + count + 1].astype(np.int64)
    flat = np.frombuffer(data.buffers()[2] or b"", np.uint8)
    at = np.arange(width)[None, :]
    inside = (at < length[:, None]) & (length <= 64)[:, None]
    table[inside] = flat[(offsets[:-1, None] + at)[inside]]
    seconds = np.asarray(stamps.cast("int64").fill_null(-1), dtype=np.float64) / 1e9
    stamp = np.where(np.asarray(stamps.is_null()), np.nan, seconds)
    length = np.where(length > 64, 0, length)
    return Frames(np.asarray(ids.fill_null(0)).astype(np.uint32), flag, length.astype(np.uint8), table, stamp)


def reason_of(error: Exception) -> str:
    """Return what an error says, in one line and without what it quotes of a file."""
    return token(without_quotes(" ".join(str(error).split())), 200) or type(error).__name__
