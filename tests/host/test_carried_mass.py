"""Laws of a part that swings with a body: on a spring, from a hinge, in continuous time and with a mode of a model.

What the catalogue writes is held against the equations of two bodies, solved here apart from it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from small_cases import write_case

from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.hypotheses.parts.carried_mass import carried_masses
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.structure.anatomy import motions_of_equations, motions_of_state_space
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
MASS, SPRING, DAMPER, GRAVITY = 1.5, 60.0, 2.0, 9.80665  # kg, N/m, N s/m, m/s^2
SHARE, HELD, HELD_DAMPING = 0.09, 6.26, 0.02  # of the mass; rad/s and damping where the cart is held: both near 1 Hz
FREQUENCY = HELD / np.sqrt(1 - SHARE) / (2 * np.pi)  # against each other
DAMPING = HELD_DAMPING / np.sqrt(1 - SHARE)
MODEL = """[model]
name = "cart between springs"
[parameters]
M = { value = 1.5, unit = "kg" }
k = { value = 60.0, unit = "N/m", min = 12.0, max = 300.0, free = true }
c = { value = 2.0, unit = "N s/m", min = 0.4, max = 10.0, free = true }
[[input]]
name = "push"
unit = "N"
[[state]]
name = "x"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "(push - c*v - k*x)/M"
unit = "m/s"
[[output]]
name = "position"
equation = "x"
unit = "m"
[[output]]
name = "speed"
equation = "v"
unit = "m/s"
"""
CHANNELS = (("push", "N", "input"), ("position", "m", "output"), ("speed", "m/s", "output"))


def cart(folder: Path) -> Equations:
    path = folder / "model.toml"
    path.write_text(MODEL)
    return equations_file.load(path)


def site_of(model: Equations, motions: Any, step: float, linear: StateSpace | None = None, **context: str) -> Site:
    u, y = np.random.default_rng(1).standard_normal((4000, 1)), np.ones((4000, len(model.outputs)))
    names = tuple(o.name for o in model.outputs)
    return Site(
        model, linear, tuple(motions), step, step, u, y, ("push",), names, model.symbols, (), np.zeros((4000, 0)),
        context,
    )  # fmt: skip


def at_cart(folder: Path, **context: str) -> list[Attachment]:
    model = cart(folder)
    return carried_masses(site_of(model, motions_of_equations(model, np.ones(2), np.ones(2)), 0.02, **context))


def on_a_spring(push: Array, step: float) -> Array:
    """Return position and speed (N, 2) of the cart with its part on a spring, the push held over each sample."""
    body, part = MASS * (1 - SHARE), MASS * SHARE
    k, c = part * HELD**2, 2 * HELD_DAMPING * part * HELD
    whole = np.zeros((5, 5))
    whole[0, 1] = whole[2, 3] = 1.0
    whole[1, :4] = np.array([-SPRING - k, -DAMPER - c, k, c]) / body
    whole[3, :4] = np.array([k, c, -k, -c]) / part
    whole[1, 4] = 1 / body
    return _held(whole, push, step)


def rigid(push: Array, step: float) -> Array:
    return _held(np.array([[0, 1, 0], [-SPRING / MASS, -DAMPER / MASS, 1 / MASS], [0, 0, 0]]), push, step)


def _held(whole: Array, push: Array, step: float) -> Array:
    held = expm(whole * step)
    x, found = np.zeros(len(whole) - 1), np.empty((len(push), 2))
    for i, u in enumerate(push):
        found[i] = x[:2]
        x = held[:-1, :-1] @ x + held[:-1, -1] * u
    return found


def pushes(samples: int, seed: int, dwell: int = 16) -> Array:
    return np.repeat(np.random.default_rng(seed).uniform(-4, 4, samples // dwell + 1), dwell)[:samples]


def run(model: Equations, a: Attachment, values: dict[str, float], push: Array, step: float) -> Array:
    compiled = compile_equations(a.edit(model))
    names = {s.label: s.name for s in a.slots}
    set_to = {names[label]: v for label, v in values.items()}
    theta = np.array([set_to.get(p.name, p.value) for p in compiled.model.parameters])
    return simulate(compiled, push[:, None], theta, compiled.model.x0, step)


TRUE = {"frequency_hz": FREQUENCY, "damping": DAMPING, "share": SHARE}


def test_a_part_on_a_spring_is_a_vibration_absorber(tmp_path: Path) -> None:
    """At a tenth of the step, so that the errors of integration, of fourth order, are below a hundred-thousandth."""
    model, push, step = cart(tmp_path), pushes(2000, 2), 0.002
    spring = at_cart(tmp_path)[0]
    assert spring.key == "structural_mode state:v, carried"
    exact = on_a_spring(push, step)
    scale = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(run(model, spring, TRUE, push, step) / scale, exact / scale, atol=1e-5)
    none = run(model, spring, TRUE | {"share": 0.0}, push, step)
    np.testing.assert_allclose(none / scale, rigid(push, step) / scale, atol=1e-5)


def test_what_hangs_from_a_hinge_is_a_pendulum(tmp_path: Path) -> None:
    """Against the two equations of a cart with a pendulum as Lagrange has them, mass matrix and all, to 1.2 rad."""
    model, step = cart(tmp_path), 0.002
    hinge = at_cart(tmp_path)[1]
    assert hinge.key == "structural_mode state:v, hanging"
    length, share, damping = 0.25, 0.3, 0.03
    omega, part = np.sqrt(GRAVITY / length), share * MASS
    push = 16.0 * np.sin(omega * step * np.arange(2000))

    def slopes(t: float, x: Array) -> Array:
        p, turning = x[2], x[3]
        inertia = np.array([[MASS, part * length * np.cos(p)], [part * length * np.cos(p), part * length**2]])
        force = push[min(int(t / step + 1e-9), len(push) - 1)]
        along = force - SPRING * x[0] - DAMPER * x[1] + part * length * turning**2 * np.sin(p)
        about = -part * GRAVITY * length * np.sin(p) - 2 * damping * omega * part * length**2 * turning
        a, b = np.linalg.solve(inertia, [along, about])
        return np.array([x[1], a, turning, b])

    x, exact, widest = np.zeros(4), np.empty((len(push), 2)), 0.0
    for k in range(len(push)):
        exact[k] = x[:2]
        x = solve_ivp(slopes, (k * step, (k + 1) * step * (1 - 1e-12)), x, rtol=1e-9, atol=1e-12).y[:, -1]
        widest = max(widest, abs(x[2]))
    assert widest > 1.2
    values = {"frequency_hz": omega / (2 * np.pi), "damping": damping, "share": share}
    scale = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(run(model, hinge, values, push, step) / scale, exact / scale, atol=1e-4)


def linear_cart(step: float) -> tuple[StateSpace, Equations, Any]:
    """Return the rigid cart exactly sampled, the equations that a diagnosis makes of it, and its mode."""
    whole = np.array([[0, 1, 0], [-SPRING / MASS, -DAMPER / MASS, 1 / MASS], [0, 0, 0]])
    held = expm(whole * step)
    outputs = (Signal("position", "m"), Signal("speed", "m/s"))
    model = StateSpace(
        held[:2, :2], held[:2, 2:], np.eye(2), np.zeros((2, 1)), None, np.zeros(2), None, step, (Signal("push", "N"),),
        outputs, (Signal("x", "m"), Signal("v", "m/s")),
    )  # fmt: skip
    motions, working = motions_of_state_space(model, equations_of(model, shaped_noise=False), np.ones(2), np.ones(2))
    return model, working, motions


def test_with_a_mode_of_a_linear_model_it_is_right_up_to_what_damping_does_within_a_sample() -> None:
    """A part in 200 of the motion at 50 samples a period, half of it at 100."""
    errors = []
    for step in (0.02, 0.01):
        linear, working, motions = linear_cart(step)
        (spring,) = carried_masses(site_of(working, motions, step, linear))
        push = pushes(int(20 / step), 3, int(0.32 / step))
        exact = on_a_spring(push, step)
        scale = np.abs(exact).max(axis=0)
        errors.append(np.max(np.abs(run(working, spring, TRUE, push, step) - exact) / scale))
        none = run(working, spring, TRUE | {"share": 0.0}, push, step)
        np.testing.assert_allclose(none / scale, rigid(push, step) / scale, atol=1e-9)
    assert errors[0] < 1 / 200
    assert errors[1] < 0.55 * errors[0]


def test_it_is_offered_where_an_output_reads_a_body_that_has_no_named_mode(tmp_path: Path) -> None:
    model = cart(tmp_path)
    motions = motions_of_equations(model, np.ones(2), np.ones(2))
    assert [a.location["outputs"] for a in at_cart(tmp_path)] == [["position", "speed"]] * 2
    shaft = replace(model, outputs=tuple(replace(o, name="rotor_speed") for o in model.outputs[1:]))
    assert carried_masses(site_of(shaft, motions, 0.02, machine="wind turbine")) == []
    assert carried_masses(site_of(replace(model, sample_time_s=0.02), motions, 0.02)) == []
    assert carried_masses(site_of(replace(model, outputs=()), motions, 0.02)) == []


@pytest.mark.parametrize("kind", ["equations", pytest.param("state_space", marks=pytest.mark.nightly)])
def test_a_tuned_absorber_is_named_with_what_it_weighs(kind: str, tmp_path: Path) -> None:
    """Both swing at 1 Hz: the fitted rigid cart is then 20 % stiffer and promises three times the absorber's share."""
    step, push = 0.02, pushes(2000, 4)
    clean = on_a_spring(push, step)
    y = clean + 0.01 * clean.std(axis=0) * np.random.default_rng(5).standard_normal(clean.shape)
    text = MODEL if kind == "equations" else json.dumps(linear_cart(step)[0].to_json())
    case = load_case(write_case(tmp_path, text, step, CHANNELS, np.column_stack([push, y]), kind=kind))
    found = study(case, sham=0, seed=0, progress=lambda words, share: None)
    assert found.winner is not None and found.winner.key.endswith(", carried")
    values = found.winner.values[found.winner.attachments[0].key]
    for label, true in TRUE.items():
        value, deviation = values[label]
        assert value == pytest.approx(true, abs=3 * deviation), label
        assert deviation < 0.1 * true
    assert found.proof is not None and found.proof.interval[0] > 0
