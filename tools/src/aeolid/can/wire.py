"""Decode frames of the wire in bulk; aeolid.dbc is the reference, a test holds this module to it bit for bit."""

from __future__ import annotations

import sysconfig
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid.errors import UsageError

WIRE_VERSION = 1
BASE = 0x1CFF4000  # AEO_FRAME_BASE_EXTENDED
NODES = 254
HEALTH, DESCRIPTION, SAMPLE, INNOVATION, BEGIN, PARAMETER, REPAIR, END = range(8)
KINDS = 8
EXTENDED, FD, FAST = 1, 2, 4  # flags of a frame: 29-bit identifier, CAN FD, its data phase at the fast rate
STOPPED = 0x8000  # flag of a health message: the node has ended its stream on purpose

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Frames:
    """Hold frames in the order of arrival: id, flags, length, time_s (n,), data (n, 8), or (n, 64) when one is longer.

    flags: EXTENDED, FD, FAST; length: bytes of data that count, zeros follow; time_s: host time, NaN where unknown.
    garbled: texts among them that were no frame at all.
    """

    id: Words
    flags: Bytes
    length: Bytes
    data: Bytes
    time_s: NDArray[np.float64]
    garbled: int = 0

    def __len__(self) -> int:
        return len(self.id)

    def take(self, chosen: NDArray[Any]) -> Frames:
        """Return the frames that a mask or an index array chooses; garbled stays."""
        id_, flags, length = self.id[chosen], self.flags[chosen], self.length[chosen]
        return Frames(id_, flags, length, self.data[chosen], self.time_s[chosen], self.garbled)


@dataclass(frozen=True, eq=False)
class Messages:
    """Hold decoded messages, all arrays (n,), in the order of arrival; value is a bit pattern.

    foreign: frames of somebody else; damaged: frames whose check is wrong.
    """

    node: Bytes
    kind: Bytes
    tag: Bytes
    index: NDArray[np.uint16]
    value: Words
    foreign: int = 0
    damaged: int = 0

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, chosen: NDArray[Any]) -> Messages:
        """Return the messages that a mask or an index array chooses, without the counts."""
        return Messages(self.node[chosen], self.kind[chosen], self.tag[chosen], self.index[chosen], self.value[chosen])


def no_frames(garbled: int = 0) -> Frames:
    """Return an empty batch."""
    return pack_frames((), garbled)


def pack_frames(
    rows: Sequence[tuple[int, bool, bytes]],
    garbled: int = 0,
    *,
    times_s: Sequence[float] | None = None,
    flags: Sequence[int] | None = None,
) -> Frames:
    """Build a batch from (identifier, extended, data) one by one.

    times_s (n,): host times. flags (n,): all of them; without, more than eight bytes make a frame of CAN FD.
    """
    count = len(rows)
    width = 64 if any(len(d) > 8 for _, _, d in rows) else 8
    data = b"".join(d.ljust(width, b"\0") for _, _, d in rows)
    if flags is None:
        flags = [EXTENDED * extended | (FD | FAST) * (len(d) > 8) for _, extended, d in rows]
    return Frames(
        np.fromiter((i for i, _, _ in rows), np.uint32, count),
        np.fromiter(flags, np.uint8, count),
        np.fromiter((len(d) for _, _, d in rows), np.uint8, count),
        np.frombuffer(data, np.uint8).reshape(count, width),
        np.full(count, np.nan) if times_s is None else np.fromiter(times_s, np.float64, count),
        garbled,
    )


def join_frames(parts: Sequence[Frames]) -> Frames:
    """Put batches together, in order."""
    if not parts:
        return no_frames()
    width = max(p.data.shape[1] for p in parts)
    return Frames(
        np.concatenate([p.id for p in parts]),
        np.concatenate([p.flags for p in parts]),
        np.concatenate([p.length for p in parts]),
        np.concatenate([np.pad(p.data, ((0, 0), (0, width - p.data.shape[1]))) for p in parts]),
        np.concatenate([p.time_s for p in parts]),
        sum(p.garbled for p in parts),
    )


