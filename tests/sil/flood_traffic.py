"""Build a flood: the stream of one node that samples in haste, between frames of other systems, as slcan text."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np

from aeolid.can.crc import check_8, start_8
from aeolid.can.logs import open_log
from aeolid.can.wire import BASE, DESCRIPTION, HEALTH, SAMPLE, Frames

STREAM = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
NODE, CHANNELS = 7, 5  # of that stream
PER_HEALTH = 1000  # samples between two frames that tell the full index
_DIGITS = np.frombuffer(b"0123456789ABCDEF", np.uint8)


def description() -> Frames:
    """Return the frames by which the node of the stored stream describes itself."""
    with closing(open_log(str(STREAM))) as source:
        frames = source.read(0.0)
    return frames.take(frames.id == BASE + (DESCRIPTION << 8) + NODE)


def _pack(kind: int, tag: np.ndarray, index: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Build the eight data bytes (n, 8) of classic frames."""
    data = np.zeros((len(tag), 8), np.uint8)
    data[:, 0], data[:, 1], data[:, 2] = tag, index & 0xFF, index >> 8 & 0xFF
    data[:, 4:] = value.astype("<u4").view(np.uint8).reshape(-1, 4)
    data[:, 3] = check_8(np.full(len(tag), start_8(BASE + (kind << 8)), np.uint8), data)
    return data


def value_of(index: np.ndarray, channel: np.ndarray) -> np.ndarray:
    """Return what channel `channel` holds at sample `index`."""
    return (index % 65521 + channel / 8).astype(np.float32)


def lines(first: int, samples: int, seed: int) -> bytes:
    """Build the text of so many samples from `first` on: each frame of the node is followed by one of somebody else.

    Cost: 27 bytes a line, ten lines a sample.
    """
    index = np.repeat(np.arange(first, first + samples), CHANNELS)
    channel = np.tile(np.arange(CHANNELS), samples)
    data = _pack(SAMPLE, channel, index, value_of(index, channel).view(np.uint32))
    generator = np.random.default_rng(seed)
    ours = spell(np.full(len(index), BASE + (SAMPLE << 8) + NODE), data)
    foreign = spell(generator.integers(0x18F00000, 0x18FF0000, len(index)), generator.integers(0, 256, data.shape))
    text = np.stack([ours, foreign], axis=1).reshape(-1, ours.shape[1])
    told = np.arange(first, first + samples)
    told = told[told % PER_HEALTH == 0]
    health = spell(np.full(len(told), BASE + (HEALTH << 8) + NODE), _pack(HEALTH, 0 * told, 0 * told, told))
    at = (told - first) * 2 * CHANNELS + 2 * CHANNELS
    return np.insert(text, at, health, axis=0).tobytes()


def spell(ids: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Spell frames as lines (n, 27) of slcan: T, 8 digits, 8, 16 digits, end of line."""
    head = np.stack([ids >> shift & 0xFF for shift in (24, 16, 8, 0)], axis=1)
    body = np.concatenate([head, data], axis=1).astype(np.uint8)  # (n, 12)
    digits = np.stack([_DIGITS[body >> 4], _DIGITS[body & 15]], axis=2).reshape(len(body), 24)
    ends = np.full((len(body), 1), 0, np.uint8)
    return np.concatenate([ends + ord("T"), digits[:, :8], ends + ord("8"), digits[:, 8:], ends + 13], axis=1)


def write(path: Path, count: int, seed: int = 1) -> tuple[int, int]:
    """Write a flood of about `count` lines; returns how many they are and how many samples they carry."""
    head = description()
    samples = count // (2 * CHANNELS)
    written = len(head)
    with open(path, "wb") as handle:
        handle.write(spell(head.id.astype(np.int64), head.data[:, :8]).tobytes())
        for first in range(0, samples, 20_000):
            text = lines(first, min(20_000, samples - first), seed + first)
            written += len(text) // 27
            handle.write(text)
    return written, samples
