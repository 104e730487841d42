"""Laws of the catalogue's mechanics, structures and stores: what an effect is, where it attaches, what it costs.

Every effect is integrated here apart from the catalogue, by adaptive Runge–Kutta steps on forms written out anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from aeolid.diagnose.data.exogenous import Exogenous, with_exogenous, without_unused
from aeolid.diagnose.hypotheses.catalogue import ENTRIES, entry
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.structure.anatomy import motions_of_equations, motions_of_state_space
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.equations_file import to_toml
from aeolid.models.integrate import Compiled, compile_equations, driven, simulate, substeps
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
STEP, SAMPLES = 0.02, 600
TIME = STEP * np.arange(SAMPLES)
PUSH = 3.0 * np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], SAMPLES // 20), 20)  # N, held for 0.4 s
WARMTH = 20.0 + 8.0 * np.sin(2 * np.pi * TIME / 9.0)
MINE = (
    "stiction", "viscous_friction_change", "drivetrain_torsion", "tower_fore_aft", "tower_side_side", "blade_flap",
    "blade_edge", "structural_mode", "stiffness_change", "added_mass", "temperature_dependence", "quadratic_stiffness",
    "end_stop", "clearance", "bouc_wen_hysteresis", "play_hysteresis", "quadratic_damping", "damping_change",
    "overflow", "one_sided_storage",
)  # fmt: skip

SPRING = """[model]
name = "mass on a spring"
[parameters]
M = { value = 2.0, unit = "kg" }
c = { value = 1.5, unit = "N s/m" }
k = { value = 80.0, unit = "N/m" }
[[state]]
name = "q"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "(push - c*v - k*q)/M"
unit = "m/s"
[[output]]
name = "position"
equation = "q"
unit = "m"
[[output]]
name = "speed"
equation = "v"
unit = "m/s"
"""
BARE = SPRING.replace("(push - c*v - k*q)/M", "0.5*push - 40.0*q")  # neither a mass nor a damping is declared
TANKS = """[model]
name = "two tanks"
[[state]]
name = "h1"
derivative = "0.3*push - 0.5*sqrt(max(h1, 0))"
initial = { value = 1.0 }
unit = "m"
[[state]]
name = "h2"
derivative = "0.5*sqrt(max(h1, 0)) - 0.5*sqrt(max(h2, 0))"
initial = { value = 1.0 }
unit = "m"
[[output]]
name = "level"
equation = "h2"
unit = "m"
"""


def model_of(text: str, folder: Path) -> Equations:
    path = folder / "model.toml"
    path.write_text(text)
    return equations_file.load(path)


def site_of(model: Equations, linear: StateSpace | None = None, context: Mapping[str, Any] | None = None) -> Site:
    """Return where entries attach: a time and a temperature channel are recorded that the model does not use."""
    exogenous = (Exogenous("time_s", "ch_time_s", "s", "time"), Exogenous("warmth", "ch_warmth", "degC", "disturbance"))
    sizes = np.array([0.1, 0.6])
    y = np.column_stack([0.2 * np.sin(3 * TIME)] * len(model.outputs))
    if linear is not None:
        motions, model = motions_of_state_space(linear, model, sizes, np.ones(len(linear.outputs)))
    else:
        motions = motions_of_equations(model, sizes, np.array([0.6, 4.0]))
    names = tuple(o.name for o in model.outputs)
    return Site(
        model, linear, tuple(motions), STEP, STEP, PUSH[:, None], y, tuple(s.name for s in model.inputs), names,
        model.symbols, exogenous, np.column_stack([TIME, WARMTH]), context or {"machine": "rig"},
    )  # fmt: skip


def linear_spring(unit: str = "m") -> StateSpace:
    held = expm(np.array([[0, 1, 0], [-40.0, -0.75, 0.5], [0, 0, 0]]) * STEP)
    return StateSpace(
        A=held[:2, :2], B=held[:2, 2:], C=np.array([[1.0, 0.0]]), D=np.zeros((1, 1)), K=None, x0=np.zeros(2),
        innovation_covariance=None, sample_time_s=STEP, inputs=(Signal("push", "N"),),
        outputs=(Signal("position", unit),), states=(Signal("q", "m"), Signal("v", "m/s")),
    )  # fmt: skip


def sites(folder: Path) -> dict[str, Site]:
    linear = linear_spring()
    return {
        "spring": site_of(model_of(SPRING, folder)),
        "bare": site_of(model_of(BARE, folder)),
        "tanks": site_of(model_of(TANKS, folder)),
        "linear": site_of(equations_of(linear, shaped_noise=False), linear),
    }


@dataclass(frozen=True, eq=False)
class World:
    """Hold a site, its bare model and the one with every effect attached, compiled once for all tests."""

    site: Site
    bare: Compiled
    full: Compiled


@pytest.fixture(scope="module")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, World]:
    found = sites(tmp_path_factory.mktemp("models"))
    return {k: World(s, compile_equations(s.model), compile_equations(together(s))) for k, s in found.items()}


def attachments(site: Site) -> list[Attachment]:
    return [a for e in ENTRIES if e.id in MINE for a in e.attach(site)]


def extended(site: Site, a: Attachment, values: Mapping[str, float]) -> Equations:
    """Return the site's model with this effect at these values, and nothing of what it does not use."""
    model = a.edit(with_exogenous(site.model, site.exogenous))
    values = dict(a.fixed) | dict(values)
    parameters = tuple(replace(p, value=values.get(p.name, p.value)) for p in model.parameters)
    return without_unused(replace(model, parameters=parameters), site.exogenous)


