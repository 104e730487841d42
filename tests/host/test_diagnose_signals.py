"""Laws of the places that are recorded signals: coordinates, derivatives, signs, modes behind a static law."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from small_cases import write_case

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.hypotheses.parts.base import Site
from aeolid.diagnose.hypotheses.parts.response_modes import behind_static
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.selection.first_effect import settled_stage
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.signals import balances_forces, motions_of_signals, static_outputs
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate

Array = NDArray[np.float64]
STEP, ROWS = 0.01, 1500
LAW = """[model]
name = "a static law"
[parameters]
k = {{ value = 2.0, free = true }}
{inputs}
[[output]]
name = "load"
unit = "N"
equation = "{equation}"
"""


def law(folder: Path, equation: str, **units: str) -> Equations:
    """Return a model without states: its inputs with their units, one output."""
    file, inputs = folder / "model.toml", "".join(f'[[input]]\nname = "{n}"\nunit = "{u}"\n' for n, u in units.items())
    file.write_text(LAW.format(inputs=inputs, equation=equation))
    return equations_file.load(file)


def swing(seed: int, size: float = 1.0) -> tuple[Array, Array]:
    """Return a position and its exact velocity: a sum of sines below 2 Hz."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(ROWS)
    w, phase = 2 * np.pi * rng.uniform(0.1, 2.0, 7), rng.uniform(0, 6, 7)
    return size * np.sin(np.outer(t, w) + phase).sum(axis=1), size * (np.cos(np.outer(t, w) + phase) * w).sum(axis=1)


def motions(model: Equations, u: Array, y: Array) -> tuple[tuple[Motion, ...], Equations]:
    return motions_of_signals(model, (), (Segment(u, y[:, None], STEP, "bench", 0.0, 0),), {})


def test_only_what_depends_on_no_state_is_static(tmp_path: Path) -> None:
    model = law(tmp_path, "k*stroke", stroke="mm")
    assert static_outputs(model) == [0]
    file = tmp_path / "moving.toml"
    file.write_text(
        '[model]\nname = "m"\n[parameters]\na = { value = 1.0 }\n[[state]]\nname = "x"\nderivative = "u - a*x"\n'
        '[[output]]\nname = "y"\nequation = "x + u"\n[[output]]\nname = "z"\nequation = "a*u"\n'
    )
    assert static_outputs(equations_file.load(file)) == [1]


def test_recorded_velocity_is_paired_and_brought_to_the_positions_unit(tmp_path: Path) -> None:
    q, v = swing(1)
    model = law(tmp_path, "k*angle + 0*shaft_speed", angle="rad", shaft_speed="rpm")
    found, extended = motions(model, np.column_stack([q, v * 60 / (2 * np.pi)]), 2 * q)
    (motion,) = found
    known = {"angle": q, "shaft_speed": v * 60 / (2 * np.pi)}
    assert np.allclose(ex.values_of(motion.velocity, known), v, atol=0.01 * v.std())
    assert not extended.memories
    assert motion.mass is None
    assert motion.recorded is not None


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_derived_velocity_has_no_delay(tmp_path: Path, noise: float) -> None:
    """The slope of a parabola through three rows errs by (w h)^2/3 of it, 0.5 % at 2 Hz; behind noise, too, no lag."""
    q, v = swing(2)
    seen = q + noise * q.std() * np.random.default_rng(3).standard_normal(ROWS)
    found, extended = motions(law(tmp_path, "k*stroke", stroke="mm"), seen[:, None], 2 * q)
    shown = ex.parse("stroke_rate", "test")
    model = Equations(
        "velocity", 0.0, extended.parameters, (), (type(extended.outputs[0])("v", "mm/s", shown),), extended.inputs,
        extended.symbols, (), (), extended.memories,
    )  # fmt: skip
    told = simulate(compile_equations(model), seen[:, None], model.theta, model.x0, STEP)[:, 0]
    assert isinstance(found[0].velocity, ast.Name)
    late = [float(np.sum((told[50:-50] - np.roll(v, k)[50:-50]) ** 2)) for k in (-2, -1, 0, 1, 2)]
    assert int(np.argmin(late)) == 2
    assert noise or np.std(told[50:] - v[50:]) < 0.01 * v.std()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_resists_is_a_force_with_the_recorded_sign(tmp_path: Path, sign: float) -> None:
    """A recorded drive grows with friction, a recorded reaction falls; forces and output stay one equation."""
    q, v = swing(4)
    model = law(tmp_path, "k*stroke", stroke="mm", rate="mm/s")
    motion = motions(model, np.column_stack([q, v]), sign * (3 * q + 2 * v))[0][0]
    pushed = motion.inject(model, ex.parse("-0.5*rate", "friction"), "friction")
    change = ex.values_of(pushed.outputs[0].equation, {"k": 2.0, "stroke": q, "rate": v}) - 2.0 * q
    assert np.allclose(change, sign * 0.5 * v)
    assert np.allclose(ex.values_of(motion.forces, {"k": 2.0, "stroke": q}), -sign * 2.0 * q)


