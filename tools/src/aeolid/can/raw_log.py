"""Write raw CAN logs: every frame that an interface delivered, in a format that other tools read."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from aeolid.can.arrow import frames_schema, to_batch
from aeolid.can.chunks import CHUNK, ChunkedLog
from aeolid.can.messages import unpack_messages
from aeolid.can.raw_mf4 import Mf4Log
from aeolid.can.wire import Frames
from aeolid.errors import UsageError
from aeolid.formats.parquet import WRITTEN
from aeolid.formats.spare import SpareFile

RAW_SUFFIXES = (".mf4", ".blf", ".asc", ".log", ".parquet")


class RawLog(Protocol):
    """Take frames; `full` turns true when the disk has no room left: then close, what was taken is in the file."""

    @property
    def path(self) -> Path:
        """Return where the log is written."""

    @property
    def frames(self) -> int:
        """Return how many frames are in it."""

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""

    def write(self, frames: Frames) -> None:
        """Add frames, in the order of arrival."""

    def flush(self) -> None:
        """Put what was added on the disk, so that it is there whatever becomes of this process."""

    def close(self) -> None:
        """Complete the file."""


def open_raw_log(path: Path, spool: Path | None = None) -> RawLog:
    """Create a log in the format that its suffix names; one that an earlier run wrote is replaced.

    spool: where a Parquet or MDF4 log grows, instead of NAME.part.arrows. Raises UsageError on another suffix
    or a place that cannot be written to.
    """
    suffix = path.suffix.lower()
    if suffix not in RAW_SUFFIXES:
        raise UsageError(f"{path}: the suffix is none of {', '.join(RAW_SUFFIXES)}")
    try:
        if suffix == ".parquet":
            return ParquetLog(path, spool)
        return Mf4Log(path, spool) if suffix == ".mf4" else MessageLog(path, suffix)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror or error})") from None


class MessageLog:
    """Write BLF (Vector), ASC (Vector) or candump -L text with the writers of python-can."""

    def __init__(self, path: Path, suffix: str) -> None:
        import can

        self.path = path
        self.frames = 0
        self._raw = SpareFile(path)
        self._file: Any = io.BufferedWriter(self._raw, 1 << 16)
        writers: dict[str, Callable[[Any], Any]] = {
            ".blf": can.BLFWriter, ".asc": can.ASCWriter, ".log": can.CanutilsLogWriter
        }  # fmt: skip
        if suffix != ".blf":
            self._file = io.TextIOWrapper(self._file, encoding="utf-8", newline="\n")
        self._writer = writers[suffix](self._file)

    @property
    def full(self) -> bool:
        """Tell whether the room kept for an orderly end is in use."""
        return self._raw.full

    def write(self, frames: Frames) -> None:
        """Add frames; text reaches the disk at once, BLF by containers of 128 kB."""
        for message in unpack_messages(frames):
            self._writer.on_message_received(message)
        self.frames += len(frames)
        self._file.flush()

    def flush(self) -> None:
        """End the container of a BLF that is under way; text is on the disk already."""
        if hasattr(self._writer, "_flush"):
            self._writer._flush()
            self._file.flush()

    def close(self) -> None:
        """Write what the format ends with and close."""
        self._writer.stop()
        self._raw.close()


class ParquetLog(ChunkedLog):
    """Write Parquet: timestamp (ns, UTC), id, flags, data."""

    def _open(self) -> None:
        from pyarrow import parquet

        self._schema = frames_schema()
        self._target = io.BufferedWriter(SpareFile(self.path), 1 << 16)
        self._writer = parquet.ParquetWriter(self._target, self._schema, compression="zstd", **WRITTEN)

    def _put(self, frames: Frames) -> None:
        import pyarrow as pa

        table = pa.Table.from_batches([to_batch(frames)], schema=self._schema)
        self._writer.write_table(table, row_group_size=CHUNK)

    def _finish(self) -> None:
        self._writer.close()
        self._target.close()
