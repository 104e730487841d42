"""Bits on the bus: no frame is longer than frame.h says, and a node loads the bus as the formula of stream.h says."""

from __future__ import annotations

import ctypes
from fractions import Fraction

import numpy as np
import pytest
from stream_rig import Rig, library, settings

from aeolid.can.reception import time_on_bus
from aeolid.can.wire import EXTENDED, FAST, FD, Frames, pack_frames

BIT_RATE = 500_000


def to_bits(value: int, count: int) -> list[int]:
    """Write a number, most significant bit first."""
    return [value >> i & 1 for i in range(count - 1, -1, -1)]


def count_stuffed(bits: list[int]) -> int:
    """Count the bits that stuffing adds: one after each five alike, itself part of the next run."""
    added, run, last = 0, 0, -1
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            added += 1
            last, run = 1 - bit, 1
    return added


def crc_15(bits: list[int]) -> int:
    """Return the CRC of a classic frame, polynomial 0x4599."""
    crc = 0
    for bit in bits:
        crc = (crc << 1 ^ (0x4599 if (crc >> 14 & 1) != bit else 0)) & 0x7FFF
    return crc


def measure(identifier: int, data: bytes, fd: bool) -> tuple[int, int]:
    """Build a frame with 29-bit identifier bit by bit; returns its bits at the nominal and at the data rate.

    ISO 11898-1: field by field, stuffing as it falls, three bits of space to the next frame.
    """
    payload = [bit for byte in data for bit in to_bits(byte, 8)]
    base, more = to_bits(identifier >> 18, 11), to_bits(identifier & 0x3FFFF, 18)
    if not fd:
        head = [0, *base, 1, 1, *more, 0, 0, 0, *to_bits(len(data), 4), *payload]
        head += to_bits(crc_15(head), 15)
        return len(head) + count_stuffed(head) + 13, 0
    nominal = [0, *base, 1, 1, *more, 0, 1, 0, 1]
    code = {12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}.get(len(data), len(data))
    fast = [0, *to_bits(code, 4), *payload]
    arbitration = len(nominal) + count_stuffed(nominal)
    stuffed = count_stuffed(nominal + fast) - count_stuffed(nominal)
    check = 4 + 21 + 7 if len(data) > 16 else 4 + 17 + 6
    return arbitration + 13, len(fast) + stuffed + check


def longest(length: int, ratio: int, extended: int = 1) -> int:
    """Return what frame.h says, in bits of the nominal rate."""
    return int(library().rig_longest(length, ratio, extended))


def nominal(frames: Frames, ratio: int) -> list[float]:
    """Return the time of each frame on the bus in bits of the nominal rate."""
    result = []
    for i, flags, length, data in zip(frames.id, frames.flags, frames.length, frames.data, strict=True):
        slow, fast = measure(int(i), bytes(data[:length]), bool(flags & FD))
        assert flags & EXTENDED
        result.append(slow + fast / ratio)
    return result


def test_no_frame_is_longer_than_the_header_says() -> None:
    """Drawn frames and those with the most stuffing: below the bound, and the worst of them near to it."""
    generator = np.random.default_rng(1)
    patterns = [0x0F, 0xF0, 0x87, 0x78, 0x3C, 0xC3, 0xE1, 0x1E, 0x00, 0xFF]
    for length in (8, 12, 16, 20, 24, 32, 48, 64):
        worst = 0.0
        for k in range(60):
            data = bytes([patterns[k]] * length) if k < len(patterns) else generator.bytes(length)
            for identifier in (0, 0x1FFFFFFF, 0x0F0F0F0F, 0x1CFF4D01, int(generator.integers(1 << 29))):
                for ratio in (1, 4, 16):
                    slow, fast = measure(identifier, data, length > 8)
                    bits = slow + fast / ratio
                    assert bits <= longest(length, ratio)
                    worst = max(worst, bits / longest(length, ratio))
        assert worst > 0.93


