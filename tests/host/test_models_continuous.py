"""Models taken to continuous time and to other sample times: the way back, the answers between, what cannot be."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import linalg

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.models.continuous import to_continuous, to_sample_time
from aeolid.models.load import discretise
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace


def turning(h: float) -> StateSpace:
    """Return an integrator, a lag and two modes that two inputs move, one with a feedthrough, sampled."""
    rng = np.random.default_rng(2)
    modes = [np.array([[0.0, w], [-w, -2 * z * w]]) for w, z in ((2.1, 0.05), (10.5, 0.02))]
    A = linalg.block_diag([[0.0]], [[-3.0]], *modes)
    T = rng.normal(size=(6, 6))
    model = StateSpace(
        T @ A @ np.linalg.inv(T), rng.normal(size=(6, 2)), rng.normal(size=(2, 6)), rng.normal(size=(2, 2)), None,
        np.zeros(6), None, 0.0, (Signal("u"), Signal("v")), (Signal("y"), Signal("z")),
        tuple(Signal(f"x{k}") for k in range(6)),
    )  # fmt: skip
    return discretise(model, h) if h else model


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_there_and_back_is_the_same_model(hold: str) -> None:
    model = turning(0.1)
    back = discretise(to_continuous(model, hold), 0.1, [hold, hold])
    for name in "ABCD":
        assert getattr(back, name) == pytest.approx(getattr(model, name), abs=1e-9), name


def test_of_a_sampled_model_comes_the_one_that_was_sampled() -> None:
    true, found = turning(0.0), to_continuous(turning(0.1))
    assert found.sample_time_s == 0
    for name in "ABCD":
        assert getattr(found, name) == pytest.approx(getattr(true, name), abs=1e-8), name


def test_a_held_input_is_answered_at_the_finer_samples_too() -> None:
    model = turning(0.1)
    u = np.random.default_rng(5).normal(size=(50, 2))
    fine = to_sample_time(model, 0.02).simulate(np.repeat(u, 5, axis=0))
    assert fine[::5] == pytest.approx(model.simulate(u), abs=1e-8)


def test_its_own_sample_time_changes_nothing() -> None:
    model = turning(0.1)
    assert to_sample_time(model, 0.1) is model
    np.testing.assert_array_equal(to_continuous(turning(0.0)).A, turning(0.0).A)


@pytest.mark.parametrize("pole, said", [(0.0, "delay of whole samples"), (-0.3, "-0.3, which swings")])
def test_a_pole_without_a_counterpart_is_named(pole: float, said: str) -> None:
    model = replace(turning(0.1), A=np.diag([0.9, pole, 0.5, 0.4, 0.3, 0.2]))
    with pytest.raises(UsageError, match=said):
        to_continuous(model)


@pytest.mark.parametrize("time", [0.0, -1.0, np.nan, 1e9])
def test_a_sample_time_that_is_none_is_refused(time: float) -> None:
    with pytest.raises(UsageError, match="time in seconds"):
        to_sample_time(turning(0.1), time)


def test_an_unknown_hold_is_refused() -> None:
    with pytest.raises(UsageError, match="neither zoh"):
        to_continuous(turning(0.1), "linear")


def test_the_command_and_python_write_the_same(tmp_path: Path) -> None:
    model = replace(turning(0.1), K=np.zeros((6, 2)), innovation_covariance=np.eye(2))
    (tmp_path / "model.json").write_text(json.dumps(model.to_json()))
    for name, options in {"s.json": ["--continuous"], "fast.json": ["--sample-time", "0.02"]}.items():
        facts = tmp_path / f"facts-{name}"
        command = ["convert", str(tmp_path / "model.json"), str(tmp_path / name), *options, "--json", str(facts)]
        assert main(command) == 0
        assert "own samples" in json.loads(facts.read_text())["notes"][0]
    read = ae.load_model(tmp_path / "model.json")
    written = {name: ae.load_model(tmp_path / name) for name in ("s.json", "fast.json")}
    np.testing.assert_allclose(written["s.json"].state_space.A, read.to_continuous().state_space.A, atol=1e-12)
    assert written["fast.json"].sample_time_s == read.to_sample_time(0.02).sample_time_s == 0.02
    assert written["s.json"].eigenvalues.real.max() < 1e-6
    assert [m.frequency_hz for m in written["s.json"].modes] == pytest.approx([m.frequency_hz for m in read.modes])


def test_an_observer_keeps_its_sample_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = replace(turning(0.1), K=np.zeros((6, 2)), innovation_covariance=np.eye(2))
    (tmp_path / "model.json").write_text(json.dumps(model.to_json()))
    assert main(["convert", str(tmp_path / "model.json"), str(tmp_path / "o.h"), "--sample-time", "0.05"]) == 2
    assert "Kalman gain was made for" in capsys.readouterr().err.replace("\n", " ")
    assert main(["convert", str(tmp_path / "model.json"), str(tmp_path / "o.h"), "--continuous"]) == 2
