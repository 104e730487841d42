"""Typical sizes of hidden states, and what depended on them: a wind's noise, the bank, a better baseline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.conclusion.declared import Moved
from aeolid.diagnose.data.case import Case, load_case
from aeolid.diagnose.predictor.gains import kalman_gain
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.scoring import directions, scores
from aeolid.diagnose.structure.magnitudes import visible_sizes
from aeolid.models import equations_file
from aeolid.models.equations import Parameter
from aeolid.models.integrate import Compiled, compile_equations, numeric_jacobian, simulate
from aeolid.models.state_space import StateSpace

rig = load_study("rigs/turbine")
STEP = 0.05
_MODEL = """
[model]
name = "a body that a hidden force pushes"
[[state]]
name = "q"
derivative = "v"
[[state]]
name = "v"
derivative = "-4*q - 0.5*v + 1e4*f + u"
[[state]]
name = "f"
derivative = "-0.2*f"
[[state]]
name = "unseen"
initial = {{ value = {unseen}, free = false }}
derivative = "-unseen"
[[output]]
name = "y"
equation = "q"
"""


def body(tmp_path: Path, unseen: float = 0.0) -> Compiled:
    path = tmp_path / "model.toml"
    path.write_text(_MODEL.format(unseen=unseen))
    return compile_equations(equations_file.load(path))


def test_a_state_that_starts_at_its_size_moves_an_output_by_its_spread(tmp_path: Path) -> None:
    """The law that defines the size; the force starts at nothing, no input moves it, and it shows late."""
    compiled, spread = body(tmp_path), 0.03
    sizes = visible_sizes(compiled, np.zeros(1), np.array([spread]), STEP, 15.0)
    assert sizes[3] == 1.0  # nothing shows it
    for i in range(3):
        x0 = np.zeros(4)
        x0[i] = sizes[i]
        y = simulate(compiled, np.zeros((300, 1)), compiled.model.theta, x0, STEP)
        assert np.max(np.abs(y)) == pytest.approx(spread, rel=1e-3)  # of the integration


def test_of_what_nothing_shows_the_start_value_tells_the_size(tmp_path: Path) -> None:
    sizes = visible_sizes(body(tmp_path, unseen=7.0), np.zeros(1), np.ones(1), STEP, 15.0)
    assert sizes[3] == 7.0


@pytest.fixture(scope="module")
def turbine(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    trial = next(t for t in rig.trials() if t.name == "torque not connected" and t.kind == "equations")
    return prepare(load_case(rig.write_case(tmp_path_factory.mktemp("turbine"), trial, 2000, 11)))


def test_the_wind_of_a_turbine_is_found_in_its_own_state(turbine: Prepared) -> None:
    """It is no input and starts at 0. Its kicks are 0.157 m/s a sample, the speed sensor's noise 0.001 rad/s.

    A factor of two is left to the other noises; at the size it had before, it was 1e-10 of that.
    """
    model, point, scales = turbine.extended, turbine.fit.point, turbine.predictor.scales
    wind = [s.name for s in model.states].index("wind_speed")
    speed = len(model.states) + [o.name for o in model.outputs].index("rotor_speed")
    kicks = point.noise[wind] * scales.x0[wind] / (point.noise[speed] * scales.spread[0])
    assert 0.5 < kicks / (0.157 / 0.001) < 2.0


def test_the_wind_is_no_body(turbine: Prepared) -> None:
    """Nothing but itself enters its equation: no friction, no stiffness can be missing there."""
    assert "state:omega" in {m.location for m in turbine.motions}
    assert "state:wind_speed" not in {m.location for m in turbine.motions}


def test_a_missing_input_stands_out_though_one_place_it_may_enter_is_dead(turbine: Prepared) -> None:
    """A place whose size was all but zero took the whole hypothesis out of the bank."""
    row = scores.score_bank(turbine, turbine.hypotheses, 1).rows[0]
    assert row.attachment.entry == "missing_coupling" and row.z > 15


def test_directions_that_say_the_same_are_left_out_whatever_their_units() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 40))
    kept = directions._independent(np.column_stack([a, b, a + b, 1e-6 * a, np.zeros(40)]))
    assert kept.sum() == 2 and not kept[4]
    assert directions._independent(np.zeros((40, 0))).size == 0


def test_a_baseline_is_not_bettered_by_what_it_holds_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hypothesis about a wrong inertia moves the inertia itself; carried over, it hid in the baseline."""
    fit = SimpleNamespace(point=Point(np.array([1.0, 2.0, 3.0]), np.zeros(0), None, ()))
    bare: Any = SimpleNamespace(fit=fit, free=SimpleNamespace(theta=(1,)), extended=None)
    monkeypatch.setattr("aeolid.diagnose.baseline.prepare.carry_point", lambda point, source, target: point)
    source: Any = None
    moved = Prepared.carried(bare, replace(fit.point, theta=np.array([10.0, 20.0, 30.0])), source)
    np.testing.assert_array_equal(moved.theta, [1.0, 20.0, 3.0])


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.3])
def test_a_faultless_sensor_counts_as_one_that_errs_by_a_hundredth(noise: float, tmp_path: Path) -> None:
    """Reference: scipy's Riccati equation with R = noise² + (0.3/100)², 0.3 what a sample's noise moves the sensor by.

    Tolerance: what scipy's own solution is good for where the sensor is nearly exact.
    """
    compiled = body(tmp_path)
    theta, u = compiled.model.theta, np.zeros(1)
    found = kalman_gain(
        compiled, (np.ones(4), np.ones(1), np.ones(4)), theta, np.array([0.3, 0.5, 0.0, 0.0, noise]), u, STEP
    )
    A = expm(numeric_jacobian(compiled, compiled.model.x0 + 1.0, u, theta) * STEP)
    C, Q = np.eye(4)[:1], np.diag([0.09, 0.25, 0.0, 0.0])
    R = np.array([[noise**2 + 0.003**2]])
    P = solve_discrete_are(A.T, C.T, 0.5 * (Q + A @ Q @ A.T), R)
    np.testing.assert_allclose(found, A @ P @ C.T / (C @ P @ C.T + R), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(("value", "at_end"), [(0.5, True), (2.0, True), (1.2, False)])
def test_a_declared_value_at_the_end_of_its_range_accuses_the_structure(value: float, at_end: bool) -> None:
    parameter = Parameter("k", 1.0, "", 0.5, 2.0, True)
    assert Moved(parameter, value, 0.01).at_end is at_end
    assert not Moved(Parameter("k", 1.0, ""), value, 0.01).at_end


def test_a_baseline_that_lacks_nothing_is_fitted_as_well_from_any_noise(tmp_path: Path) -> None:
    """The force's memory is found whatever the noises start from; asleep beside white noise it lost 110 nats of 3000.

    Tolerance: two nats of some thousand, what fits stop short of each other.
    """
    study = load_study("diagnosis")
    hidden = next(h for h in study.trials() if h.name.startswith("null, 0.5 N") and h.kind == "equations")
    prepared = prepare(load_case(study.write_case(tmp_path / "case", hidden, 3000, 1223)))
    rng = np.random.default_rng(5)
    for _ in range(3):
        noise = prepared.fit.point.noise.copy()
        noise[list(prepared.free.noise)] = 10 ** rng.uniform(-2, 0.5, len(prepared.free.noise))
        other = prepared.predictor.fit(replace(prepared.fit.point, noise=noise), prepared.free, 40)
        assert other is not None and other.log_likelihood < prepared.fit.log_likelihood + 2


@pytest.mark.parametrize(("drive", "reading"), [(2.0**30, 2.0**30), (2.0**-30, 2.0**30), (1.0, 2.0**-30)])
def test_a_linear_baseline_fits_alike_in_any_units(tmp_path: Path, drive: float, reading: float) -> None:
    """Powers of two scale exactly: the likelihood differs by the units alone, and the operating point moves with them.

    Offsets with a size of 1e-6 in whatever unit stayed where they were in units a thousand million times smaller, for
    7.4 nats. 1e-6 nats: the order in which sums round.
    """
    study = load_study("diagnosis")
    hidden = study.Hidden("null", "state_space", noise=(1.0, 0.02, 0.01))
    case = load_case(study.write_case(tmp_path, hidden, 1500, 5))
    plain, other = prepare(in_units(case, 1.0, 1.0)), prepare(in_units(case, drive, reading))
    rows = plain.fit.per_sample.size
    assert other.fit.log_likelihood + 2 * rows * np.log(reading) == pytest.approx(plain.fit.log_likelihood, abs=1e-6)
    found, units = by_name(other), {"bias_u1": drive, "bias_y1": reading, "bias_y2": reading}
    assert abs(by_name(plain)["bias_y2"]) > 0.05  # a speed has no offset but a sensor's
    for name, unit in units.items():
        assert found[name] / unit == pytest.approx(by_name(plain)[name], rel=1e-6), name


def by_name(prepared: Prepared) -> dict[str, float]:
    names = [p.name for p in prepared.extended.parameters]
    return dict(zip(names, prepared.fit.point.theta.tolist(), strict=True))


def in_units(case: Case, drive: float, reading: float) -> Case:
    """Move every channel off the declared operating point; write it, and the model, in other units."""
    (record,), model = case.records, case.baseline
    values, names = record.values.copy(), [c.name for c in record.channels]
    for name, offset, unit in (("drive", 0.3, drive), ("position", 0.2, reading), ("speed", -0.1, reading)):
        values[:, names.index(name)] = (values[:, names.index(name)] + offset) * unit
    assert isinstance(model, StateSpace) and model.K is None
    scaled = replace(model, B=model.B / drive, C=model.C * reading, D=model.D * reading / drive)
    return replace(case, baseline=scaled, records=(replace(record, values=values),))
