"""An output that is constant in a recording has no score: neither a bad one nor that of a run which diverges."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import aeolid as ae
from aeolid.cli.main import main
from aeolid.identify.fit import score
from aeolid.identify.free_run import run_free
from aeolid.identify.validation import validate_model
from aeolid.models.load import LinearModel
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

SAID = "no score: the recorded output is constant"
CHANNELS = (Channel("u", "1", "input"), Channel("y", "1", "output"), Channel("z", "1", "output"))


def model() -> LinearModel:
    """Return two lags of one input, with a Kalman gain."""
    return LinearModel(
        StateSpace(
            A=np.diag([0.9, 0.6]), B=np.ones((2, 1)), C=np.eye(2), D=np.zeros((2, 1)), K=0.1 * np.eye(2),
            x0=np.zeros(2), innovation_covariance=0.01 * np.eye(2), sample_time_s=0.1, inputs=(Signal("u", "1"),),
            outputs=(Signal("y", "1"), Signal("z", "1")), states=(Signal("a", "1"), Signal("b", "1")),
        )
    )  # fmt: skip


def recording(level: float | None, both: bool = False) -> Record:
    """Return a recording of the model with noise whose output y (and z) is held at a level."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal((600, 1))
    y = model().state_space.simulate(u) + 0.05 * rng.standard_normal((600, 2))
    if level is not None:
        y[:, : 2 if both else 1] = level
    return Record(0.1 * np.arange(600), np.hstack([u, y]), CHANNELS, 0.1, "bench.csv", "")


@pytest.mark.parametrize("level", [0.0, 0.1, -1e6 / 3])  # of 0.1 rounding leaves a variance of 1e-34
def test_a_constant_output_has_no_score_and_does_not_diverge(level: float) -> None:
    known, result = recording(level), validate_model(model(), recording(level), (5,))
    assert result.fit is not None
    for found in (run_free(model(), known).score, result.free_run, result.fit.one_step, result.fit.steps[5]):
        assert found is not None and found.constant == ("y",) and not found.diverges("y")
        assert found.text("y") == SAID and found.text("z").startswith("VAF ")
        facts = found.to_json()
        assert facts["constant"] == ["y"] and facts["vaf"]["y"] is None and facts["nrmse"]["y"] is None
        assert found.worst_vaf == found.vaf["z"]
    assert result.worst_nrmse("free-run") == result.free_run.nrmse["z"]  # no limit on what has no score
    assert f"free run  {SAID}" in result.summary() and "diverges" not in result.summary()
    assert not any(a.startswith("The model predicts y") for a in result.advice)


def test_missing_samples_leave_a_constant_one_and_what_moves_is_scored_as_ever() -> None:
    y = np.array([[2.0, 1.0], [np.nan, 2.0], [2.0, 3.0]])
    assert score(["y", "z"], y, y).constant == ("y",)
    moved = score(["y"], np.array([[2.0], [2.0 + 1e-9], [2.0]]), np.array([[0.0], [1.0], [2.0]]))
    assert moved.constant == () and moved.diverges("y") and "constant" not in moved.to_json()
    lost = score(["y"], np.arange(3.0)[:, None], np.array([[0.0], [np.inf], [2.0]]))
    assert lost.text("y") == "diverges" and np.isnan(lost.worst_vaf or 0.0)


def test_python_says_so(tmp_path: Path) -> None:
    one, both = recording(0.1), recording(0.0, both=True)
    (tmp_path / "m.json").write_text(json.dumps(model().state_space.to_json()), encoding="utf-8")
    told = [repr(run(str(tmp_path / "m.json"), known)) for known in (one, both) for run in (ae.simulate, ae.validate)]
    assert re.search(r"free-run fit \d+ %", told[0]) and re.search(r"one-step fit -?\d+ %", told[1]), told
    assert not any("inf" in t or "nan" in t for t in told), told
    assert "no free-run fit (constant outputs)" in told[2] and "no one-step fit (constant outputs)" in told[3]


@pytest.mark.parametrize("command", ["simulate", "validate", "identify"])
def test_commands_say_so(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.json").write_text(json.dumps(model().state_space.to_json()), encoding="utf-8")
    known = recording(0.1)
    np.savetxt(tmp_path / "r.csv", np.column_stack([known.time_s, known.values]), delimiter=",",
               header="time_s,u,y,z", comments="", fmt="%.9g")  # fmt: skip
    rows = "".join(f'[[channel]]\nname = "{c.name}"\nunit = "1"\nrole = "{c.role}"\n' for c in CHANNELS)
    (tmp_path / "roles.toml").write_text(f'[recording]\ntime = "time_s"\n{rows}', encoding="utf-8")
    files = [str(tmp_path / "r.csv"), "--roles", str(tmp_path / "roles.toml"), "--json", str(tmp_path / "f.json")]
    if command == "identify":
        assert main([command, *files, "--out", str(tmp_path / "n.json")]) == 4
        assert "channel 'y' is constant at 0.1" in capsys.readouterr().err
        return
    out = ["--out", str(tmp_path / "s.csv")] if command == "simulate" else []
    assert main([command, str(tmp_path / "m.json"), *files, *out]) == 0
    assert SAID in capsys.readouterr().out
    facts = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert facts["divergence"] is None and facts["free_run"]["constant"] == ["y"]
