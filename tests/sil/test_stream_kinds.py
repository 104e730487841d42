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

Start = Callable[..., Process]
NODE = ("node", "--turbine", "--samples", 400, "--seed", 3, "--past", 8, "--wait", "--speed", "max")


KINDS = {
    "fd, four times faster": ("--fd", "--fd-ratio", 4),
    "fd": ("--fd",),
    "no seals": ("--no-seal",),
    "another base": ("--base", "0x14FFA000", "--node-id", 253),
    "11 bits": ("--base", "0x680", "--node-id", 3),
    "11 bits, fd": ("--base", "0x680", "--node-id", 0, "--fd"),
    "16 nodes with 11 bits": ("--base", "0x600", "--node-id", 15, "--force-base"),
}


@pytest.mark.parametrize("options", KINDS.values(), ids=KINDS)
def test_everything_arrives_bit_for_bit(options: tuple[object, ...], start: Start, tmp_path: Path) -> None:
    """Samples and theta through a bus that loses one frame in fifty."""
    node = start(*NODE, *options, "--dump", tmp_path / "theta.f32")
    relay = Relay([node.first_line()], drop_any(0.02))
    base = options[:2] if options[0] == "--base" else ()
    outputs = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz", *base)
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
    """Lose this share of all frames, whatever their letter: T, t, and B, b of CAN FD."""
    lose = drop(share, 5)
    return lambda line: [line] if lose(b"T" + line[1:] if line[:1] in b"Bbt" else line) else []


def test_a_listener_at_another_base_hears_nobody(start: Start, tmp_path: Path) -> None:
    """Frames of somebody else: counted, one sentence, code 3."""
    node = start(*NODE, "--base", "0x680", "--node-id", 3)
    ended, facts = listen(node.first_line(), tmp_path, "--seconds", 3)
    assert ended.code == 3 and "none from a node" in ended.err
    assert facts["foreign"] == facts["frames"] != 0
