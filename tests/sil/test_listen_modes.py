"""Follow modes from a node on a virtual bus: a plant that changes, lost frames, two nodes, a node that starts again."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import flood_traffic
import numpy as np
import pandas as pd
import pytest
from harness import Relay, drop, listen
from test_listen import Endless

from aeolid.can import RunRecorder
from aeolid.can.reception import Reception
from aeolid.cli.listen_modes import ModeFollower
from aeolid.formats import write_table
from aeolid.identify.live import LiveModes
from aeolid.plants.moving_poles import CHANGE, simulate_moving_poles

ROLES = "[recording]\nsample_time_s = 1.0\n" + "".join(
    f'[[channel]]\nname = "{name}"\nunit = ""\nrole = "{role}"\n'
    for name, role in (("u1", "input"), ("u2", "input"), ("y1", "output"), ("y2", "output"))
)
FILTER = ("--past", 5, "--forget", 0.98, "--regularize", 0.01)


def plant(folder: Path, samples: int, change: str = "jump", seed: int = 5) -> tuple[object, ...]:
    """Write a recording; returns the options of a node that plays it."""
    record = simulate_moving_poles(samples, seed, change)
    write_table(folder / "plant.csv", {c.name: record.column(c.name) for c in record.channels}, {})
    (folder / "plant.toml").write_text(ROLES)
    return ("--recording", folder / "plant.csv", "--roles", folder / "plant.toml", *FILTER, "--wait")


def third_pole(table: pd.DataFrame, start: float, stop: float) -> float:
    """Return the mean of the pole near 0.5 or 0.65, the middle one of three, over a time."""
    part = table[(table.time_s >= start) & (table.time_s < stop)]
    poles = part.groupby("time_s").pole_real.apply(lambda p: np.sort(p)[1] if len(p) == 3 else np.nan)
    return float(poles.mean())


def test_poles_that_jump_are_followed_over_the_bus(start, tmp_path):
    """One of three poles goes from 0.5 to 0.65: within 250 samples the table has it (a filter remembers 50)."""
    node = start("node", *plant(tmp_path, 1400), "--speed", 200, "--share", 0, "--snapshot-every", 10)
    finished, facts = listen(
        node.first_line(), tmp_path, "--until-end", "--order", 3, "--poles", tmp_path / "p.parquet",
        "--poles-every", 5,
    )  # fmt: skip
    finished.assert_clean()
    table = pd.read_parquet(tmp_path / "p.parquet")
    assert third_pole(table, 300, CHANGE) == pytest.approx(0.5, abs=0.03)
    assert third_pole(table, CHANGE + 250, 1400) == pytest.approx(0.65, abs=0.03)
    json.loads((tmp_path / "listen.json").read_text(), parse_constant=pytest.fail)
    modes = facts["nodes"][0]["modes"]
    assert (modes["samples"], modes["missing"], modes["restarts"], modes["order"]) == (1400, 0, 0, 3)
    assert modes["time_s"] == 1399 and modes["no_deviations_because"] is None
    assert all(m["frequency_std_hz"] > 0 for m in modes["modes"])
    assert "modes over time" in finished.out and facts["poles"].endswith("p.parquet")


def test_lost_frames_and_a_silence_are_bridged(start, tmp_path):
    """One frame in 200 is lost, and all of samples 700 … 800: every loss empties the window, poles stay in place."""
    node = start("node", *plant(tmp_path, 1400, "none"), "--speed", 300, "--share", 0, "--snapshot-every", 20)
    lose, silent = drop(0.005, 3), iter(range(10**9))

    def damage(line: bytes) -> list[bytes]:
        at = next(silent)
        return [] if 9000 <= at < 10000 else lose(line)

    relay = Relay([node.first_line()], damage)
    finished, facts = listen(relay.address, tmp_path, "--until-end", "--order", 3)
    finished.assert_clean()
    modes = facts["nodes"][0]["modes"]
    assert modes["missing"] > 40 and modes["samples"] + modes["missing"] > 1390 and modes["restarts"] == 0
    poles = sorted(m["eigenvalue"][0] for m in modes["modes"])
    np.testing.assert_allclose(poles, [0.3, 0.5, 0.8], atol=0.12)


def test_two_nodes_are_followed_apart(start, tmp_path):
    nodes = [
        start("node", *plant(tmp_path, 900, "none"), "--speed", 300, "--share", 0, "--snapshot-every", 20),
        start("node", "--turbine", "--samples", 1500, "--past", 12, "--feedthrough", "pitch", "--wait", "--speed", 50,
              "--share", 0, "--node-id", 2),
    ]  # fmt: skip
    relay = Relay([node.first_line() for node in nodes])
    finished, facts = listen(relay.address, tmp_path, "--until-end")
    finished.assert_clean()
    first, second = (n["modes"] for n in facts["nodes"])
    assert len([m for m in first["modes"] if m["eigenvalue"][0] > 0.7]) == 1
    found = [m["frequency_hz"] for m in second["modes"] if abs(m["damping"]) < 0.2]
    for true in (0.444, 1.6795):
        assert min(abs(f - true) for f in found) < 0.02
    assert first["order"] <= 5 and second["order"] >= 6


def test_a_node_that_starts_again_is_followed_from_its_start(start, tmp_path):
    """A log of one run twice, one behind the other: the second counts from 0, its parameters are learnt anew."""
    node = start("node", *plant(tmp_path, 900), "--speed", "max", "--share", 0, "--snapshot-every", 20)
    options = ("--until-end", "--no-modes", "--log", tmp_path / "a.log")
    finished, facts = listen(node.first_line(), tmp_path, *options)
    finished.assert_clean()
    assert "modes" not in finished.out and facts["nodes"][0]["modes"] is None
    (tmp_path / "both.log").write_text(2 * (tmp_path / "a.log").read_text())
    finished, facts = listen(tmp_path / "both.log", tmp_path, "--order", 3, "--poles", tmp_path / "p.csv")
    finished.assert_clean()
    modes, runs = facts["nodes"][0]["modes"], facts["nodes"][0]["runs"]
    assert [run["samples"] for run in runs] == [900, 900]
    assert (modes["restarts"], modes["samples"], modes["time_s"]) == (1, 900, 899)
    assert sorted(m["eigenvalue"][0] for m in modes["modes"])[1] == pytest.approx(0.65, abs=0.1)
    times = pd.read_csv(tmp_path / "p.csv").time_s.to_numpy()
    assert np.count_nonzero(np.diff(times) < 0) == 1


def test_what_stands_in_the_way_is_said(start, tmp_path):
    node = start("node", *plant(tmp_path, 300, "none"), "--speed", "max", "--share", 0, "--sample-every", 2)
    finished, facts = listen(node.first_line(), tmp_path, "--until-end")
    finished.assert_clean()
    assert "no modes: the node sends one sample in 2" in " ".join(finished.out.split())
    assert facts["nodes"][0]["modes"]["modes"] == []


@pytest.mark.parametrize(
    "options, words",
    [
        (("--no-modes", "--poles", "p.csv"), "--poles needs modes"),
        (("--no-modes", "--order", 3), "--order needs modes"),
        (("--poles", "p.txt"), "p.txt: the suffix is none of"),
        (("--poles", "nowhere/p.csv"), "the folder nowhere does not exist"),
        (("--poles-every", 0), "--poles-every 0.0: a time above 0"),
        (("--order", 0), "--order 0: at least one state"),
    ],
)
def test_wrong_options_are_named(tmp_path, options, words):
    finished, _ = listen("tcp:1", tmp_path, *options)
    finished.assert_clean(2)
    assert words in " ".join(finished.err.split())


def test_memory_stays_flat_while_modes_are_followed(tmp_path):
    """60,000 samples of a node without snapshots: what is held does not grow, and every sample is taken."""
    source = Endless(60_000)
    follower = ModeFollower(None, None, every_s=1.0, patient=True)
    tracemalloc.start()
    try:
        reception = Reception(source, RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
        reception.watch = follower.look
        assert reception.run(lambda: False, None, False) == "enough"
    finally:
        tracemalloc.stop()
        follower.finish()
    early, late = source.memory[10:20], source.memory[-10:]
    assert max(late) - max(early) < 500_000
    facts = follower.facts(flood_traffic.NODE)
    assert facts is not None and isinstance(follower._nodes[flood_traffic.NODE].live, LiveModes)
    assert (facts["samples"], facts["missing"], facts["left_out"]) == (62_000, 0, 0)
