"""Node → virtual CAN → listener with CAN FD frames, and without seals: what arrives is what was sent."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness import Process, Relay, drop, listen

from aeolid.formats import read_record
from aeolid.plants import hawt
from aeolid.record import Roles

pytestmark = pytest.mark.timeout(180)
Start = Callable[..., Process]
NODE = ("node", "--turbine", "--samples", 400, "--seed", 3, "--past", 8, "--wait", "--speed", "max")


@pytest.mark.parametrize("options", [("--fd", "--fd-ratio", 4), ("--fd",), ("--no-seal",)], ids=str)
def test_everything_arrives_bit_for_bit(options: tuple[object, ...], start: Start, tmp_path: Path) -> None:
    """Samples and theta through a bus that loses one frame in fifty."""
    node = start(*NODE, *options, "--dump", tmp_path / "theta.f32")
    relay = Relay([node.first_line()], drop_any(0.02))
    outputs = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(relay.address, tmp_path, *outputs)
    ended.assert_clean()
    node.finish().assert_clean()
    theta = np.load(tmp_path / "m.npz")["theta_scaled"].astype("<f4")
    assert theta.ravel().view("<u4").tolist() == np.fromfile(tmp_path / "theta.f32", "<u4").tolist()
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml")).values
    truth = hawt.simulate_closed_loop(400, 3).matrix("input", "output").astype(np.float32)
    there = np.isfinite(received)
    assert there.mean() > 0.9
    np.testing.assert_array_equal(received[there], truth[: len(received)][there])
    assert facts["nodes"][0]["snapshots"]["complete"] > 1  # type: ignore[index]


def drop_any(share: float) -> Callable[[bytes], list[bytes]]:
    """Lose this share of all frames, CAN FD lines (letter B) too."""
    lose = drop(share, 5)
    return lambda line: [line] if lose(line.replace(b"B", b"T", 1) if line[:1] == b"B" else line) else []