def test_two_positions_have_a_difference(tmp_path: Path) -> None:
    (a, va), (b, vb) = swing(5), swing(6)
    model = law(tmp_path, "k*(upper - lower)", upper="mm", lower="mm")
    found, _ = motions(model, np.column_stack([a, b]), a - b)
    assert [m.location for m in found] == ["motion:upper", "motion:lower", "motion:upper-lower"]
    assert found[2].position_size == pytest.approx(np.std(a - b))
    assert found[2].velocity_size == pytest.approx(np.std(va - vb), rel=0.02)


FORCES = (
    ("load", "N"), ("load", "kip"), ("moment", "N m"), ("moment", "lbf·ft"), ("nacelle", "m/s²"), ("nacelle", "m/s2"),
    ("arm", "rad/s**2"), ("y", ""), ("acceleration", "1"), ("current", "A"), ("drive", "V"), ("pitch_moment", "-"),
)  # fmt: skip
OTHERS = (
    ("yaw_rate", "rad/s"), ("flap", "deg"), ("T1", "degC"), ("speed", "1"), ("yaw_rate", ""), ("power", "kW"),
    ("load_position", "V"), ("level", "V"), ("flow", "%"), ("gap", "mm"),
)  # fmt: skip


def test_only_a_balance_of_forces_has_springs_and_friction(tmp_path: Path) -> None:
    """A rate, a position, a temperature is no sum of forces: nothing rubs in the equation of a yaw rate."""
    assert [balances_forces(name, unit) for name, unit in FORCES] == [True] * len(FORCES)
    assert [balances_forces(name, unit) for name, unit in OTHERS] == [False] * len(OTHERS)
    q, _ = swing(7)
    model = law(tmp_path, "k*speed", speed="m/s")
    assert motions(model, q[:, None], 2 * q)[0]
    turning = replace(model, outputs=(replace(model.outputs[0], name="yaw_rate", unit="rad/s"),))
    assert motions(turning, q[:, None], 2 * q) == ((), turning)


def rung(u: Array, modes: tuple[tuple[float, float, float], ...], step: float) -> Array:
    """Return the sum of modes' deflections under a held input, by the matrix exponential."""
    y = np.zeros(len(u))
    for hz, damping, gain in modes:
        w = 2 * np.pi * hz
        A = np.array([[0.0, 1.0, 0.0], [-w * w, -2 * damping * w, w * w], [0.0, 0.0, 0.0]])
        E, x = expm(A * step), np.zeros(2)
        for i, push in enumerate(u):
            y[i] += gain * x[0]
            x = E[:2, :2] @ x + E[:2, 2] * push
    return y


def site_of(model: Equations, u: Array, y: Array, step: float) -> Site:
    names = tuple(s.name for s in model.inputs)
    return Site(
        model, None, (), step, step, u[:, None], y[:, None], names, (model.outputs[0].name,), model.symbols, (),
        np.zeros((len(u), 0)), {},
    )  # fmt: skip


def test_as_many_modes_are_offered_as_there_are(tmp_path: Path) -> None:
    """Two modes behind a gain: each start is within half a percent; noise alone offers none."""
    rng, step = np.random.default_rng(7), 0.004
    u = rng.standard_normal(1500)
    model = law(tmp_path, "k*torque", torque="N m")
    noise = 0.02 * rng.standard_normal(len(u))
    y = 2 * u + rung(u, ((11.0, 0.02, 1.0), (31.0, 0.03, 0.8)), step) + noise
    offered = behind_static(site_of(model, u, y, step))
    assert [len(a.start_states) for a in offered] == [2, 4]
    (start,) = offered[1].grid
    told = sorted(value for name, value in start.items() if name.endswith("_hz"))
    assert told == pytest.approx([11.0, 31.0], rel=0.005)
    assert not behind_static(site_of(model, u, 2 * u + noise, step))


