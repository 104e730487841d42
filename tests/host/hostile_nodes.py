"""Build what hostile and broken devices send, frame by frame in bulk; each attack is an endless iterator of frames."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from itertools import chain, count, islice

import numpy as np

from aeolid.can import wire
from aeolid.can.crc import check_8
from aeolid.can.wire import (
    BASE,
    BEGIN,
    DESCRIPTION,
    END,
    EXTENDED,
    FAST,
    FD,
    HEALTH,
    INNOVATION,
    PARAMETER,
    REPAIR,
    SAMPLE,
    SEAL,
    Frames,
)  # fmt: skip

Row = tuple[int, int, int, int, int]  # node, kind, tag, index, value
BUS_RATE = 8000.0  # classic frames a second of a full bus of 1 Mbit/s
HONEST = 200  # number of the node that does what it should
CHANNELS = 5


def bits(value: float) -> int:
    """Return the binary32 pattern."""
    return int(np.array([value], np.float32).view(np.uint32)[0])


def encode(rows: list[Row], base: int = BASE) -> Frames:
    """Turn messages into classic frames with right checks."""
    table = np.array(rows, np.int64).reshape(-1, 5)
    data = np.zeros((len(table), 8), np.uint8)
    data[:, 0], data[:, 1], data[:, 2] = table[:, 2], table[:, 3] & 0xFF, table[:, 3] >> 8 & 0xFF
    data[:, 4:] = (table[:, 4] & 0xFFFFFFFF).astype("<u4").view(np.uint8).reshape(-1, 4)
    data[:, 3] = check_8(wire._starts(base)[table[:, 1] & 15], data)
    ids = (base + (table[:, 1] << 8) + table[:, 0]).astype(np.uint32)
    n = len(table)
    return Frames(ids, np.full(n, EXTENDED, np.uint8), np.full(n, 8, np.uint8), data, np.full(n, np.nan))


def description(
    node: int, *, r: int = 2, l: int = 3, past: int = 4, salt: float = 0.0, every: int = 1, h: float = 0.1,  # noqa: E741
    names: tuple[bytes, ...] = (),
) -> list[Row]:  # fmt: skip
    """Describe a node of r inputs and l outputs; salt: makes it another configuration."""
    parts = {
        (1, 0): r | l << 8, (2, past): l * past * (r + l), (3, every): bits(h), (4, 0): bits(0.99),
        (5, 0): bits(0.1 + salt), (6, 0): 0,
    }  # fmt: skip
    parts |= {(8, i): bits(1.0) for i in range(r + l)}
    for i, name in enumerate(names):
        for part in range(8):
            word = int.from_bytes(name[4 * part : 4 * part + 4].ljust(4, b"\0"), "little")
            if word:
                parts[9, i | part << 8] = word
    words = np.array([(tag | index << 16, value) for (tag, index), value in sorted(parts.items())], "<u4")
    head = (node, DESCRIPTION, 0, 2, zlib.crc32(words.tobytes()))
    return [head, *((node, DESCRIPTION, tag, index, value) for (tag, index), value in parts.items())]


def sample(node: int, k: int, values: list[float], kind: int = SAMPLE, seal: bool = True) -> list[Row]:
    """Send one sample, or innovation, with its seal."""
    patterns = np.array(values, np.float32).view(np.uint32).tolist()
    rows = [(node, kind, channel, k & 0xFFFF, value) for channel, value in enumerate(patterns)]
    if seal:
        tag = len(values) | (0x80 if kind == INNOVATION else 0)
        words = np.array([node | tag << 8, k & 0xFFFFFFFF, *patterns], "<u4")
        rows.append((node, SEAL, tag, k & 0xFFFF, zlib.crc32(words.tobytes())))
    return rows


def snapshot(node: int, number: int, k: int, theta: np.ndarray) -> list[Row]:
    """Send one snapshot without repair frames."""
    values = theta.astype(np.float32).view(np.uint32)
    head = np.array([number | len(values) - 1 << 8 | node << 24, k], "<u4")
    end = (node, END, number, k & 0xFFFF, zlib.crc32(head.tobytes() + values.astype("<u4").tobytes()))
    rows = [(node, BEGIN, number, len(values) - 1, k)]
    return [*rows, *((node, PARAMETER, number, i, v) for i, v in enumerate(values.tolist())), end, end, end]


def honest(node: int = HONEST, past: int = 4) -> Iterator[list[Row]]:
    """Send sealed samples, health, description and snapshots as a node does; value = index + channel / 8."""
    size = 3 * past * CHANNELS
    yield description(node, past=past)
    for k in count():
        rows = sample(node, k, [k % 4096 + channel / 8 for channel in range(CHANNELS)])
        if k % 10 == 0:
            rows.append((node, HEALTH, 0, 0, k))
        if k % 100 == 99:
            rows += description(node, past=past) + snapshot(node, k // 100 & 0xFF, k, np.sin(np.arange(size) + k))
        yield rows


def redescribing() -> Iterator[list[Row]]:
    """Describe 32 nodes anew again and again, each time with a window of 65,535 and the start of a snapshot."""
    for turn in count(1):
        for node in range(32):
            begin, end = (node, BEGIN, 1, 65534, 5), (node, END, 1, 5, 1)
            yield [*description(node, r=0, l=1, past=65535, salt=0.001 * turn), begin, end, end, end]


def long_windows() -> Iterator[list[Row]]:
    """Describe windows of 8,000 to 65,535 and send samples to follow modes from."""
    pasts = (8000, 20_000, 32_000, 10_000)
    yield [r for node, past in enumerate(pasts) for r in description(node, r=1, l=1, past=past)]
    for k in count():
        yield [r for node in range(len(pasts)) for r in sample(node, k, [np.sin(0.7 * k), np.cos(0.3 * k)])]


def forged_innovations() -> Iterator[list[Row]]:
    """Send innovations whose index lies ever farther ahead of the samples."""
    yield description(1, r=1, l=1, past=3)
    for k in count():
        rows = sample(1, k, [0.1, 0.2])
        rows += sample(1, k + 17_000 * (k % 40), [0.5], INNOVATION) if k > 200 else sample(1, k, [0.01], INNOVATION)
        yield rows + ([(1, HEALTH, 0, 0, k)] if k % 50 == 0 else [])


def to_and_fro(length: int = 2, seal: bool = True) -> Iterator[list[Row]]:
    """Let the index leap to and fro: `length` samples in one place, then in another."""
    yield description(1, r=1, l=1, past=3)
    yield [r for k in range(200) for r in sample(1, k, [0.1, 0.2])]
    for j in count():
        start = (100_000 * (j % 7 + 1), 30_000)[j % 2] + (j // 14 * length if length > 2 else 0)
        yield [r for k in range(start, start + length) for r in sample(1, k, [0.1, 0.2], seal=seal)]


def leaps(step: int = 990) -> Iterator[list[Row]]:
    """Leave out almost all samples: each one goes `step` ahead of the one before."""
    yield description(1, r=3, l=1, past=3)
    yield [r for k in range(300) for r in sample(1, k, [0.1] * 4)]
    for j in count():
        yield sample(1, 300 + j * step, [0.1] * 4)


def bursts_and_leaps() -> Iterator[list[Row]]:
    """Send many samples and then leap by twenty times their number."""
    yield description(1, r=1, l=1, past=3)
    k = 0
    while True:
        yield from (sample(1, k + i, [0.1, 0.2]) for i in range(500))
        k += 500 + 9000


def undescribed() -> Iterator[list[Row]]:
    """Send samples of nodes that never describe themselves, one frame at a time."""
    for j in count():
        yield [(j % 32, SAMPLE, 0, j & 0xFFFF, j)]


def twins(offset: int = 5, seal: bool = True) -> Iterator[list[Row]]:
    """Two controllers with one number and one configuration, the second `offset` samples ahead."""
    told = description(1, r=1, l=1, past=3)
    yield told + told
    generator = np.random.default_rng(1)
    for k in count():
        a, b = sample(1, k, [1.0, 1.5], seal=seal), sample(1, k + offset, [-7.0, -7.5], seal=seal)
        if k % 10 == 0:
            a, b = [*a, (1, HEALTH, 0, 0, k)], [*b, (1, HEALTH, 0, 0, k + offset)]
        yield a + b if generator.random() < 0.5 else b + a


def all_numbers() -> Iterator[list[Row]]:
    """Describe nodes 0 … 253 and send of each; 254 and 255 are no nodes."""
    numbers = [n for n in range(256) if n != HONEST]
    for k in count():
        for node in numbers:
            yield (description(node, r=1, l=1, past=3) if k % 50 == 0 else []) + sample(node, k, [0.1, 0.2])


def half_snapshots() -> Iterator[list[Row]]:
    """Send the beginnings of all snapshot numbers in turn, of a large description, and end some of them."""
    yield description(1, r=0, l=1, past=65_535)
    for k in count():
        ends = [(1, END, k & 0xFF, 0, 7)] * 3 if k % 2 else []
        yield [(1, BEGIN, k & 0xFF, 65_534, k), *((1, PARAMETER, k & 0xFF, i, k) for i in range(3)), *ends]


def repairs() -> Iterator[list[Row]]:
    """Send half of the parameters and endless repair frames that do not fit."""
    yield description(1, r=0, l=1, past=65_535)
    for number in count():
        yield [(1, BEGIN, number & 0xFF, 65_534, number)] + [(1, END, number & 0xFF, 0, 7)] * 2
        yield [(1, PARAMETER, number & 0xFF, i, i) for i in range(2000)]
        for i in range(3000):
            yield [(1, REPAIR, number & 0xFF, i, i)]


def health() -> Iterator[list[Row]]:
    """Send nothing but health with random items, flags and values."""
    yield description(1, r=1, l=1, past=3)
    generator = np.random.default_rng(2)
    for k in count():
        item, flags, value = generator.integers(0, (12, 65536, 2**32)).tolist()
        yield [(1, HEALTH, item * (k % 2), flags, value)] + (sample(1, k, [0.1, 0.2]) if k % 40 == 0 else [])


def strange_names() -> Iterator[list[Row]]:
    """Describe names full of control characters, quotes, formulas and directions, anew now and then."""
    odd = (b"\x1b[2J\x07\x00hidden", "\u202eevil\u2066".encode(), b'=cmd|"/c calc"!A0', b"../../etc/passwd\n",
           b"\xff\xfe\xfd[x],\"'\r")  # fmt: skip
    for k in count():
        yield description(1, names=odd, salt=0.01 * (k // 500)) if k % 50 == 0 else []
        yield sample(1, k, [0.5] * CHANNELS)


def endless_parts() -> Iterator[list[Row]]:
    """Announce a description and send parts of it for ever, each in several versions."""
    generator = np.random.default_rng(3)
    for k in count():
        head = [(1, DESCRIPTION, 0, 2, 7 + k // 20_000)] if k % 500 == 0 else []
        item, index, value = generator.integers((1, 0, 0), (11, 4096, 6)).tolist()
        yield [*head, (1, DESCRIPTION, item, index % 64 | (index >> 6) % 8 << 8 if item > 8 else index % 64, value)]


def noise() -> Iterator[list[Row]]:
    """Send every kind with random fields from all numbers, with right checks."""
    generator = np.random.default_rng(4)
    while True:
        table = generator.integers(0, (256, 16, 256, 65536, 2**32), (500, 5))
        table[:, 0] = np.where(
            table[:, 0] == HONEST, 1, np.where(generator.random(500) < 0.7, table[:, 0] % 32, table[:, 0])
        )
        table[:, 2] = np.where(generator.random(500) < 0.8, table[:, 2] % 4, table[:, 2])
        yield [tuple(r) for r in table.tolist()]


def fd_frames() -> Iterator[Frames]:
    """Send CAN FD frames of every length, half of them damaged."""
    yield encode(description(1))
    generator = np.random.default_rng(5)
    for k in count():
        rows = []
        for n in range(1, 15):
            kind = (wire.SAMPLE_FD, wire.INNOVATION_FD, wire.PARAMETER_FD, wire.REPAIR_FD)[(k + n) % 4]
            identifier, data = wire.encode_fd(
                1, kind, 0, (k * 14 + n) & 0xFFFF, generator.integers(0, 2**32, n).tolist()
            )
            rows.append((identifier, True, data if n % 2 else data[:-1] + b"\x55"))
        yield wire.pack_frames(rows, flags=[EXTENDED | FD | FAST] * len(rows))


ATTACKS: dict[str, Callable[[], Iterator[list[Row]]]] = {
    "redescribing": redescribing, "long windows": long_windows, "forged innovations": forged_innovations,
    "to and fro": to_and_fro, "to and fro, 40": lambda: to_and_fro(40),
    "to and fro, bare": lambda: to_and_fro(2, False), "leaps": leaps, "bursts and leaps": bursts_and_leaps,
    "undescribed": undescribed, "twins": twins,
    "twins apart": lambda: twins(400), "twins, bare": lambda: twins(5, False), "all numbers": all_numbers,
    "half snapshots": half_snapshots, "repairs": repairs, "health": health, "strange names": strange_names,
    "endless parts": endless_parts, "noise": noise,
}  # fmt: skip


def batches(rows: Iterator[list[Row]], size: int) -> Iterator[Frames]:
    """Cut messages into batches of frames of this size."""
    flat = chain.from_iterable(rows)
    while batch := list(islice(flat, size)):
        yield encode(batch)


def apart(name: str, rows: list[Row], number: int) -> list[Row]:
    """Give an attack numbers that no other uses, so that none is refused for what another does."""
    if name in ("redescribing", "undescribed"):
        return rows  # 0 … 31
    if name == "noise":
        return [(32 + row[0] % 64, *row[1:]) for row in rows]
    if name == "all numbers":
        return [row for row in rows if row[0] > HONEST]
    return [(100 + 4 * number + row[0] % 4, *row[1:]) for row in rows]


def mixed() -> Iterator[list[Row]]:
    """Interleave all attacks, a few messages of each in turn, under numbers of their own."""
    sources = [
        chain.from_iterable(apart(name, rows, i) for rows in attack())
        for i, (name, attack) in enumerate(ATTACKS.items())
    ]
    for turn in count():
        yield list(islice(sources[turn % len(sources)], 8))


def interleaved(share: float = 0.1) -> Iterator[list[Row]]:
    """Let an honest node send beside all attacks, so that about this share of the frames is its own."""
    good, bad = honest(), chain.from_iterable(mixed())
    for rows in good:
        yield rows
        yield list(islice(bad, round(len(rows) * (1 / share - 1))))


def dated(frames: Frames, first: int, rate: float = BUS_RATE, start: float = 1.79e9) -> Frames:
    """Give frames the times at which a bus of this rate would bring them; first: number of the first one."""
    return Frames(frames.id, frames.flags, frames.length, frames.data, start + (first + np.arange(len(frames))) / rate)
