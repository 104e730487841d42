"""Frames with wrong bits and serial lines run together: whatever is garbled, nothing wrong is ever delivered."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from stream_rig import Rig, settings

from aeolid.can import Assembly
from aeolid.can.slcan import parse
from aeolid.can.wire import EXTENDED, FAST, FD, Frames, decode, join_frames

Table = NDArray[np.float32]
CHANNELS, OUTPUTS, PARAMETERS = 3, 1, 30
SHARES = (0.003, 0.03, 0.3, 1.0)  # of the frames that are garbled in a stretch


@dataclass(eq=False)
class Truth:
    """Hold what a node sent: values (n, channels), innovations (n, outputs) from sample `first` on, theta by index."""

    first: int
    values: Table
    innovations: Table
    thetas: dict[int, Table]
    counters: dict[str, int]


def stream(node: int, fd: int, seed: int, cycles: int, first: int, **changed: int) -> tuple[Frames, Truth]:
    """Let a node send: half of its channels change slowly or not at all, so that neighbours resemble each other."""
    generator = np.random.default_rng([seed, node])
    rig = Rig(settings(node=node, fd=fd, innovations=1, parameters=PARAMETERS, describe_every=100, **changed))
    count = 50 * cycles
    values = generator.standard_normal((count, CHANNELS)).astype(np.float32)
    values[:, 0] = np.round(values[:, 0])
    values[:, 1] = 1000 + np.arange(count) // 7
    innovations = (values[:, 2:] / 8).astype(np.float32)
    parts, thetas = [], {}
    for k in range(0, count, 50):
        rig.run(first + k, values[k : k + 50], innovations[k : k + 50])
        index = first + k + 49
        thetas[index] = (generator.standard_normal(PARAMETERS) / 4).astype(np.float32)
        assert rig.snapshot(index, thetas[index]) == 0
        parts.append(rig.take())
    rig.finish()
    return join_frames([*parts, rig.take()]), Truth(first, values, innovations, thetas, rig.counters())


def merge(streams: list[Frames]) -> Frames:
    """Interleave nodes on one bus, each in its order."""
    keys = [np.arange(len(f)) / len(f) for f in streams]
    return join_frames(streams).take(np.argsort(np.concatenate(keys), kind="stable"))


def flip_bits(
    frames: Frames, chosen: NDArray[np.int64], generator: np.random.Generator
) -> tuple[Frames, NDArray[np.int64]]:
    """Turn 1 to 64 bits of identifier and data of the chosen frames; returns them and which frames are not the same.

    Small numbers are as likely as large ones. Bits of the base would make a frame somebody else's at once: every other
    frame is spared them.
    """
    data, ids = frames.data.copy(), frames.id.copy()
    count = np.minimum(2 ** generator.uniform(0, 6.05, len(chosen)), 64).astype(np.int64)
    for k in range(int(count.max(initial=0))):
        at = chosen[count > k]
        bit = generator.integers(0, 29 + 8 * frames.length[at].astype(np.int64))
        bit = np.where((bit >= 12) & (bit < 29) & (at % 2 == 0), bit % 12, bit)
        in_id = bit < 29
        ids[at[in_id]] ^= np.uint32(1) << bit[in_id].astype(np.uint32)
        at, bit = at[~in_id], bit[~in_id] - 29
        data[at, bit // 8] ^= (1 << bit % 8).astype(np.uint8)
    wrong = (ids != frames.id) | (data != frames.data).any(axis=1)
    return replace(frames, id=ids, data=data), np.flatnonzero(wrong)


def as_text(frames: Frames) -> bytes:
    """Write frames as slcan lines."""
    lines = []
    codes = {8: "8", 12: "9", 16: "A", 20: "B", 24: "C", 32: "D", 48: "E", 64: "F"}
    for i, flags, length, data in zip(frames.id, frames.flags, frames.length, frames.data, strict=True):
        letter = "B" if flags == EXTENDED | FD | FAST else "T"
        lines.append(f"{letter}{i:08X}{codes[int(length)]}{bytes(data[:length]).hex().upper()}\r")
    return "".join(lines).encode()


def cut_text(text: bytes, cuts: int, generator: np.random.Generator) -> bytes:
    """Lose spans of a serial line, many of them as long as a line, so that what is left looks like a frame."""
    kept = np.ones(len(text), bool)
    for at in generator.integers(0, len(text), cuts).tolist():
        length = 27 * int(generator.integers(1, 4)) if generator.random() < 0.7 else int(generator.integers(1, 60))
        kept[at : at + length] = False
    return np.frombuffer(text, np.uint8)[kept].tobytes()


def receive(frames: Frames, batch: int) -> Assembly:
    """Feed in batches."""
    assembly = Assembly()
    for k in range(0, len(frames), batch):
        assembly.feed(frames.take(slice(k, k + batch)))  # type: ignore[arg-type]
    assembly.close()
    return assembly


def check_values(store: object, truth: Table, first: int) -> int:
    """Demand that each value is the true one or missing; returns how many there are."""
    found = 0
    for table in store.tables(1):  # type: ignore[attr-defined]
        there = np.isfinite(table.values)
        rows = np.flatnonzero(there.any(axis=1))
        if not len(rows):
            continue
        at = table.index[rows] - first
        assert at.min() >= 0 and at.max() < len(truth), (table.index[rows[[0, -1]]], first)
        right = table.values[rows].astype(np.float32) == truth[at]
        assert (right | ~there[rows]).all(), (table.index[rows][~(right | ~there[rows]).all(axis=1)], first)
        found += int(np.count_nonzero(there))
    return found


def check(assembly: Assembly, truths: dict[int, Truth]) -> tuple[int, int]:
    """Demand that nothing wrong was delivered; returns how many values and snapshots were."""
    values = snapshots = 0
    for number, node in assembly.nodes.items():
        configurations = node.configurations()
        if number not in truths:
            assert configurations == [] and not node.stopped
            continue
        truth = truths[number]
        for c in configurations:
            d = c.description
            assert d.names == ("c00", "c01", "c02") and d.units == ("m/s",) * 3
            assert d.offset.tolist() == [0.5] * 3 and d.scale.tolist() == [1.5] * 3
            assert (d.inputs, d.outputs, d.parameters, d.sample_time_s) == (2, 1, PARAMETERS, 0.1)
            values += check_values(c.samples, truth.values, truth.first)
            values += check_values(c.innovations, truth.innovations, truth.first)
            snapshots += c.snapshots.completed
            if c.snapshots.complete is not None:
                index = c.snapshots.complete.sample_index
                assert index in truth.thetas
                assert c.snapshots.complete.theta_scaled.tobytes() == truth.thetas[index].tobytes()
            if c.snapshots.latest is not None and not c.snapshots.latest.complete:
                part = c.snapshots.latest
                assert not np.isfinite(part.theta_scaled).any() or part.sample_index in (None, *truth.thetas)
        assert node.flags in (0, 5)
        last = truth.first + len(truth.values) - 1
        for name, value in node.counters.items():
            most = truth.counters.get(name)
            if name == "SampleIndex":
                assert 0 <= value <= last, (number, value, last, node._health._items)
            elif most is not None:
                assert value <= most, (name, value, most)
            else:
                factor = ("Accepted", "NotFinite", "OutOfRange", "TimeFault", "Gaps", "Withheld", "Bounded",
                          "Reinitialised", "Released").index(name) + 1  # fmt: skip
                assert value % factor == 0 and value // factor <= last, (name, value, last)
    return values, snapshots


@dataclass
class Score:
    """Count garbled frames, those that passed every check of their own, and what was delivered all the same."""

    garbled: int = 0
    passed: int = 0
    values: int = 0
    snapshots: int = 0

    def __add__(self, other: Score) -> Score:
        return Score(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


def scene(seed: int, cycles: int) -> tuple[Frames, dict[int, Truth]]:
    """Put two sealed nodes, one without seals and one on CAN FD on one bus; two of them count in step."""
    firsts = np.random.default_rng(seed).integers(0, 200_000, 3).tolist()
    made = {
        1: stream(1, 0, seed, cycles, firsts[0]),
        3: stream(3, 0, seed, cycles, firsts[0]),
        5: stream(5, 0, seed, cycles, firsts[1], seal=0),
        9: stream(9, 1, seed, cycles, firsts[2]),
    }
    return merge([frames for frames, _ in made.values()]), {n: truth for n, (_, truth) in made.items()}


def try_flips(seed: int, cycles: int, rounds: int) -> Score:
    """Garble a scene again and again: quiet stretches, stretches with few and with many wrong frames."""
    generator = np.random.default_rng([seed, 1])
    frames, truths = scene(seed, cycles)
    score = Score()
    for k in range(rounds):
        share = np.repeat(generator.choice([0.0, *SHARES], 8), -(-len(frames) // 8))[: len(frames)]
        chosen = np.flatnonzero(generator.random(len(frames)) < share)
        wrong, garbled = flip_bits(frames, chosen, generator)
        passed = np.isin(garbled, decode(wrong).place)
        assembly = receive(wrong, (701, 4096, 10**9, 10**9)[k % 4])
        values, snapshots = check(assembly, truths)
        score += Score(len(garbled), int(np.count_nonzero(passed)), values, snapshots)
    return score


def try_cuts(seed: int, cycles: int, rounds: int) -> Score:
    """Lose spans of the serial line, from a few to one in every other frame."""
    generator = np.random.default_rng([seed, 2])
    frames, truths = scene(seed, cycles)
    text = as_text(frames)
    score = Score()
    for _ in range(rounds):
        cuts = max(1, int(len(frames) * generator.choice([0.0003, 0.003, 0.03, 0.3])))
        broken = cut_text(text, cuts, generator)
        assembly, rest = Assembly(), b""
        for k in range(0, len(broken), 1 << 18):
            part, rest = parse(rest + broken[k : k + (1 << 18)])
            assembly.feed(part)
        assembly.close()
        values, snapshots = check(assembly, truths)
        score += Score(cuts, 0, values, snapshots)
    return score


def test_an_unharmed_scene_arrives_whole() -> None:
    """Without garbling everything of all four nodes is there: the checks below are not content with nothing."""
    frames, truths = scene(0, 4)
    values, snapshots = check(receive(frames, 10**9), truths)
    assert values == 4 * 200 * (CHANNELS + OUTPUTS) and snapshots == 4 * 4


@pytest.mark.parametrize("seed", [1, 2])
def test_wrong_bits_are_never_delivered(seed: int) -> None:
    """Every node's samples, innovations, snapshots, description and counters: the true ones or none."""
    score = try_flips(seed, 10, 8)
    assert score.garbled > 10_000 and score.passed > 20  # garbled frames did pass the CRC-8
    assert score.values > 1000 and score.snapshots > 10


def test_lines_run_together_are_never_delivered() -> None:
    """A serial adapter that loses characters makes frames of the head of one line and the tail of another."""
    score = try_cuts(3, 10, 6)
    assert score.garbled > 2000 and score.values > 1000 and score.snapshots > 10


def main() -> None:
    """Count to many (python test_can_corruption.py FRAMES [SEED])."""
    wanted, seed = int(float(sys.argv[1])), int(sys.argv[2]) if len(sys.argv) > 2 else 100
    began, flips, cuts = time.monotonic(), Score(), Score()
    while flips.garbled + cuts.garbled < wanted:
        seed += 1
        flips += try_flips(seed, 60, 16)
        if seed % 4 == 0:
            cuts += try_cuts(seed, 60, 16)
            print(f"{time.monotonic() - began:.0f} s: wrong bits {flips}, cuts {cuts}; nothing wrong", flush=True)
    print(f"in all: wrong bits {flips}, cuts {cuts}; nothing wrong")


if __name__ == "__main__":
    main()
