"""Frames are lost at random and in bursts: every snapshot is there bit for bit within two cycles, at every size."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from stream_rig import Rig, settings

from aeolid.can import Assembly

CYCLE = 120  # samples between two snapshots: room for the frames of one, and for a burst between two
SIZES = (1, 2, 3, 13, 14, 15, 28, 29, 50, 100, 196, 255, 256, 257, 300, 450, 513, 700, 999, 1000)


def losses(kind: str, frames: int, generator: np.random.Generator, cycle: int) -> NDArray[np.bool_]:
    """Say which frames of a cycle arrive. bursts: 50 in a row somewhere in every second cycle."""
    if kind == "bursts":
        arrives = np.ones(frames, bool)
        if cycle % 2:
            at = int(generator.integers(frames))
            arrives[at : at + 50] = False
        return arrives
    result: NDArray[np.bool_] = generator.random(frames) >= float(kind) / 100
    return result


def play(size: int, fd: int, kind: str, seed: int, cycles: int) -> tuple[int, int]:
    """Stream that many cycles; returns in how many the snapshot was not there at once, and not in the next either."""
    generator = np.random.default_rng([seed, size, fd])
    # 14 or more frames a step: a snapshot is over before the next one, and the gap between is longer than a burst
    rig = Rig(settings(inputs=0, outputs=1, parameters=size, fd=fd, burst=16, sample_every=1))
    assembly = Assembly()
    rig.run(0, np.zeros((CYCLE, 1), np.float32), np.zeros((CYCLE, 1), np.float32))
    assembly.feed(rig.take())  # the description arrives whole; its own losses are another test
    late, missed, before = 0, 0, np.zeros(size, np.float32)
    for cycle in range(1, cycles + 1):
        theta = generator.standard_normal(size).astype(np.float32)
        values = generator.standard_normal((CYCLE, 1)).astype(np.float32)
        assert rig.snapshot(cycle * CYCLE - 1, theta) == 0
        rig.run(cycle * CYCLE, values, values)
        frames = rig.take()
        assembly.feed(frames.take(losses(kind, len(frames), generator, cycle)))
        node = assembly.nodes[1]
        snapshot = node.latest_complete()
        found = None if snapshot is None else snapshot.theta_scaled.ravel()
        if found is None or found.tobytes() != theta.tobytes():
            late += 1
            missed += cycle > 1 and (found is None or found.tobytes() != before.tobytes())
        else:
            assert snapshot is not None and snapshot.sample_index == cycle * CYCLE - 1
        before = theta
    return late, missed


@pytest.mark.parametrize("fd", [0, 1])
@pytest.mark.parametrize("kind", ["0", "1", "10", "bursts"])
def test_every_snapshot_is_there_within_two_cycles(kind: str, fd: int) -> None:
    """Twelve cycles of every size; without losses every snapshot is there in its own cycle."""
    results = {size: play(size, fd, kind, 0, 12) for size in SIZES}
    assert {size: r for size, r in results.items() if r[1]} == {}
    if kind == "0":
        assert sum(late for late, _ in results.values()) == 0
    if kind == "1":  # all three ends lost once in 10^6, or more lost than eight repair frames make good
        assert sum(late for late, _ in results.values()) <= 1


def sweep() -> None:
    """Go through all sizes 1 to 1000 (python test_can_losses.py [CYCLES [SEED]])."""
    cycles, seed = (int(a) for a in (sys.argv[1:] + ["20", "1"][len(sys.argv) - 1 :])[:2])
    for fd in (0, 1):
        for kind in ("0", "1", "10", "bursts"):
            results = [play(size, fd, kind, seed, cycles) for size in range(1, 1001)]
            late, missed = (sum(r[i] for r in results) for i in (0, 1))
            where = [size for size, r in enumerate(results, 1) if r[1]]
            print(f"fd {fd} losses {kind}: {1000 * cycles} cycles, {late} late, {missed} not within two {where[:9]}")


if __name__ == "__main__":
    sweep()