def run(model: Equations, push: Array = PUSH) -> Array:
    columns = {"push": push, "time_s": TIME[: len(push)], "warmth": WARMTH[: len(push)]}
    u = np.column_stack([columns[s.name] for s in model.inputs])
    return simulate(compile_equations(model), u, model.theta, model.x0, STEP)


def named(site: Site, identifier: str, kind: str = "") -> Attachment:
    return next(a for a in entry(identifier).attach(site) if kind in a.key)


def together(site: Site) -> Equations:
    """Return the model with every effect attached, as a diagnosis compiles it."""
    model = with_exogenous(site.model, site.exogenous)
    for a in attachments(site):
        model = a.edit(model)
    return model


def predicted(compiled: Compiled, values: Mapping[str, float]) -> Array:
    """Run free with these parameters and four Runge-Kutta steps a sample, however fast the states that effects add."""
    model = compiled.model
    theta = np.array([values.get(p.name, p.value) for p in model.parameters])
    u = np.column_stack([PUSH, TIME, WARMTH])[:, : len(model.inputs)]
    blank, gain = np.full((SAMPLES, len(model.outputs)), np.nan), np.zeros((len(model.states), len(model.outputs)))
    acting = driven(compiled, u, theta, STEP)
    result: Array = compiled.predict(acting, blank, theta, gain, model.x0, STEP, 4, 1, False)[1]
    return result


@pytest.mark.parametrize("where", ["spring", "bare", "tanks", "linear"])
def test_at_its_null_an_effect_changes_nothing(worlds: dict[str, World], where: str) -> None:
    """At every point of its grid, too: as long as the local parameters rest, nothing is predicted otherwise."""
    site, full = worlds[where].site, worlds[where].full
    before = predicted(worlds[where].bare, {})
    for a in attachments(site):
        local = {s.name: s.null for s in a.slots if s.local}
        moved = []
        for grid in a.grid:
            assert np.max(np.abs(predicted(full, dict(grid) | local) - before)) <= 1e-12, (a.key, grid)
            away = {s.name: 100 * s.size for s in a.slots if s.local}
            moved.append(np.max(np.abs(predicted(full, dict(grid) | away) - before)))
        assert max(moved) > 1e-9, a.key  # and away from it, something


