"""Stream from a node without inputs to modes with their bands: all filters, recording, replay and monitor."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import Process, listen

import aeolid as ae
from aeolid.cli.main import main
from aeolid.formats import read_record, write_table
from aeolid.record import Roles

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
from shaken_plant import DRIVE_TRAIN, ROTOR_RPM, STEP_S, THRICE_HZ, TOWER, UNITS, shake

Start = Callable[..., Process]
TRUE = {"tower fore-aft": TOWER, "drive train": DRIVE_TRAIN}
TEN_MINUTES = 6000


def play(start: Start, folder: Path, y: np.ndarray, units: dict[str, str], *options: object) -> dict[str, Any]:
    """Let a node play outputs on a virtual bus; returns what a listener reports that logs all frames."""
    write_table(folder / "plant.csv", dict(zip(units, y.T, strict=True)), {})
    (folder / "plant.toml").write_text(
        f"[recording]\nsample_time_s = {STEP_S}\n"
        + "".join(f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "output"\n' for n, u in units.items())
    )
    node = start("node", "--recording", folder / "plant.csv", "--roles", folder / "plant.toml", "--wait", "--share", 0,
                 "--speed", "max", "--snapshot-every", 60, *options)  # fmt: skip
    finished, facts = listen(node.first_line(), folder, "--until-end", "--no-modes", "--log", folder / "bus.log")
    finished.assert_clean()
    return facts


def check(facts: dict[str, Any], near: float = 0.03) -> dict[str, Any]:
    """Check both modes by name: near the truth, the truth within 3 deviations; returns the node's modes."""
    (node,) = facts["nodes"]
    assert node["inputs"] == [] and node["problem"] is None
    modes = node["modes"]
    assert modes["samples"] == TEN_MINUTES and modes["waiting"] is None
    for name, (hertz, damping) in TRUE.items():
        (found,) = [m for m in modes["modes"] if m["name"] == name]
        assert found["frequency_hz"] == pytest.approx(hertz, rel=near)
        assert abs(found["frequency_hz"] - hertz) < 3 * found["frequency_std_hz"]
        assert abs(found["damping"] - damping) < 3 * found["damping_std"]
    return dict(modes)


def test_ten_minutes_of_outputs_show_the_modes(
    start: Start, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A rotor that turns at 12 rpm shakes the tower thrice a turn: 3P is no mode. Recording, replay and page agree."""
    y = shake(TEN_MINUTES, 6, force=1.0) * [1.0, 0.1] + [0.0, ROTOR_RPM]
    units = {"tower_fore_aft": "m/s^2", "rotor_speed": "rpm"}
    facts = play(start, tmp_path, y, units, "--past", 40)
    assert facts["nodes"][0]["runs"][0]["lost_values"] == 0
    record, markov = tmp_path / "rec.csv", tmp_path / "markov.npz"
    finished, facts = listen(tmp_path / "bus.log", tmp_path, "--record", record, "--markov", markov)
    finished.assert_clean()
    modes = check(facts)
    (line,) = [m for m in modes["modes"] if m["rotor_order"]]
    assert line["name"] == "3P" and line["frequency_hz"] == pytest.approx(THRICE_HZ, rel=0.01)
    told = next(t for t in finished.out.splitlines() if "modes (damping)" in t)
    assert "tower fore-aft 0.3" in told and "drive train 1.6" in told and "3P" not in told
    assert "harmonics of the rotor or other steady sines: 0.6" in finished.out
    roles = tmp_path / "rec.roles.toml"
    received = read_record(record, Roles.load(roles))
    assert received.names("input") == () and received.names("output") == tuple(units)
    np.testing.assert_allclose(received.values, y, rtol=1e-6)  # binary32 on the wire
    offline = {m.name: m.frequency_hz for m in ae.modes(ae.read(record, roles=roles), past=40).modes}
    model = ae.identify(ae.read(record, roles=roles), markov=markov)
    for name, (hertz, _) in TRUE.items():
        assert offline[name] == pytest.approx(hertz, rel=0.03)
        assert any(m.name == name and abs(m.frequency_hz - hertz) < 0.03 * hertz for m in model.modes)
    assert main(["monitor", "--bus", str(tmp_path / "bus.log"), "--terminal"]) == 0
    text = "".join(capsys.readouterr())
    assert "tower fore-aft" in text and "drive train" in text and " … " in text and "0.6 Hz (3P)" in text


@pytest.mark.parametrize("method, forget", [("els", 1.0), ("fast-rls", 0.9997), ("lattice", 1.0)])
def test_every_filter_shows_them(method: str, forget: float, start: Start, tmp_path: Path) -> None:
    """Within 5 %: a filter that forgets knows 3,000 samples, and els estimates twice as many parameters."""
    play(start, tmp_path, shake(TEN_MINUTES, 7), UNITS, "--method", method, "--forget", forget, "--past", 20,
         "--innovations")  # fmt: skip
    finished, facts = listen(tmp_path / "bus.log", tmp_path)
    finished.assert_clean()
    check(facts, 0.05)
    json.loads((tmp_path / "listen.json").read_text(), parse_constant=pytest.fail)