def test_a_mode_in_the_model_rings_as_its_values_say(tmp_path: Path) -> None:
    """The fourth-order steps err by (w h)^5/120 each, 1.4e-5 here, and 1/(damping w h), 180, of them add up."""
    rng, step = np.random.default_rng(8), 0.004
    u = rng.standard_normal(800)
    u = (u - u.mean()) / u.std()
    model = law(tmp_path, "k*torque", torque="N m")
    y = 2 * u + rung(u, ((11.0, 0.02, 1.0),), step)
    (mode, *_) = behind_static(site_of(model, u, y, step))
    extended = mode.edit(model)
    values = {p.name: p.value for p in extended.parameters} | dict(mode.grid[0])
    values |= {s.name: (1.0 / y.std() if s.name.endswith("_b1") else 0.0) for s in mode.slots if s.local}
    values |= {s.name: 11.0 if s.label == "frequency_hz" else 0.02 for s in mode.slots if s.label}
    theta = np.array([values[p.name] for p in extended.parameters])
    told = simulate(compile_equations(extended), u[:, None], theta, extended.x0, step)[:, 0]
    assert np.allclose(told, y, atol=5e-3 * y.std())


def test_friction_that_a_recorded_force_shows_is_named(tmp_path: Path) -> None:
    """Dry friction of 0.5 N m beside a declared damping, coloured noise; without it nothing is named."""
    model = LAW.format(inputs='[[input]]\nname = "shaft_speed"\nunit = "deg/s"\n', equation="-k*shaft_speed")
    rng = np.random.default_rng(9)
    noise = np.convolve(rng.standard_normal(ROWS), 0.9 ** np.arange(60), "same")
    _, v = swing(10, 3.0)
    channels = (("shaft_speed", "deg/s", "input"), ("load", "N", "output"))
    for friction in (0.0, 8.0):
        folder = tmp_path / f"{friction:g}"
        folder.mkdir()
        rows = np.column_stack([v, -2.0 * v - friction * np.sign(v) + 0.8 * noise])
        case = load_case(write_case(folder, model, STEP, channels, rows))
        said = diagnose(study(case, sham=0, seed=1, progress=lambda text, share: None))
        if not friction:
            assert not said["effects"]
            continue
        (effect,) = said["effects"]
        assert effect["id"] == "coulomb_friction"
        assert effect["parameters"]["force_N"]["value"] == pytest.approx(friction, rel=0.1)


@pytest.mark.parametrize("late", [0.6, pytest.param(1.0, marks=pytest.mark.nightly)])
def test_rows_that_are_late_by_up_to_a_sample_are_no_finding(late: float, tmp_path: Path) -> None:
    """A law without states says nothing of instants, but what a habit of the logger does has no name either."""
    model = LAW.format(inputs='[[input]]\nname = "shaft_speed"\nunit = "deg/s"\n', equation="-k*shaft_speed")
    rng, t = np.random.default_rng(11), STEP * np.arange(ROWS)
    w, phase = 2 * np.pi * rng.uniform(0.1, 2.0, 7), rng.uniform(0, 6, 7)
    now, then = (np.cos(np.outer(t - d * STEP, w) + phase).sum(axis=1) for d in (0.0, late))
    channels = (("shaft_speed", "deg/s", "input"), ("load", "N", "output"))
    rows = np.column_stack([now, -2.0 * then + 0.01 * rng.standard_normal(ROWS)])
    case = load_case(write_case(tmp_path, model, STEP, channels, rows))
    assert not diagnose(study(case, sham=0, seed=1, progress=lambda text, share: None))["effects"]


def test_a_habit_of_the_logger_is_one_in_the_selection_data_too(tmp_path: Path) -> None:
    """Rows that are late in the data of the fit alone: a damper's hysteresis was taken for that, and was gone."""
    model = LAW.format(inputs='[[input]]\nname = "shaft_speed"\nunit = "deg/s"\n', equation="-k*shaft_speed")
    rng, t = np.random.default_rng(11), STEP * np.arange(ROWS)
    w, phase = 2 * np.pi * rng.uniform(0.1, 2.0, 7), rng.uniform(0, 6, 7)
    channels = (("shaft_speed", "deg/s", "input"), ("load", "N", "output"))
    noise, plain = 0.01 * rng.standard_normal(ROWS), []
    for until in (0.0, 0.5, 1.0):  # share of the rows that are late
        late = 0.6 * STEP * (np.arange(ROWS) < until * ROWS)
        now, then = (np.cos(np.outer(t - d, w) + phase).sum(axis=1) for d in (0.0 * t, late))
        folder = tmp_path / f"{until:g}"
        folder.mkdir()
        case = load_case(write_case(folder, model, STEP, channels, np.column_stack([now, -2.0 * then + noise])))
        plain.append(settled_stage(case, None, unlimited()).sampling.is_plain)
    assert plain == [True, True, False]
