"""Find out whether a raw CAN log is whole: python-can reads a log that was cut short without a word."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

_BLF_HEAD = struct.Struct("<4sL8xQQLL")  # signature, header size, file size, uncompressed size, objects, objects read
_BLF_OBJECT = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, type
_TAIL, _HEAD, _PART = 1 << 12, 1 << 16, 1 << 20


def find_damage(path: Path, frames: int) -> str | None:
    """Say how a log that could be read to its end is damaged, None when it is whole.

    frames: how many were read. Cost: BLF one seek for each container (128 kB of frames), of a packed text all
    of it, else the file's two ends.
    """
    name = path.name.lower()
    if name.endswith(".blf"):
        return _blf(path)
    if name.endswith((".asc", ".log", ".trc", ".gz")):
        head, tail = _both_ends(path)
        return _asc(head, tail) if name.removesuffix(".gz").endswith(".asc") else _text_end(tail)
    return _mf4(path, frames) if name.endswith(".mf4") else None


def _blf(path: Path) -> str | None:
    """Follow the containers to the end of the file, then compare its size with the one in the header."""
    size = path.stat().st_size
    with open(path, "rb") as handle:
        _, position, told, _, objects, _ = _BLF_HEAD.unpack(handle.read(_BLF_HEAD.size))
        while position + _BLF_OBJECT.size <= size:
            handle.seek(position)
            signature, _, _, length, _ = _BLF_OBJECT.unpack(handle.read(_BLF_OBJECT.size))
            if signature != b"LOBJ" or length < _BLF_OBJECT.size:
                return f"no object begins at byte {position}, where one must"
            position += length
            if position > size:
                return f"it ends within an object, {position - size} bytes short"
            position += length % 4
    if told == size:
        return None
    if objects == 0:
        return "it was never closed: its recorder was killed, and the frames since its last container are missing"
    return f"its header says {told} bytes, the file has {size}"


def _both_ends(path: Path) -> tuple[bytes, bytes]:
    """Return the beginning and the end of a text; a packed one may have been cut before it was packed."""
    if not path.name.lower().endswith(".gz"):
        with open(path, "rb") as handle:
            head = handle.read(_HEAD)
            handle.seek(max(0, path.stat().st_size - _TAIL))
            return head, handle.read()
    with gzip.open(path) as packed:
        head = tail = packed.read(_HEAD)
        while part := packed.read(_PART):
            tail = (tail + part)[-_TAIL:]
    return head, tail


def _asc(head: bytes, tail: bytes) -> str | None:
    if b"begin triggerblock" in head.lower() and b"end triggerblock" not in tail.lower():
        return "it ends without End TriggerBlock: the log was cut, or its recorder killed"
    return _text_end(tail)


def _text_end(tail: bytes) -> str | None:
    return None if tail[-1:] in (b"\n", b"\r") else "its last line is not ended: the log was cut there"


def _mf4(path: Path, frames: int) -> str | None:
    from asammdf import MDF

    with MDF(path) as file:
        groups = [g.channel_group for g in file.groups if any(str(c.name).startswith("CAN_") for c in g.channels)]
        told = sum(int(group.cycles_nr) for group in groups)
    return None if told == frames else f"it announces {told} frames and holds {frames}"