@pytest.mark.parametrize(("fd", "innovations"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_measured_load_is_that_of_the_formula(fd: int, innovations: int) -> None:
    """A node of five channels, 450 parameters, a snapshot every 10 s: 2,000 s on a bus of 500 kbit/s.

    Counted in the longest bits of each frame the load is the formula's; with the stuffing of the frames sent it is
    0.87 of that, the figure to expect (docs/decisions/wire.md): few frames of numbers come near the most stuffing that
    there can be.
    """
    ratio, steps, every = 4, 2000, 100
    rig = Rig(settings(inputs=2, outputs=3, parameters=450, innovations=innovations, fd=fd, fd_ratio=ratio,
                       describe_every=100, burst=16))  # fmt: skip
    generator = np.random.default_rng(6)
    bound = compared = real = 0.0
    for k in range(0, steps, every):
        values = generator.standard_normal((every, 5)).astype(np.float32)
        assert rig.snapshot(k, generator.standard_normal(450).astype(np.float32)) == 0
        rig.run(k, values, values[:, 2:])
        frames = rig.take()
        longest_bits = sum(longest(int(n), ratio) for n in frames.length)
        bound += longest_bits
        if k < 300:
            compared += longest_bits
            real += sum(nominal(frames, ratio))
    description = 7 + 2 * 5 + 5 + 5
    permille = library().rig_load(
        BIT_RATE, 100_000, 5, 3 * innovations, 450, 25, every, 10, description, 100, fd, ratio
    )
    assert bound / BIT_RATE / (0.1 * steps) * 1000 == pytest.approx(permille, rel=0.03, abs=1.0)
    assert real / compared == pytest.approx(0.87, rel=0.1)


def test_the_receiver_counts_frames_as_long_as_the_header_does() -> None:
    """The receiver's load of the bus is that of frame.h for every length, identifier and ratio, of many frames at once.

    The header rounds the fast part up to whole bits of the nominal rate; at one rate both are the same number.
    """
    for extended in (0, 1):
        for length in (8, 12, 16, 20, 24, 32, 48, 64):
            for ratio in (1, 2, 3, 4, 16):
                flags = EXTENDED * extended | (FD | FAST) * (length > 8)
                frames = pack_frames([(0x690, bool(extended), bytes(length))] * 3, flags=[flags] * 3)
                bits = time_on_bus(frames, BIT_RATE, BIT_RATE * ratio) * BIT_RATE / 3
                assert longest(length, ratio, extended) - 1 < bits + 1e-6
                assert bits <= longest(length, ratio, extended) + 1e-6
                assert ratio > 1 or bits == pytest.approx(longest(length, 1, extended), abs=1e-6)


def test_the_load_is_rounded_up_from_the_sum_of_its_parts() -> None:
    """AEO_STREAM_LOAD against the same sum in fractions, over drawn settings: never below, less than one above.

    The header allows 4 / (sample_us bit_rate) thousandths for its own rounding. Small loads are among them, where a
    part cut off is all there is, and loads beyond 32 bits, which stay at the most that these hold.
    """
    generator = np.random.default_rng(3)
    most = 2**32 - 1
    function = library().rig_load_of
    function.restype, function.argtypes = ctypes.c_uint32, [ctypes.c_uint32] * 9

    def draw(low: int, high: int) -> int:
        return min(high, int(np.exp(generator.uniform(np.log(low), np.log(high + 1)))))

    below_two = beyond = 0
    for _ in range(20_000):
        bit_rate, sample_us = draw(10_000, 8_000_000), draw(20, 1_000_000_000)
        sample, snapshot, description = draw(160, 20_800), draw(160, 22_000_000), draw(7, 903)
        every = [draw(1, 65535), draw(1, most), draw(1, 65535), draw(1, 65535)]
        parts = zip((sample, snapshot, 160, 160 * description), every, strict=True)
        exact = sum(Fraction(bits, k) for bits, k in parts) * 10**9 / (sample_us * bit_rate)
        told = function(bit_rate, sample_us, sample, every[0], snapshot, every[1], every[2], description, every[3])
        if exact > most - 1:
            beyond += 1
            assert told == most
            continue
        below_two += exact < 2
        assert exact <= told < exact + 1 + Fraction(4, sample_us * bit_rate)
    assert below_two > 1000 and beyond > 0
