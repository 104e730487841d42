"""Convert between messages of python-can and batches of frames, one for all interfaces and log formats."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aeolid.can.wire import ERROR, EXTENDED, FAST, FD, GARBLED, REMOTE, Frames

PASSIVE = 8  # further flag of a frame: its sender is error passive (ESI)
DATED_MAX_S = float(1 << 33)  # a time before 1970 or from here on is none: files hold nanoseconds in 63 bits
# Logs keep frames only, and none of their formats has another kind in which text that was no frame could stand. A
# remote frame of the highest identifier marks its place, on a channel that no bus has. A true remote frame of this
# identifier is written on the channel before it; on the first channel it is the mark of this tool's older logs.
MARKER = 0x1FFFFFFF
MARK_CHANNEL, TRUE_CHANNEL = 254, 253
_MARKS = (MARK_CHANNEL, f"can{MARK_CHANNEL}", 0, "vcan0", None)  # as the formats bring the channels back
_WIDTHS = (8, 64)


def pack_messages(messages: Sequence[Any]) -> Frames:
    """Build a batch from messages of python-can, with their time stamps; one that can be no date is NaN.

    A message whose data do not have the length it announces (a line cut short) counts as text that was no frame.
    """
    count = len(messages)
    flags = np.fromiter(map(_flags, messages), np.uint8, count)
    length = np.fromiter((len(m.data) for m in messages), np.uint8, count)
    width = _WIDTHS[bool((length > _WIDTHS[0]).any())]
    data = b"".join(bytes(m.data).ljust(width, b"\0") for m in messages)
    broken = flags & (ERROR | GARBLED) != 0
    ids = np.fromiter((m.arbitration_id & 0x1FFFFFFF for m in messages), np.uint32, count)
    table = np.frombuffer(data, np.uint8).reshape(count, width)
    if broken.any():
        ids, length, table = np.where(broken, 0, ids), np.where(broken, 0, length), np.where(broken[:, None], 0, table)
    stamps = np.fromiter((m.timestamp for m in messages), np.float64, count)
    stamps = np.where((stamps >= 0.0) & (stamps < DATED_MAX_S), stamps, np.nan)
    return Frames(ids.astype(np.uint32), flags, length.astype(np.uint8), table.astype(np.uint8, copy=False), stamps)


def _flags(m: Any) -> int:
    if m.is_error_frame:
        return ERROR
    flags: int = EXTENDED * m.is_extended_id
    if m.is_remote_frame:
        is_mark = m.arbitration_id == MARKER and m.is_extended_id and m.channel in _MARKS
        return GARBLED if is_mark else flags | REMOTE
    if len(m.data) != m.dlc:
        return GARBLED
    flags |= FD * m.is_fd | FAST * m.bitrate_switch | PASSIVE * m.error_state_indicator
    return flags


def unpack_messages(frames: Frames) -> Iterator[Any]:
    """Yield messages of python-can; a frame without a time stamp gets 0."""
    from can import Message

    stamps = np.maximum(np.nan_to_num(frames.time_s), 0.0)  # a negative one makes a log that no reader takes
    columns = (frames.id, frames.flags, frames.length, frames.data, stamps)
    for i, f, n, d, t in zip(*(c.tolist() for c in columns[:3]), columns[3], columns[4].tolist(), strict=True):
        if f & ERROR:
            yield Message(timestamp=t, is_error_frame=True)
        elif f & GARBLED:
            yield Message(
                timestamp=t, arbitration_id=MARKER, is_extended_id=True, is_remote_frame=True, channel=MARK_CHANNEL
            )  # fmt: skip
        elif f & REMOTE:
            extended = bool(f & EXTENDED)
            channel = TRUE_CHANNEL if i == MARKER and extended else None
            yield Message(
                timestamp=t, arbitration_id=i, is_extended_id=extended, is_remote_frame=True, channel=channel
            )  # fmt: skip
        else:
            yield Message(
                timestamp=t, arbitration_id=i, is_extended_id=bool(f & EXTENDED), is_fd=bool(f & FD),
                bitrate_switch=bool(f & FAST), error_state_indicator=bool(f & PASSIVE), data=d[:n].tobytes(),
            )  # fmt: skip


def split_errors(frames: Frames) -> Frames:
    """Return the data frames alone; texts among them that were no frame are counted."""
    other = frames.flags & (REMOTE | ERROR | GARBLED)
    if not other.any():
        return frames
    garbled = int(np.count_nonzero(other & GARBLED))
    return replace(frames.take(other == 0), garbled=frames.garbled + garbled)


def garbled_frames(count: int) -> Frames:
    """Return what stands for so many texts that were no frame, without a time."""
    none = np.zeros(count, np.uint8)
    stamps = np.full(count, np.nan)
    return Frames(none.astype(np.uint32), none + np.uint8(GARBLED), none, np.zeros((count, 8), np.uint8), stamps)
