"""Take the frames out of raw CAN logs with the libraries that know their formats; everything here runs confined."""

from __future__ import annotations

import json
import sys
from collections.abc import Generator, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

from aeolid.can.arrow import from_columns, read_spool
from aeolid.can.damage import find_damage
from aeolid.can.messages import pack_messages
from aeolid.can.wire import Frames
from aeolid.confined import Reply
from aeolid.display import token, without_quotes
from aeolid.errors import DataError
from aeolid.formats.mdf_blocks import forbid_formulas, open_mdf, refuse_formulas
from aeolid.formats.parquet import FRAMES_COLUMNS, FRAMES_MARK

BATCH = 4096
_FRAMES, _FRAMES_PER_BYTE = 1 << 16, 32  # zlib packs at most 1032 times, and an object of BLF takes 32 bytes


def send_frames(path: str, source: str) -> Generator[Reply, None, None]:
    """Send the frames of a log batch by batch, then what is wrong with it: `failed`, `damage`, None where nothing is.

    A log that cannot be read at all raises what its reader raises.
    """
    batches = _batches_of(path, source)
    count, failed, most = 0, None, _FRAMES + _FRAMES_PER_BYTE * Path(path).stat().st_size
    while True:
        try:
            frames = next(batches, None)
        except (DataError, MemoryError):
            raise
        except Exception as error:  # a log cut short: what came before is kept; each reader raises its own kinds
            if count == 0:
                raise
            failed = reason_of(error)
            break
        if frames is None:
            break
        count += len(frames)
        if count > most:
            raise DataError(f"{source}: it holds more frames than a file of its size can; its objects go in a circle")
        yield {"garbled": frames.garbled}, {k: getattr(frames, k) for k in ("id", "flags", "length", "data", "time_s")}
    yield {"failed": failed, "damage": _damage(Path(path), count)}, {}


def reason_of(error: Exception) -> str:
    """Return what an error says, in one line and without what it quotes of a file."""
    return token(without_quotes(" ".join(str(error).split())), 200) or type(error).__name__


def _damage(path: Path, count: int) -> str | None:
    try:
        return find_damage(path, count)
    except Exception as error:  # readers of a damaged file raise anything
        return reason_of(error)


def _batches_of(path: str, source: str) -> Iterator[Frames]:
    if path.lower().endswith(".arrows"):  # the spool of a log whose recorder was killed
        return read_spool(Path(path))
    return _parquet(path, source) if path.lower().endswith(".parquet") else _by_python_can(path, source)


def _by_python_can(path: str, source: str) -> Iterator[Frames]:
    """Yield batches of a log that one of python-can's readers knows; those before a damaged place come whole."""
    if path.lower().endswith(".mf4"):
        with open_mdf(path) as file:
            refuse_formulas(source, file)
    else:
        forbid_formulas()
        sys.modules["asammdf"] = None  # type: ignore[assignment] # python-can would load it for other files too: 1.5 s
    import can

    options = {"relative_timestamp": False} if path.lower().endswith(".asc") else {}
    return _batches(can.LogReader(path, **options))


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


def _parquet(path: str, source: str) -> Iterator[Frames]:
    from pyarrow import parquet

    file = parquet.ParquetFile(path, page_checksum_verification=True)
    if FRAMES_MARK not in (file.schema_arrow.metadata or {}) or tuple(file.schema_arrow.names) != FRAMES_COLUMNS:
        file.close()
        raise DataError(
            f"{source}: no raw CAN frames in this Parquet file (columns {', '.join(file.schema_arrow.names[:8])});"
            f" if it is a recording, give it to the other commands as it stands"
        )
    version = json.loads(file.schema_arrow.metadata[FRAMES_MARK])
    if version != 1:
        raise DataError(f"{source}: frames are laid out as version {version}; this tool reads version 1")
    return _rows(file)


def _rows(file: Any) -> Iterator[Frames]:
    with file:
        for batch in file.iter_batches(batch_size=16 * BATCH):
            yield from_columns(*(batch.column(i) for i in range(len(FRAMES_COLUMNS))))
