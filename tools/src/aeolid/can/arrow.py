"""Convert batches of frames to Arrow columns and back: for logs in Parquet, and for the spools of others."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.can.wire import GARBLED, Frames
from aeolid.formats.parquet import FRAMES_COLUMNS, FRAMES_MARK

_NOTE = "flags: 1 29-bit identifier, 2 CAN FD, 4 bit rate switched, 8 error passive, 16 remote, 32 error, 64 no frame"


def frames_schema() -> Any:
    """Return the columns: timestamp (ns, UTC), id, flags, data."""
    import pyarrow as pa

    types = (pa.timestamp("ns", tz="UTC"), pa.uint32(), pa.uint8(), pa.binary())
    fields = [pa.field(name, kind) for name, kind in zip(FRAMES_COLUMNS, types, strict=True)]
    return pa.schema(fields, metadata={FRAMES_MARK: json.dumps(1), b"note": _NOTE})


def to_batch(frames: Frames) -> Any:
    """Convert frames (n) to a record batch."""
    import pyarrow as pa

    stamps = np.rint(np.nan_to_num(frames.time_s) * 1e9).astype(np.int64)
    inside = np.arange(frames.data.shape[1])[None, :] < frames.length[:, None]
    offsets = np.concatenate([[0], np.cumsum(inside.sum(axis=1))]).astype(np.int32)
    flat = np.ascontiguousarray(frames.data[inside])
    data = pa.Array.from_buffers(pa.binary(), len(frames), [None, pa.py_buffer(offsets), pa.py_buffer(flat)])
    columns = [
        pa.array(stamps, pa.timestamp("ns", tz="UTC"), mask=np.isnan(frames.time_s)),
        pa.array(frames.id),
        pa.array(frames.flags),
        data,
    ]
    return pa.RecordBatch.from_arrays(columns, schema=frames_schema())


def from_columns(stamps: Any, ids: Any, flags: Any, data: Any) -> Frames:
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


def read_spool(path: Path) -> Iterator[Frames]:
    """Yield the batches of a spool; raises ValueError or OSError where it was cut within one."""
    from pyarrow import ipc

    with open(path, "rb") as handle, ipc.open_stream(handle) as stream:
        for batch in stream:
            yield from_columns(*(batch.column(i) for i in range(len(FRAMES_COLUMNS))))
