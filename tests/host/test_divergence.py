"""A free run that diverges is told as one: in simulate, validate and diagnose, in files and on the screen."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.cli.main import main
from aeolid.diagnose.conclusion import export
from aeolid.diagnose.conclusion.correction import Correction
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.validation.divergent import diverging
from aeolid.models import equations_file
from aeolid.models.divergence import FAR, divergence_of, growing
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record
from aeolid.report.diagnosis import render_diagnosis

Array = NDArray[np.float64]
N, STEP = 600, 0.1
SPEED = (Signal("speed", "rpm"),)


def recording(speed: Array, drive: Array | None = None) -> Record:
    time = STEP * np.arange(len(speed))
    u = np.sin(0.3 * time) if drive is None else drive
    channels = (Channel("drive", "V", "input"), Channel("speed", "rpm", "output"))
    return Record(time, np.column_stack([u, speed]), channels, STEP, "recording.csv", "0" * 64)


WALK = np.cumsum(np.random.default_rng(1).normal(size=N))


@pytest.mark.parametrize(
    ("run", "sample", "stays"),
    [
        (1.1 ** np.arange(N), 61, True),
        (np.where(np.arange(N) < 20, 1e4, WALK), 1, False),
        (np.where(np.arange(N) < 300, WALK, -1e6 * (-1.0) ** np.arange(N)), 301, True),
        (np.where(np.arange(N) < 100, WALK, np.nan), 101, True),
        (np.where(np.arange(N) == 599, np.inf, WALK), 600, True),
    ],
    ids=["grows", "starts wrong", "swings", "not a number", "infinite at last"],
)
def test_where_an_output_leaves_is_found(run: Array, sample: int, stays: bool) -> None:
    record = recording(WALK)
    found = divergence_of(run[:, None], record, SPEED)
    assert found is not None
    (leaving,) = found.leaving
    if sample == 61:  # the first power of 1.1 beyond ten recorded ranges above the recorded maximum
        sample = int(np.argmax(run > WALK.max() + FAR * np.ptp(WALK))) + 1
    assert (leaving.sample, leaving.stays) == (sample, stays)
    assert f"sample {sample} " in found.text() and "speed" in found.text()
    assert json.loads(json.dumps(found.to_json(), allow_nan=False))["outputs"][0]["sample"] == sample


@pytest.mark.parametrize("drift", [0.0, 1.0, 5.0, -9.0])
def test_a_drift_of_some_ranges_and_a_signal_that_never_moved_are_no_divergence(drift: float) -> None:
    """An integrator, or an operating point that is off, ends ranges away; that is an error, which the scores tell."""
    run = WALK + drift * np.ptp(WALK) * np.linspace(0, 1, N)
    assert divergence_of(run[:, None], recording(WALK), SPEED) is None
    assert divergence_of(run[:, None], recording(np.zeros(N)), SPEED) is None


def test_an_eigenvalue_counts_where_its_mode_grows_tenfold_within_the_run() -> None:
    for size, samples, diverges in ((1.0, 10**6, False), (1.001, 2000, False), (1.001, 2400, True), (0.999, 9, False)):
        pole, tenfold = growing(np.array([[size, 1.0], [0.0, 0.5]]), samples)
        assert (pole is not None) == diverges
        assert tenfold is None or size**tenfold == pytest.approx(FAR)


def unstable(folder: Path, kind: str, size: float = 1.6) -> list[str]:
    """Write a recording and a model whose free run grows `size`-fold a sample; returns MODEL REC --roles R."""
    rng = np.random.default_rng(2)
    drive, speed = rng.normal(size=N), 0.1 * np.cumsum(rng.normal(size=N))
    rows = np.column_stack([STEP * np.arange(N), drive, speed])
    np.savetxt(folder / "rec.csv", rows, delimiter=",", header="time_s,drive,speed", comments="")
    (folder / "roles.toml").write_text(
        '[recording]\ntime = "time_s"\n[[channel]]\nname = "drive"\nunit = "V"\nrole = "input"\n'
        '[[channel]]\nname = "speed"\nunit = "rpm"\nrole = "output"\n'
    )
    if kind == "equations":
        (folder / "model.toml").write_text(
            f'[model]\nname = "m"\ntime = "discrete"\nsample_time_s = {STEP}\n[parameters]\na = {size}\n[[state]]\n'
            'name = "x"\nnext = "a*x + drive"\n[[output]]\nname = "speed"\nunit = "rpm"\nequation = "x"\n'
        )
        return [str(folder / "model.toml"), str(folder / "rec.csv"), "--roles", str(folder / "roles.toml")]
    facts: dict[str, Any] = {
        "kind": "state_space", "sample_time_s": STEP, "inputs": [{"name": "drive", "unit": "V"}],
        "outputs": [{"name": "speed", "unit": "rpm"}], "states": ["x"], "A": [[size]], "B": [[1.0]], "C": [[1.0]],
        "D": [[0.0]], "K": [[size - 0.5]] if kind == "with noise" else None, "x0": [0.0],
    }  # fmt: skip
    (folder / "model.json").write_text(json.dumps(facts))
    return [str(folder / "model.json"), str(folder / "rec.csv"), "--roles", str(folder / "roles.toml")]


@pytest.mark.parametrize("kind", ["equations", "plain", "with noise"])
@pytest.mark.parametrize("command", ["simulate", "validate"])
def test_simulate_and_validate_say_that_a_run_diverges(
    command: str, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = unstable(tmp_path, kind)
    out = ["--out", str(tmp_path / "sim.csv")] if command == "simulate" else []
    assert main([command, *arguments, *out]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "WARNING: speed leaves 10 times its recorded range at sample " in said and "the free run diverges" in said
    assert ("unstable" in said) == (kind != "equations")
    assert main([command, *arguments, *out, "--json", "-"]) == 0
    captured = capsys.readouterr()
    facts = json.loads(captured.out)["divergence"]
    assert "WARNING: speed leaves" in captured.err and facts["outputs"][0]["output"] == "speed"
    assert facts["outputs"][0]["stays"] and facts["outputs"][0]["sample"] < 120


def test_simulate_writes_no_value_that_is_not_finite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = unstable(tmp_path, "plain", 10.0)
    assert main(["simulate", *arguments, "--out", str(tmp_path / "sim.csv")]) == 0
    said = capsys.readouterr().out
    assert "leaves the finite numbers" in said and "left empty" in said
    text = (tmp_path / "sim.csv").read_text().lower()
    assert "inf" not in text and "nan" not in text and text.splitlines()[-1].endswith(",")
    assert main(["simulate", *unstable(tmp_path, "equations", 10.0), "--out", str(tmp_path / "sim.csv")]) == 3
    assert "leaves the finite numbers at sample" in capsys.readouterr().err


def test_a_stable_model_and_an_integrator_are_not_accused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for size in (0.9, 1.0):
        for kind in ("equations", "plain"):
            arguments = unstable(tmp_path, kind, size)
            assert main(["simulate", *arguments, "--out", str(tmp_path / "sim.csv"), "--json", "-"]) == 0
            captured = capsys.readouterr()
            assert json.loads(captured.out)["divergence"] is None and "WARNING" not in captured.err


def test_a_corrected_model_that_diverges_says_so_in_every_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The model is written with the sentence first; diagnosis.json and the report have it, the model's name a mark."""
    model_file = unstable(tmp_path, "equations")[0]
    model = equations_file.load(model_file)
    wild = diverging(model, [recording(WALK)])
    assert wild is not None and "recording.csv" in wild.text()
    monkeypatch.setattr(export, "correct", lambda _: Correction(model, None, wild))
    monkeypatch.setattr(export, "evidence", lambda _: {"title": "bench"})
    diagnosis: dict[str, Any] = {"schema": 1, "verdict": "unnamed", "statement": "something"}
    export.write_all(SimpleNamespace(deadline=Deadline()), diagnosis, tmp_path / "out")  # type: ignore[arg-type]
    written = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert written["model"]["divergence"]["outputs"][0]["output"] == "speed"
    assert written["warnings"] == [wild.text()]
    text = (tmp_path / "out" / "model" / "model.toml").read_text()
    assert text.startswith("# WARNING: The corrected model diverges in a free run")
    assert equations_file.load(tmp_path / "out" / "model" / "model.toml").theta.tolist() == model.theta.tolist()
    render_diagnosis(written, {"title": "bench"}, tmp_path / "report.html")
    assert "The corrected model diverges in a free run" in (tmp_path / "report.html").read_text()


def test_a_corrected_model_that_holds_is_not_accused(tmp_path: Path) -> None:
    assert diverging(equations_file.load(unstable(tmp_path, "equations", 0.9)[0]), [recording(WALK)]) is None
