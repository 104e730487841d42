"""Where effects of two bodies and of two inputs attach, and how a slow sensor starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_catalogue_mechanics import model_of

from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.structure.anatomy import motions_of_equations
from aeolid.diagnose.structure.baseline import shape_forces
from aeolid.diagnose.structure.between import motions_between
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate

Array = NDArray[np.float64]
STEP, ROWS = 0.02, 400
PUSH = 3.0 * np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], ROWS // 20), 20)
CARTS = """[model]
name = "two carts and a spring between them"
[[state]]
name = "x1"
derivative = "v1"
unit = "m"
[[state]]
name = "v1"
derivative = "(push - SPRING - 0.5*v1)/2.0"
unit = "m/s"
[[state]]
name = "x2"
derivative = "v2"
unit = "m"
[[state]]
name = "v2"
derivative = "(SPRING - 0.8*v2 - 6.0*x2)/1.5"
unit = "m/s"
[[output]]
name = "first"
equation = "x1"
unit = "m"
[[output]]
name = "second"
equation = "x2"
unit = "m"
"""
MASSES = '[parameters]\nm1 = { value = 2.0, unit = "kg" }\nm2 = { value = 1.5, unit = "kg" }\n[[state]]\nname = "x1"'
AXES = """[model]
name = "two axes"
[[state]]
name = "p"
derivative = "vp"
unit = "rad"
[[state]]
name = "vp"
derivative = "1.3*main - 2.2*p - 0.5*vp"
unit = "rad/s"
[[state]]
name = "y"
derivative = "vy"
unit = "rad"
[[state]]
name = "vy"
derivative = "0.9*tail - 0.4*y - 0.6*vy"
unit = "rad/s"
[[output]]
name = "pitch"
equation = "p"
unit = "rad"
[[output]]
name = "yaw"
equation = "y"
unit = "rad"
"""


def site_of(model: Equations, u: Array) -> Site:
    n = len(model.states)
    sizes, rates = np.resize([0.1, 0.6], n), np.resize([0.6, 4.0], n)
    motions = motions_of_equations(model, sizes, rates)
    motions = [*motions, *motions_between(model, motions, sizes, rates, np.diag(sizes**2))]
    y = np.column_stack([0.2 * np.sin(3 * STEP * np.arange(len(u)))] * len(model.outputs))
    names = tuple(o.name for o in model.outputs)
    return Site(
        model, None, tuple(motions), STEP, STEP, u, y, tuple(s.name for s in model.inputs), names, model.symbols, (),
        np.zeros((len(u), 0)), {"machine": "rig"},
    )  # fmt: skip


def run(model: Equations, u: Array) -> Array:
    return simulate(compile_equations(model), u, model.theta, model.x0, STEP)


def extended(model: Equations, a: Attachment, values: Mapping[str, float]) -> Equations:
    edited = a.edit(model)
    return replace(edited, parameters=tuple(replace(p, value=values.get(p.name, p.value)) for p in edited.parameters))


@pytest.mark.parametrize("spring", ["40.0*(x1 - x2)", "-40.0*(x2 - x1)"])
def test_a_spring_between_two_bodies_may_have_a_clearance(tmp_path: Path, spring: str) -> None:
    text = (
        CARTS.replace("SPRING", spring)
        .replace("2.0", "m1")
        .replace("1.5", "m2")
        .replace('[[state]]\nname = "x1"', MASSES)
    )
    model = model_of(text, tmp_path)
    found = [a for a in entry("clearance").attach(site_of(model, PUSH[:, None])) if "x1-x2" in a.key]
    assert len(found) == 1
    gap = found[0].slots[0].name
    behind = "40.0*((x1 - x2) - min(max(x1 - x2, -0.04), 0.04))"
    written = model_of(text.replace(spring, behind), tmp_path)
    loose = run(extended(model, found[0], {gap: 0.04}), PUSH[:, None])
    np.testing.assert_allclose(loose, run(written, PUSH[:, None]), atol=1e-9)
    assert np.max(np.abs(loose - run(model, PUSH[:, None]))) > 1e-3


def test_what_is_not_in_contact_has_no_damper_either(tmp_path: Path) -> None:
    """Between the teeth of gears: stops beside a soft spring had the name, for a damper that acts within the gap."""
    text = (
        CARTS.replace("SPRING", "(40.0*(x1 - x2) + 3.0*(v1 - v2))")
        .replace("2.0", "m1")
        .replace("1.5", "m2")
        .replace('[[state]]\nname = "x1"', MASSES)
    )
    model = model_of(text, tmp_path)
    found = [a for a in entry("clearance").attach(site_of(model, PUSH[:, None])) if "x1-x2" in a.key]
    assert [a.key for a in found] == ["clearance state:x1-x2", "clearance with damper state:x1-x2"]
    gap = found[1].slots[0].name
    contact = "(1 - max(min((0.04 - abs(x1 - x2))/0.004, 1), 0))"
    behind = f"(40.0*((x1 - x2) - min(max(x1 - x2, -0.04), 0.04)) + 3.0*(v1 - v2)*{contact})"
    written = model_of(text.replace("(40.0*(x1 - x2) + 3.0*(v1 - v2))", behind), tmp_path)
    loose = run(extended(model, found[1], {gap: 0.04}), PUSH[:, None])
    np.testing.assert_allclose(loose, run(written, PUSH[:, None]), atol=1e-4 * np.max(np.abs(loose)))
    assert np.max(np.abs(loose - run(extended(model, found[0], {found[0].slots[0].name: 0.04}), PUSH[:, None]))) > 1e-3
    np.testing.assert_array_equal(run(extended(model, found[1], {}), PUSH[:, None]), run(model, PUSH[:, None]))


def test_an_input_may_reach_the_axis_that_the_model_keeps_from_it(tmp_path: Path) -> None:
    model = model_of(AXES, tmp_path)
    u = np.column_stack([PUSH, np.roll(PUSH, 30)])
    site = site_of(shape_forces(model, 5.0, STEP)[0], u)
    across = [a for a in entry("missing_coupling").attach(site) if a.key.endswith(" across")]
    assert [(a.key, [s.label for s in a.slots]) for a in across] == [
        ("missing_coupling main across", ["gain_state:vy"]),
        ("missing_coupling tail across", ["gain_state:vp"]),
    ]


def test_where_an_input_reaches_everything_nothing_is_across(tmp_path: Path) -> None:
    model = model_of(CARTS.replace("SPRING", "40.0*(x1 - x2)"), tmp_path)
    site = site_of(shape_forces(model, 5.0, STEP)[0], PUSH[:, None])
    assert not [a for a in entry("missing_coupling").attach(site) if a.key.endswith(" across")]


@pytest.mark.parametrize("identifier", ["sensor_lag", "sensor_second_order"])
def test_a_slow_sensor_may_start_apart_from_what_it_measures(tmp_path: Path, identifier: str) -> None:
    """The equations are linear: what a start apart adds decays by itself, as the sensor's own equation says."""
    model = model_of(AXES, tmp_path)
    u = np.column_stack([PUSH, PUSH])
    a = next(a for a in entry(identifier).attach(site_of(model, u)) if a.key == f"{identifier} output:pitch")
    slow = extended(model, a, {a.slots[0].name: 0.4})
    assert a.start_states == tuple(s.name for s in slow.states[len(model.states) :])
    x0 = slow.x0.copy()
    x0[len(model.states)] = 0.3
    left = (simulate(compile_equations(slow), u, slow.theta, x0, STEP) - run(slow, u))[:, 0]
    after = STEP * np.arange(1, ROWS + 1) / 0.4  # rows are read when the sensor has followed for one
    if identifier == "sensor_lag":
        np.testing.assert_allclose(left, 0.3 * np.exp(-after), atol=1e-9)
    else:  # m'' + 2 zeta m' + m = 0 in units of 1/omega, zeta 0.7, from m = 0.3 at rest
        root = np.sqrt(1 - 0.7**2)
        free = np.cos(root * after) + 0.7 / root * np.sin(root * after)
        np.testing.assert_allclose(left, 0.3 * np.exp(-0.7 * after) * free, atol=1e-9)
