"""Equations start where a recording shows them to: first states that the file leaves free are estimated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid.identify.free_run import run_free
from aeolid.identify.validation import validate_model
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.start import with_estimated_start
from aeolid.record import Channel, Record

STEP, ROWS, NOISE = 0.02, 2000, 1e-3
TEXT = """[model]
name = "pendulum"
time = "continuous"
[parameters]
c = { value = 0.05, unit = "1/s" }
[[input]]
name = "push"
unit = "1/s^2"
[[state]]
name = "q"
unit = "rad"
derivative = "v"
initial = { value = 0.0, free = true }
[[state]]
name = "v"
unit = "rad/s"
derivative = "push - 9.0*sin(q) - c*v"
initial = { value = 0.0, free = true }
[[output]]
name = "angle"
unit = "rad"
equation = "q"
"""


@pytest.fixture
def model(tmp_path: Path) -> Equations:
    path = tmp_path / "model.toml"
    path.write_text(TEXT)
    return equations_file.load(path)


def recorded(model: Equations, q: float, v: float, noise: float = NOISE) -> Record:
    """Return a recording of the model's own motion from q, v."""
    rng = np.random.default_rng(3)
    push = np.repeat(rng.standard_normal(ROWS // 25), 25)
    channels = (Channel("push", "1/s^2", "input"), Channel("angle", "rad", "output"))
    blank = Record(STEP * np.arange(ROWS), np.column_stack([push, np.zeros(ROWS)]), channels, STEP, "made", "")
    moved = replace(model, states=tuple(replace(s, initial=x) for s, x in zip(model.states, (q, v), strict=True)))
    y = moved.simulate(blank)[:, 0] + noise * rng.standard_normal(ROWS)
    return replace(blank, values=np.column_stack([push, y]))


def first_states(model: Equations) -> list[float]:
    return [s.initial for s in model.states]


def test_a_start_in_motion_is_found(model: Equations) -> None:
    """Of 500 rows with noise σ a state of the angle's size is known to about σ √(2/500); six of these are asked."""
    record = recorded(model, 1.2, -2.0)
    found = first_states(with_estimated_start(model, record))
    assert found[0] == pytest.approx(1.2, abs=6 * NOISE * np.sqrt(2 / 500))
    assert found[1] == pytest.approx(-2.0, abs=6 * 3.0 * NOISE * np.sqrt(2 / 500))  # ω = 3 rad/s
    run = run_free(model, record)
    assert run.start == pytest.approx({"q": found[0], "v": found[1]})
    assert run.score is not None and run.score.nrmse["angle"] < 0.01
    still = run_free(model, record, "model").score
    assert still is not None and still.nrmse["angle"] > 0.5
    assert validate_model(model, record).free_run.nrmse["angle"] == run.score.nrmse["angle"]


def test_missing_samples_are_left_out(model: Equations) -> None:
    record = recorded(model, 0.4, 1.0)
    values = record.values.copy()
    values[:40, 1] = values[300:320, 1] = np.nan
    found = first_states(with_estimated_start(model, replace(record, values=values)))
    assert found == pytest.approx([0.4, 1.0], abs=0.002)


def test_what_the_file_holds_stays(model: Equations) -> None:
    record = recorded(model, 1.2, -2.0)
    held = replace(model, states=tuple(replace(s, initial_free=False) for s in model.states))
    assert with_estimated_start(held, record) is held
    half = replace(model, states=(model.states[0], replace(model.states[1], initial_free=False)))
    assert first_states(with_estimated_start(half, record))[1] == 0.0
    assert run_free(model, record, "model").start == {}
    at_zero = replace(model, states=tuple(replace(s, initial=0.5) for s in model.states))
    np.testing.assert_array_equal(run_free(at_zero, record, "zero").y, run_free(model, record, "model").y)


def test_nothing_to_go_by_changes_nothing(model: Equations) -> None:
    record = recorded(model, 1.2, -2.0)
    assert (
        with_estimated_start(model, replace(record, values=record.values[:, :1], channels=record.channels[:1])) is model
    )
    lost = record.values.copy()
    lost[:, 1] = np.nan
    assert with_estimated_start(model, replace(record, values=lost)) is model
    gone = record.values.copy()
    gone[700, 0] = np.nan
    assert with_estimated_start(model, replace(record, values=gone)) is model
    exact = recorded(model, 0.0, 0.0, noise=0.0)
    assert with_estimated_start(model, exact) is model


def test_a_model_that_runs_away_keeps_its_start(model: Equations, tmp_path: Path) -> None:
    path = tmp_path / "wild.toml"
    path.write_text(TEXT.replace("push - 9.0*sin(q) - c*v", "push + 9.0*q**3 + v**2"))
    wild = equations_file.load(path)
    wild = replace(wild, states=(replace(wild.states[0], initial=50.0), wild.states[1]))
    record = recorded(model, 1.2, -2.0)
    found = with_estimated_start(wild, record)
    assert all(np.isfinite(first_states(found)))