def decode(frames: Frames, base: int = BASE) -> Messages:
    """Decode a batch: identifier, check, fields.

    Frames of other systems and damaged ones are counted and left out. Cost: about 0.2 µs a frame in large batches.
    """
    offset = frames.id - np.uint32(base)  # wraps far above the limit when the identifier is below the base
    node, kind = offset & np.uint32(0xFF), offset >> np.uint32(8)
    ours = (
        (kind < KINDS) & (node < NODES) & (frames.id < 1 << 29) & (frames.flags & EXTENDED > 0) & (frames.length == 8)
    )
    node, kind, data = node[ours], kind[ours], frames.data[ours, :8]
    sound = _check(np.uint32(base) + (kind << np.uint32(8)), data, 8) == data[:, 3]
    data = np.ascontiguousarray(data[sound])
    return Messages(
        node[sound].astype(np.uint8),
        kind[sound].astype(np.uint8),
        data[:, 0],
        data[:, 1:3].copy().view("<u2")[:, 0],
        data[:, 4:8].copy().view("<u4")[:, 0],
        int(len(ours) - np.count_nonzero(ours)),
        int(len(sound) - np.count_nonzero(sound)),
    )


def _check_table() -> Bytes:
    rows = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x2F if crc & 0x80 else 0)) & 0xFF
        rows.append(crc)
    return np.array(rows, np.uint8)


_TABLE = _check_table()


def _check(identifier: Words, data: Bytes, length: int) -> Bytes:
    """Compute the CRC-8 of frame.h over identifier without node, length and all bytes but the check."""
    crc = np.full(len(identifier), 0xFF, np.uint8)
    for shift in (0, 8, 16, 24):
        crc = _TABLE[crc ^ ((identifier >> np.uint32(shift)) & np.uint32(0xFF)).astype(np.uint8)]
    crc = _TABLE[crc ^ np.uint8(length)]
    for i in range(length):
        if i != 3:
            crc = _TABLE[crc ^ data[:, i]]
    result: Bytes = crc ^ np.uint8(0xFF)
    return result


def encode(node: int, kind: int, tag: int, index: int, value: int, base: int = BASE) -> tuple[int, bytes]:
    """Build one classic frame: identifier and eight bytes. The tool sends nothing; tests and simulators do."""
    data = np.zeros((1, 8), np.uint8)
    data[0, 0], data[0, 1], data[0, 2] = tag, index & 0xFF, index >> 8
    data[0, 4:] = np.frombuffer(np.uint32(value).astype("<u4").tobytes(), np.uint8)
    identifier = base + (kind << 8)
    data[0, 3] = _check(np.array([identifier], np.uint32), data, 8)[0]
    return identifier + node, data.tobytes()


def find_dbc() -> Path:
    """Return the path of aeolid.dbc: in a checkout tools/aeolid.dbc, else the copy installed with the package."""
    places = [Path(__file__).resolve().parents[3] / "aeolid.dbc"]
    places += [Path(p) / "_native" / "aeolid.dbc" for p in aeolid.__path__]
    places += [Path(sysconfig.get_path("platlib")) / "aeolid" / "_native" / "aeolid.dbc"]
    for place in places:
        if place.is_file():
            return place
    raise UsageError(f"aeolid.dbc is in none of {', '.join(map(str, places))}; install the package again")


@lru_cache(maxsize=1)
def load_dbc() -> Any:
    """Load aeolid.dbc with cantools."""
    from cantools import database

    return database.load_file(str(find_dbc()))


@lru_cache(maxsize=1)
def health_names() -> dict[int, str]:
    """Return the names of the health items by their number, from the DBC."""
    item = load_dbc().get_message_by_name("AEO_Health").get_signal_by_name("Item")
    return {int(number): str(name) for number, name in item.choices.items()}