@pytest.mark.parametrize("where", ["spring", "tanks", "linear"])
def test_the_corrected_file_runs_as_the_model_does(worlds: dict[str, World], tmp_path: Path, where: str) -> None:
    """All effects in one file, none at its null: written, read again and run."""
    site, full = worlds[where].site, worlds[where].full
    values = {s.name: s.size for a in attachments(site) for s in a.slots if s.local}
    values |= {n: v for a in attachments(site) for n, v in a.grid[len(a.grid) // 2].items()}
    model = full.model
    model = replace(model, parameters=tuple(replace(p, value=values.get(p.name, p.value)) for p in model.parameters))
    path = tmp_path / "again.toml"
    path.write_text(to_toml(model))
    again = equations_file.load(path)
    assert [p.value for p in again.parameters] == [p.value for p in model.parameters]
    np.testing.assert_allclose(predicted(compile_equations(again), {}), predicted(full, values), rtol=0, atol=1e-12)


@pytest.mark.parametrize("where", ["spring", "bare", "tanks", "linear"])
def test_every_effect_can_be_stated(worlds: dict[str, World], where: str) -> None:
    for a in attachments(worlds[where].site):
        text = a.statement({s.label: 0.123 for s in a.slots if s.label})
        place = str(a.location["entry"]).removeprefix("state:")
        assert "{" not in text and a.entry in MINE and (place in text or a.location["inputs"] or a.location["outputs"])
        few = 4 if a.entry == "end_stop" else 3  # two places, a stiffness and what a touch takes
        assert len(a.slots) - len(a.fixed) <= few or a.gain_states
        for s in a.slots:
            assert s.low <= s.null <= s.high and s.size > 0, (a.key, s.name)
        assert {n for point in a.grid for n in point} <= {s.name for s in a.slots}
        assert {n for point in a.starts for n in point} <= {s.name for s in a.slots}


def test_effects_attach_where_they_make_sense_and_nowhere_else(tmp_path: Path) -> None:
    found = {k: sorted({a.entry for a in attachments(s)}) for k, s in sites(tmp_path).items()}
    spring = [
        "bouc_wen_hysteresis", "clearance", "damping_change", "end_stop", "play_hysteresis", "quadratic_damping",
        "quadratic_stiffness", "stiction", "stiffness_change", "structural_mode", "temperature_dependence",
    ]  # fmt: skip
    assert found["spring"] == spring  # a declared mass and a declared damping are parameters
    assert found["bare"] == sorted([*spring, "added_mass", "viscous_friction_change"])
    assert found["linear"] == sorted([*spring, "added_mass"])  # a mode's wrong damping is a parameter
    assert found["tanks"] == ["one_sided_storage", "overflow", "structural_mode", "temperature_dependence"]


def test_no_temperature_no_clock_no_spring_no_effect(tmp_path: Path) -> None:
    site = sites(tmp_path)["spring"]
    without = replace(site, exogenous=site.exogenous[:1], extra=site.extra[:, :1])
    assert not entry("temperature_dependence").attach(without)
    steady = replace(site, extra=np.column_stack([TIME, np.full(SAMPLES, 20.0)]))
    assert not entry("temperature_dependence").attach(steady)
    twice = replace(site, extra=np.column_stack([TIME % TIME[300], WARMTH]))  # two recordings, each from zero
    assert not entry("stiffness_change").attach(twice) and not entry("damping_change").attach(twice)
    free = site_of(model_of(SPRING.replace(" - k*q", ""), tmp_path))
    assert not entry("clearance").attach(free)
    slider = site_of(
        model_of(SPRING.replace('name = "q"\nderivative = "v"', 'name = "q"\nderivative = "0*v"'), tmp_path)
    )
    assert {a.entry for a in attachments(slider)} & {"end_stop", "bouc_wen_hysteresis", "cubic_stiffness"} == set()
    assert named(slider, "stiction").location["entry"] == "state:v"


@dataclass(frozen=True)
class Form:
    """Hold an effect written out anew: force(q, v, z, t) in N, and the rate of what it remembers (z)."""

    identifier: str
    values: Mapping[str, float]
    force: Callable[[float, float, float, float], float]
    memory: Callable[[float, float, float], float] = lambda q, v, z: 0.0
    mass: float = 2.0
    kind: str = ""
    near: float = 2e-3
    sampled: float = 0.08  # of what it does in a sample, by which a mode in discrete time may miss it


SMOOTH = 0.01 * 0.6
FORMS = (
    Form("quadratic_stiffness", {"quadratic_1": 90.0}, lambda q, v, z, t: -90.0 * q**2),
    Form("quadratic_damping", {"drag_1": 4.0}, lambda q, v, z, t: -4.0 * v * abs(v)),
    Form("end_stop", {"stop_1_stiffness": 300.0, "stop_1_low": -0.05, "stop_1_high": 0.08},
         lambda q, v, z, t: -300.0 * (q - 0.08) if q > 0.08 else (-300.0 * (q + 0.05) if q < -0.05 else 0.0)),
    Form("end_stop", {"stop_1_stiffness": 300.0, "stop_1_low": -0.05, "stop_1_high": 0.08, "stop_1_loss": 0.5},
         lambda q, v, z, t: (
             -300.0 * (q - 0.08) * max(1 + 0.5 * v, 0) if q > 0.08
             else (-300.0 * (q + 0.05) * max(1 - 0.5 * v, 0) if q < -0.05 else 0.0)
         ), sampled=0.25),  # the speed turns over within the sample
    Form("clearance", {"clearance_1": 0.03},
         lambda q, v, z, t: 80.0 * q if abs(q) < 0.03 else 80.0 * 0.03 * np.sign(q)),
    Form("stiction", {"stiction_1_force": 0.5, "stiction_1_excess": 0.4, "stiction_1_speed": 0.1},
         lambda q, v, z, t: -np.tanh(v / SMOOTH) * (0.5 + 0.4 * np.exp(-((v / 0.1) ** 2)))),
    Form("bouc_wen_hysteresis", {"loop_1_force": 1.2, "loop_1_length": 0.04}, lambda q, v, z, t: -1.2 * z,
         lambda q, v, z: v / 0.04 * (1.0 - (abs(z) if v * z > 0 else 0.0))),
    Form("bouc_wen_hysteresis",
         {"shaped_loop_1_force": 0.9, "shaped_loop_1_length": 0.05, "shaped_loop_1_shape": -1.3},
         lambda q, v, z, t: -0.9 * z,
         lambda q, v, z: (v - 0.5 * abs(v) * z + 0.65 * v * abs(z)) / 0.05, kind="with shape"),
    # the slider moves only when its spring is stretched to the full width and the motion stretches it further
    Form("play_hysteresis", {"slider_1_stiffness": 60.0, "slider_1_width": 0.03},
         lambda q, v, z, t: -60.0 * z, lambda q, v, z: v if abs(z) < 0.03 or v * z < 0 else 0.0, near=0.01),
    Form("stiffness_change", {"stiffness_change_1_step": 40.0, "stiffness_change_1_time_s": 6.0},
         lambda q, v, z, t: -40.0 * q if t > 6.0 else 0.0, near=0.06),
    Form("stiffness_change", {"stiffness_change_1_drift": 40.0},
         lambda q, v, z, t: -40.0 * q * t / TIME[-1], kind="drift", near=0.01),
    Form("damping_change", {"damping_change_1_step": 3.0, "damping_change_1_time_s": 6.0},
         lambda q, v, z, t: -3.0 * v if t > 6.0 else 0.0, near=0.06),
    Form("temperature_dependence", {"temperature_1_2": 4.0},
         lambda q, v, z, t: -4.0 * (np.interp(t, TIME, WARMTH) - np.mean(WARMTH)) * q, near=0.02),
)  # fmt: skip


def integrated(form: Form) -> Array:
    """Integrate the mass on the spring with a force of its own, the push held over a sample; returns q (N,)."""
    state, rows = np.zeros(3), []

    def slope(t: float, x: Array, push: float) -> list[float]:
        force = push - 1.5 * x[1] - 80.0 * x[0] + form.force(x[0], x[1], x[2], t)
        return [x[1], force / form.mass, form.memory(x[0], x[1], x[2])]

    for t, push in zip(TIME, PUSH, strict=True):
        rows.append(state[0])
        done = solve_ivp(slope, (t, t + STEP), state, args=(push,), rtol=1e-7, atol=1e-10, max_step=STEP / 4)
        state = done.y[:, -1]
    return np.array(rows)


@pytest.mark.parametrize("form", FORMS, ids=lambda f: f"{f.identifier} {f.kind}")
def test_an_effect_does_what_its_equation_says(worlds: dict[str, World], form: Form) -> None:
    """`near` is relative to the largest stroke: what a step that is a ramp costs, or a channel held over a sample."""
    world = worlds["spring"]
    a = named(world.site, form.identifier, form.kind)
    assert set(form.values) <= {s.name for s in a.slots}
    expected = integrated(form)
    got = predicted(world.full, dict(form.values) | dict(a.fixed))[:, 0]
    without = predicted(world.bare, {})[:, 0]
    size = np.max(np.abs(expected))
    assert np.max(np.abs(got - expected)) < form.near * size
    assert np.max(np.abs(without - expected)) > 3 * form.near * size  # the effect is there to be seen


def test_viscous_friction_and_added_mass_do_what_they_say(tmp_path: Path) -> None:
    site = sites(tmp_path)["bare"]
    damped = site_of(model_of(BARE.replace("40.0*q", "40.0*q - 0.8*v"), tmp_path))
    np.testing.assert_allclose(
        run(extended(site, named(site, "viscous_friction_change"), {"viscous_1": 0.8})), run(damped.model), atol=1e-12
    )
    heavier = site_of(model_of(BARE.replace("0.5*push - 40.0*q", "(0.5*push - 40.0*q)/1.25"), tmp_path))
    np.testing.assert_allclose(
        run(extended(site, named(site, "added_mass"), {"added_mass_1": 0.25})), run(heavier.model), atol=1e-12
    )


def test_added_mass_on_a_mode_slows_it_and_lowers_its_gain(tmp_path: Path) -> None:
    """Against the same spring with 25 % more mass, held inputs: the mode's coordinates are exact to half a sample."""
    site = sites(tmp_path)["linear"]
    got = run(extended(site, named(site, "added_mass"), {"added_mass_1": 0.25}))[:, 0]
    held = expm(np.array([[0, 1, 0], [-40.0 / 1.25, -0.75 / 1.25, 0.5 / 1.25], [0, 0, 0]]) * STEP)
    x, expected = np.zeros(2), []
    for push in PUSH:
        expected.append(x[0])
        x = held[:2, :2] @ x + held[:2, 2] * push
    without = run(site.model)[:, 0]
    size = np.max(np.abs(expected))
    assert np.max(np.abs(got - expected)) < 0.15 * np.max(np.abs(without - expected))
    assert np.max(np.abs(got - expected)) < 0.1 * size


def test_an_overflow_loses_what_the_next_tank_does_not_get(tmp_path: Path) -> None:
    """Water is counted: what leaves the upper tank over its brim is lost, but for the share that falls below."""
    site = sites(tmp_path)["tanks"]
    a = named(site, "overflow", "h1")
    assert a.location["entry"] == "state:h1"
    values = {"overflow_1_level": 2.0, "overflow_1_time": 0.1, "overflow_1_into_next": 0.4}

    def slope(t: float, h: Array, push: float) -> list[float]:
        spill = (h[0] - 2.0) / 0.1 if h[0] > 2.0 else 0.0
        out, below = 0.5 * np.sqrt(max(h[0], 0.0)), 0.5 * np.sqrt(max(h[1], 0.0))
        return [0.3 * push - out - spill, out - below + 0.4 * spill]

    state, expected = np.ones(2), []
    push = np.abs(PUSH)
    for u in push:
        expected.append(state[1])
        state = solve_ivp(slope, (0, STEP), state, args=(u,), rtol=1e-8, atol=1e-10).y[:, -1]
    got = run(extended(site, a, values), push)[:, 0]
    np.testing.assert_allclose(got, expected, atol=2e-4)
    assert np.max(np.abs(run(site.model, push)[:, 0] - expected)) > 0.1


def test_a_one_sided_store_stays_above_its_floor(tmp_path: Path) -> None:
    site = sites(tmp_path)["tanks"]
    a = named(site, "one_sided_storage", "h2")
    names = {s.label: s.name for s in a.slots if s.label}
    drained = run(extended(site, a, {names["floor_level"]: 0.6}), np.zeros(SAMPLES))[:, 0]
    assert drained.min() > 0.57 and run(site.model, np.zeros(SAMPLES))[:, 0].min() < 0.3


def test_modes_of_a_turbine_are_named_by_the_output_that_shows_them() -> None:
    """Words as loggers and simulators write them; each output is offered one mode, and others none of these names."""
    expected = {
        "tower_acc_fore_aft": "tower_fore_aft", "NcIMUTAxs": "tower_fore_aft", "tower top FA": "tower_fore_aft",
        "tower_acc_side_side": "tower_side_side", "TTDspSS": "tower_side_side", "YawBrTAyp": "tower_side_side",
        "generator_speed": "drivetrain_torsion", "GenSpeed": "drivetrain_torsion", "LSShftTq": "drivetrain_torsion",
        "flap_moment_2": "blade_flap", "RootMyb1": "blade_flap", "blade 1 edgewise": "blade_edge",
        "RootMxb3": "blade_edge", "nacelle_wind": "structural_mode", "power": "structural_mode",
        "usage": "structural_mode", "surface": "structural_mode",
    }  # fmt: skip
    linear = linear_spring()
    for name, wanted in expected.items():
        renamed = replace(linear, outputs=(Signal(name, "m/s^2"),))
        model = equations_of(renamed, shaped_noise=False)
        for machine, identifier in (("wind turbine", wanted), ("rig", "structural_mode")):
            site = site_of(model, renamed, {"machine": machine})
            modes = [a for a in attachments(site) if entry(a.entry).family == "structural_mode"]
            assert {a.entry for a in modes} == {identifier}, (name, machine)
            assert len(modes) == 1 + (machine == "rig"), "in the output; of a rig also a part that the body carries"
            assert modes[0].location["outputs"] == [name]
    tower = site_of(model, replace(linear, outputs=(Signal("tower_fa", "m/s^2"),)), {"machine": "wind turbine"})
    tower = replace(tower, output_names=("tower_fa",))
    assert named(tower, "tower_fore_aft").location["entry"] == "tower"


@pytest.mark.parametrize(("unit", "order"), [("m", 0), ("m/s", 1), ("m/s^2", 2)])
def test_a_mode_shows_as_its_output_measures(unit: str, order: int) -> None:
    """A free mode read as q, q'/w or q''/w²: the same pole, amplitudes equal, each a quarter of a turn on."""
    linear = linear_spring(unit)
    site = site_of(equations_of(linear, shaped_noise=False), linear)
    a = named(site, "structural_mode")
    model = extended(site, a, {"mode1_frequency_hz": 2.0, "mode1_damping": 0.02})
    start = tuple(replace(s, initial=1.0) if s.name == "mode1_q" else s for s in model.states)
    got = run(replace(model, states=start), np.zeros(SAMPLES))[:, 0]
    pole = 2 * np.pi * 2.0 * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
    w = abs(pole)
    exact = np.array([np.exp(pole * t) for t in TIME])
    amplitude = -np.conj(pole) / (pole - np.conj(pole))  # q(0) = 1, q'(0) = 0
    expected = 2 * np.real(amplitude * exact * pole**order) / w**order
    np.testing.assert_allclose(got, expected, atol=1e-9)


def test_a_stretch_that_starts_in_motion_is_integrated_like_one_that_starts_at_rest(worlds: dict[str, World]) -> None:
    """Dry friction is steepest at rest: the number of steps a sample must not follow from where a run starts."""
    model = worlds["spring"].full.model
    friction = {"stiction_1_share": 1.0, "stiction_1_force": 2.0}
    theta = np.array([friction.get(p.name, p.value) for p in model.parameters])
    u = np.column_stack([PUSH, TIME, WARMTH])
    counts = []
    for speed in (0.0, 0.7):
        start = model.x0.copy()
        start[1] = speed
        counts.append(substeps(worlds["spring"].full, np.median(u, axis=0), theta, start, STEP))
    assert counts[0] == counts[1] >= 2.0 / 2.0 / SMOOTH * STEP / 0.5  # slope at rest F/(M v_s)


LINEAR_FORMS = [
    f for f in FORMS if f.identifier in ("quadratic_stiffness", "quadratic_damping", "end_stop", "clearance")
]


@pytest.mark.parametrize("form", LINEAR_FORMS, ids=lambda f: f.identifier)
def test_on_a_mode_an_effect_is_exact_to_second_order(worlds: dict[str, World], form: Form) -> None:
    """One prediction from the true state, against the fine integration: position and speed both, over many samples.

    A force held from the start of the sample, or one that kicks at its end, is off by half a sample: more than a
    tenth of what the effect does in one step.
    """
    world = worlds["linear"]
    a = named(world.site, form.identifier)
    per_mass = {
        n: v if n.startswith(("clearance", "stop_1_l", "stop_1_h")) else v / 2.0 for n, v in form.values.items()
    }
    model = world.full.model
    theta = np.array([(per_mass | dict(a.fixed)).get(p.name, p.value) for p in model.parameters])
    without = model.theta
    rng = np.random.default_rng(5)
    errors, effects = [], []

    def slope(t: float, x: Array) -> list[float]:
        return [x[1], (1.0 - 1.5 * x[1] - 80.0 * x[0] + form.force(x[0], x[1], 0.0, t)) / 2.0]

    for _ in range(40):
        start = np.array([0.12, 0.8]) * rng.standard_normal(2)
        exact = solve_ivp(slope, (0, STEP), start, rtol=1e-10, atol=1e-12).y[:, -1]
        x = model.x0.copy()
        x[:2] = start
        u = np.array([1.0, 0.0, 20.0])
        steps = []
        for values in (theta, without):
            after = np.empty(len(model.states))
            after = world.full.slope(world.full.settled(x, u, values, STEP), u, values)
            steps.append(after[:2])
        errors.append(steps[0] - exact)
        effects.append(steps[1] - exact)
    for i in range(2):
        assert np.std([e[i] for e in errors]) < form.sampled * np.std([e[i] for e in effects])


def test_a_floor_is_looked_for_where_the_level_was_lowest(worlds: dict[str, World]) -> None:
    """Shares of the highest level put it 589 nats below the model without it; the lowest levels seen found it."""
    site = worlds["tanks"].site
    (a,) = [a for a in entry("one_sided_storage").attach(site) if a.location["entry"] == "state:h2"]
    floor = next(s.name for s in a.slots if s.label == "floor_level")
    lowest = float(np.nanquantile(site.y[:, 0], 0.002))
    assert lowest in [g[floor] for g in a.grid] and lowest in [start.get(floor) for start in a.starts]
    (above,) = [a for a in entry("one_sided_storage").attach(site) if a.location["entry"] == "state:h1"]
    assert len(above.grid) == 4  # no output reads the upper level
