"""Values of the free run are told where one-step predictions are sure and wrong; deviations know coloured errors."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.estimate import Estimate, estimate
from aeolid.diagnose.validation.run_values import block_std, memory, runs_clearly_better
from aeolid.models.equations_file import from_toml
from aeolid.models.recursion import run_states
from aeolid.record import Channel, Record
from aeolid.text_files import parse_toml

LAW = """
[model]
name = "torque law"
[parameters]
K = { value = 4.4e-4, min = 1e-4, max = 1e-3, unit = "N m/rpm^2", free = true }
[[input]]
name = "speed"
unit = "rpm"
[[output]]
name = "torque"
unit = "N m"
equation = "K*speed**2"
"""
TRUE, STEP = 3.7e-4, 0.1


def coloured(rng: np.random.Generator, samples: int, memory_rows: float, size: float) -> np.ndarray:
    """Return an AR(1) of a deviation."""
    a = np.exp(-1 / memory_rows)
    e = size * np.sqrt(1 - a**2) * rng.standard_normal((samples, 1))
    return run_states(np.array([[a]]), e, size * rng.standard_normal(1))[:-1, 0]


def lagging(seed: int, lag_s: float, samples: int = 3000) -> Record:
    """Return a law whose speed is smoothed by the controller's filter before it acts: what the equation leaves out."""
    rng = np.random.default_rng(seed)
    speed = 1000 + coloured(rng, samples, 200, 100.0) + coloured(rng, samples, 3, 2.0)
    a = np.exp(-STEP / lag_s)
    acting = run_states(np.array([[a]]), (1 - a) * speed[:, None], speed[:1])[:-1, 0]
    torque = TRUE * acting**2 + 0.2 * rng.standard_normal(samples)
    channels = (Channel("speed", "rpm", "input"), Channel("torque", "N m", "output"))
    return Record(STEP * np.arange(samples), np.column_stack([speed, torque]), channels, STEP, f"seed {seed}", "")


def found(*records: Record) -> Estimate:
    model = from_toml(parse_toml(LAW, "law.toml"), LAW, "law.toml")
    return estimate(make_case(records, model, title="law", source="law.toml", sha256=""))


def test_a_lag_that_the_law_leaves_out_does_not_bend_its_constant() -> None:
    """One-step predictions see only how fast the torque moves, a lag behind: their constant is far too small."""
    e = found(lagging(1, 1.0))
    (value,), (other,) = e.values, e.others
    assert e.by_run and abs(value.value - TRUE) < 3 * value.std < 0.03 * TRUE
    assert abs(other.value - TRUE) > 10 * other.std
    assert "one-step predictions give K" in e.summary() and e.to_json()["values_of"] == "free run"
    assert e.to_json()["contradicted_by"][0]["value"] == other.value
    assert e.model.parameters[0].value == value.value
    (check,) = e.checks
    assert check.fitted_free < 0.3 * check.declared_free  # the lag itself stays, 17 N m


def test_of_a_law_that_is_right_predictions_are_told() -> None:
    e = found(lagging(2, 0.001))
    assert not e.by_run and e.others == () and abs(e.values[0].value - TRUE) < 4 * e.values[0].std
    assert "free run;" not in e.summary() and e.to_json()["values_of"] == "predictions"


@pytest.mark.parametrize("rows", [0.1, 20.0])
def test_deviations_of_a_run_are_those_of_many_draws(rows: float) -> None:
    """Of a slope under white and coloured errors: 400 draws know a deviation to 4 %, blocks know it to 13 %."""
    rng, samples = np.random.default_rng(1), 4000
    x = coloured(rng, samples, 10.0, 1.0)
    J, estimates, told = x[:, None], [], []
    for _ in range(400):
        y = coloured(rng, samples, rows, 1.0)
        slope = float(x @ y / (x @ x))
        estimates.append(slope)
        fit = SimpleNamespace(jacobian=J, residual=y - slope * x, prior_jacobian=np.zeros((0, 1)))
        told.append(block_std(fit, 1)[0])  # type: ignore[arg-type]
    assert np.sqrt(np.mean(np.square(told))) == pytest.approx(np.std(estimates), rel=0.15)
    plain = 1 / np.sqrt(x @ x)
    assert rows < 1 or np.mean(told) > 2 * plain  # white-noise deviations are far too small then


def test_a_value_that_nothing_shows_has_no_deviation() -> None:
    fit = SimpleNamespace(jacobian=np.zeros((100, 1)), residual=np.ones(100), prior_jacobian=np.zeros((0, 1)))
    assert np.isinf(block_std(fit, 1)).all()  # type: ignore[arg-type]


def test_memory_is_the_time_to_a_correlation_of_one_over_e() -> None:
    errors = coloured(np.random.default_rng(3), 100_000, 50.0, 1.0)
    assert memory(errors[:, None]) == pytest.approx(50, rel=0.15)
    assert memory(np.zeros((10, 1))) >= 1


def test_a_run_that_diverges_is_never_the_better() -> None:
    ones, gone = np.ones((400, 1)), np.full((400, 1), np.nan)
    assert not runs_clearly_better(ones, gone, np.ones(1)) and runs_clearly_better(gone, ones, np.ones(1))
    assert not runs_clearly_better(ones, ones, np.ones(1))
    rng = np.random.default_rng(0)
    worse = 2 * rng.standard_normal((400, 1))
    assert runs_clearly_better(worse, 0.5 * worse, np.ones(1))


def test_where_the_two_exclude_each_other_and_neither_is_proven_the_band_reaches_between(monkeypatch) -> None:
    monkeypatch.setattr("aeolid.diagnose.validation.told_values.runs_clearly_better", lambda *given: False)
    e = found(lagging(1, 1.0))
    (value,), (other,) = e.values, e.others
    assert not e.by_run and e.to_json()["values_of"] == "predictions"
    assert value.std == pytest.approx(0.5 * abs(other.value - value.value))
    assert "a fit of the free run gives K" in e.summary()
