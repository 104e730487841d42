"""Build the frames of a node of wire version 2, independently of the C streamer, and feed them to a receiver."""

from __future__ import annotations

import zlib

import numpy as np

from aeolid.can import Assembly, MarkovSnapshot, wire
from aeolid.can.repair import group_members, repair_sets

R, L, P = 2, 3, 4
COUNT = L * P * (R + L)
Row = tuple[int, bool, bytes]


def bits(value: float) -> int:
    """Return the binary32 pattern."""
    return int(np.array([value], np.float32).view(np.uint32)[0])


def describe(
    node: int = 1, *, version: int = 2, past: int = P, names: tuple[str, ...] = ("a", "b"), every: int = 1,
    parameters: int | None = None, shape: int | None = None, scales: tuple[float, ...] = (1, 10, 0.1, 2, 5),
    sample_time: float = 0.1, forgetting: float = 0.99, regularisation: float = 2.0,
) -> list[Row]:  # fmt: skip
    """Build the description frames of a node, written independently of the C streamer."""
    count = L * past * (R + L) if parameters is None else parameters
    parts = {
        (1, 0): R | L << 8 | 1 << 24 if shape is None else shape,
        (2, past): count,
        (3, every): bits(sample_time),
        (4, 0): bits(forgetting),
        (5, 0): bits(regularisation),
        (6, 0): 0,
    }
    for i in range(R + L):
        parts[7, i], parts[8, i] = bits(0.5 * i), bits(scales[i])
    for i, name in enumerate(names):
        for part in range(-(-len(name) // 4)):
            text = name[4 * part : 4 * part + 4].encode().ljust(4, b"\0")
            parts[9, i | part << 8] = int.from_bytes(text, "little")
    words = np.array([(tag | index << 16, value) for (tag, index), value in sorted(parts.items())], "<u4")
    head = ((0, version), zlib.crc32(words.tobytes()))
    return [row(node, wire.DESCRIPTION, tag, index, value) for (tag, index), value in [head, *sorted(parts.items())]]


def row(node: int, kind: int, tag: int, index: int, value: int) -> Row:
    """Build one frame."""
    identifier, data = wire.encode(node, kind, tag, index, value)
    return identifier, True, data


def samples(first: int, count: int, node: int = 1, every: int = 1, seal: bool = True) -> list[Row]:
    """Build sample frames and their seals; the value tells index and channel."""
    rows = []
    for k in range(first, first + count * every, every):
        values = [bits(k + channel / 8) for channel in range(R + L)]
        rows += [row(node, wire.SAMPLE, channel, k & 0xFFFF, value) for channel, value in enumerate(values)]
        if seal:
            words = np.array([node | R + L << 8, k, *values], "<u4")
            rows.append(row(node, wire.SEAL, R + L, k & 0xFFFF, zlib.crc32(words.tobytes())))
    return rows


def snapshot(theta: np.ndarray, number: int = 1, index: int = 77, repairs: int = 40, node: int = 1) -> list[Row]:
    """Build the frames of one snapshot."""
    values = theta.astype(np.float32).view(np.uint32)
    head = np.array([number | len(values) - 1 << 8 | node << 24, index], "<u4")
    crc = zlib.crc32(head.tobytes() + values.astype("<u4").tobytes())
    order = group_members(len(values))[0]  # one group: at most 256 parameters
    rows = [row(node, wire.BEGIN, number, len(values) - 1, index)]
    rows += [row(node, wire.PARAMETER, number, int(i), int(values[i])) for i in order]
    rows += [row(node, wire.END, number, index & 0xFFFF, crc)]
    member = group_members(len(values))[0]
    for k in range(repairs):
        chosen = repair_sets(np.array([k]), len(member))[0]
        rows.append(row(node, wire.REPAIR, number, k, int(np.bitwise_xor.reduce(values[member][chosen]))))
    return rows + 2 * [row(node, wire.END, number, index & 0xFFFF, crc)]


def stopped(index: int, node: int = 1) -> Row:
    """Build a goodbye."""
    return row(node, wire.HEALTH, 0, wire.STOPPED, index)


def receive(rows: list[Row], batch: int = 10**9) -> Assembly:
    """Feed frames in batches of this size."""
    assembly = Assembly()
    for k in range(0, len(rows), batch):
        assembly.feed(wire.pack_frames(rows[k : k + batch]))
    assembly.close()
    return assembly


def latest(assembly: Assembly, node: int = 1) -> MarkovSnapshot:
    """Return the newest snapshot, complete or not."""
    now = assembly.nodes[node].now
    assert now is not None and now.snapshots.latest is not None
    return now.snapshots.latest
