"""What two bodies do to each other: where a model deforms, how a force enters there, and that effects are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.structure.anatomy import motions_of_equations
from aeolid.diagnose.structure.baseline import noisy_states
from aeolid.diagnose.structure.between import motions_between
from aeolid.diagnose.structure.sums import factors_of
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations

Array = NDArray[np.float64]
RATIO = 2.5
GEARED = """[model]
name = "rotor, gear and generator"
[parameters]
Jr = { value = 1.4, unit = "kg m^2" }
Jg = { value = 0.1, unit = "kg m^2" }
N = { value = 2.5, unit = "" }
k = { value = 90.0, unit = "N m", min = 9.0, max = 900.0, free = true }
c = { value = 0.4, unit = "N m s", min = 0.04, max = 4.0, free = true }
b = { value = 0.05, unit = "N m s", min = 0.005, max = 0.5, free = true }
[[input]]
name = "torque"
unit = "N m"
[[auxiliary]]
name = "shaft"
equation = "k*twist + c*(wr - wg/N)"
[[state]]
name = "twist"
unit = "rad"
derivative = "wr - wg/N"
[[state]]
name = "wr"
unit = "rad/s"
derivative = "(torque - shaft)/Jr"
[[state]]
name = "wg"
unit = "rad/s"
derivative = "(shaft/N - b*wg)/Jg"
[[output]]
name = "rotor_speed"
unit = "rad/s"
equation = "wr"
[[output]]
name = "generator_speed"
unit = "rad/s"
equation = "wg"
"""
PAIR = """[model]
name = "two carts"
[parameters]
m1 = { value = 2.0, unit = "kg" }
m2 = { value = 3.0, unit = "kg" }
[[input]]
name = "push"
unit = "N"
[[state]]
name = "x1"
unit = "m"
derivative = "v1"
[[state]]
name = "v1"
unit = "m/s"
derivative = "(push - 40*(x1 - x2) - v1)/m1"
[[state]]
name = "x2"
unit = "m"
derivative = "v2"
[[state]]
name = "v2"
unit = "m/s"
derivative = "(40*(x1 - x2) - 2*v2)/m2"
[[output]]
name = "cart"
unit = "m"
equation = "x1"
"""


def model_of(text: str, folder: Path) -> Equations:
    path = folder / "model.toml"
    path.write_text(text)
    return equations_file.load(path)


@pytest.mark.parametrize(
    ("text", "factors"),
    [
        ("wr - wg", {"wr": 1.0, "wg": -1.0}),
        ("wr - wg/N", {"wr": 1.0, "wg": -1 / RATIO}),
        ("-(2*wr) + (wg - wr)*(1/N)", {"wr": -2 - 1 / RATIO, "wg": 1 / RATIO}),
        ("wr - wg + 1", {}),  # an offset is no geometry
        ("wr*wg", {}),
        ("wr - wg**2", {}),
        ("wr - twist", {}),
        ("wr - wr + wg - wg", {}),
        ("wr/0 - wg", {}),
    ],
)
def test_sums_of_velocities_are_read(text: str, factors: dict[str, float], tmp_path: Path) -> None:
    found = factors_of(ex.parse(text, "test"), model_of(GEARED, tmp_path), {"wr", "wg"})
    assert found == pytest.approx(factors)


def test_a_force_on_the_twist_does_the_work_of_its_parts(tmp_path: Path) -> None:
    """Virtual work: the power on the bodies is force times rate of deformation, whatever the gear between them."""
    model = model_of(GEARED, tmp_path)
    ones = np.ones(len(model.states))
    (twist,) = motions_between(model, motions_of_equations(model, ones, ones), 2 * ones, 3 * ones, np.eye(len(ones)))
    assert twist.location == "state:twist" and (twist.position_size, twist.velocity_size) == (2.0, 3.0)
    pushed = compile_equations(twist.inject(model, ex.parse("7*twist", "test"), "force"))
    x, u, theta = np.array([0.3, 1.1, -0.7]), np.array([0.4]), model.theta
    change = pushed.slope(x, u, theta) - compile_equations(model).slope(x, u, theta)
    values = {p.name: p.value for p in model.parameters}
    power = change[1] * values["Jr"] * x[1] + change[2] * values["Jg"] * x[2]
    assert change[0] == 0.0
    assert power == pytest.approx(7 * x[0] * (x[1] - x[2] / RATIO))


def test_the_twist_is_geometry_and_gets_no_noise(tmp_path: Path) -> None:
    model = model_of(GEARED, tmp_path)
    assert [model.states[i].name for i in noisy_states(model)] == ["wr", "wg"]


def test_two_positions_deform_where_each_body_feels_the_other(tmp_path: Path) -> None:
    """It is as large as the difference of what the two do, not as what either does: here they nearly move as one."""
    ones = np.ones(4)
    coupled = model_of(PAIR, tmp_path)
    names = [s.name for s in coupled.states]
    moves = np.eye(4)
    for a, b, together in (("x1", "x2", 0.995), ("v1", "v2", 0.92)):
        i, j = names.index(a), names.index(b)
        moves[i, j] = moves[j, i] = together
    (stretch,) = motions_between(coupled, motions_of_equations(coupled, ones, ones), ones, ones, moves)
    assert stretch.location == "state:x1-x2"
    assert ex.to_text(stretch.velocity) == "v1 - v2"
    assert (stretch.position_size, stretch.velocity_size) == (pytest.approx(0.1), pytest.approx(0.4))
    moves[:] = 1.0  # a rough run in which nothing bends says little of how much it does
    (stiff,) = motions_between(coupled, motions_of_equations(coupled, ones, ones), ones, ones, moves)
    assert 0 < stiff.position_size < 1e-3
    apart = model_of(PAIR.replace("40*(x1 - x2) - 2*v2", "40*x2 - 2*v2"), tmp_path)
    assert motions_between(apart, motions_of_equations(apart, ones, ones), ones, ones, moves) == []


def with_a_gap(samples: int, half_gap: float, seed: int) -> Array:
    """Run the geared pair with a clearance in its shaft, ten midpoint steps a sample; returns input and speeds."""
    rng = np.random.default_rng(seed)
    step, fine = 0.02, 10
    h, x = step / fine, np.array([0.0, 0.0, 0.0])
    torque = np.repeat(rng.uniform(-2.0, 2.0, samples // 15 + 1), 15)[:samples]
    rows = np.empty((samples, 3))

    def slope(x: Array, u: float) -> Array:
        bent = x[0] - np.clip(x[0], -half_gap, half_gap)
        shaft = 90.0 * bent + 0.4 * (x[1] - x[2] / RATIO)
        return np.array([x[1] - x[2] / RATIO, (u - shaft) / 1.4, (shaft / RATIO - 0.05 * x[2]) / 0.1])

    for i in range(samples):
        rows[i] = torque[i], x[1], x[2]
        gust = torque[i] + 0.05 * rng.standard_normal()
        for _ in range(fine):
            x = x + h * slope(x + 0.5 * h * slope(x, gust), gust)
    rows[:, 1:] += rng.standard_normal((samples, 2)) * (0.002, 0.005)
    return rows


CHANNELS = (("torque", "N m", "input"), ("rotor_speed", "rad/s", "output"), ("generator_speed", "rad/s", "output"))


@pytest.mark.diagnosis
@pytest.mark.parametrize(("half_gap", "verdict"), [(0.003, "named"), (0.0, "no_mismatch")])
def test_a_gap_in_a_shaft_is_found_at_its_twist(half_gap: float, verdict: str, tmp_path: Path) -> None:
    case = write_case(tmp_path, GEARED, 0.02, CHANNELS, with_a_gap(2000, half_gap, 1))
    found = diagnose(study(load_case(case), sham=0, seed=1, progress=lambda *_: None))
    assert found["verdict"] == verdict, found["statement"]
    if half_gap:
        (effect,) = found["effects"]
        assert (effect["id"], effect["location"]["entry"]) == ("clearance", "state:twist")
        assert effect["parameters"]["half_gap"]["value"] == pytest.approx(half_gap, rel=0.1)
