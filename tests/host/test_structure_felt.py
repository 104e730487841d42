"""Outputs that feel what accelerates a state: a force that is added to its motion is read by them as well."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from aeolid.diagnose.structure.baseline import shape_forces, with_force
from aeolid.diagnose.structure.felt import felt_in
from aeolid.diagnose.structure.sums import written_out
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations

OSCILLATOR = """
[model]
name = "isolator"
time = "continuous"
[parameters]
w = { value = 19.2, free = true }
z = { value = 0.08, free = true }
M = { value = 3.0, free = true }
[[state]]
name = "q"
derivative = "v"
[[state]]
name = "v"
derivative = "DERIVATIVE"
[[output]]
name = "read"
equation = "OUTPUT"
"""


def isolator(derivative: str, output: str) -> Equations:
    text = OSCILLATOR.replace("DERIVATIVE", derivative).replace("OUTPUT", output)
    return equations_file.from_toml(tomllib.loads(text), text, "isolator.toml")


@pytest.mark.parametrize(
    ("derivative", "output", "factor", "rest"),
    [
        ("-w*w*q - 2*z*w*v - base", "-w*w*q - 2*z*w*v", 1.0, "base"),  # against the ground, not the base
        ("-w*w*q - 2*z*w*v - base", "2*z*w*v + w*w*q + 4", -1.0, "4 - base"),
        ("(push - w*w*q - 2*z*w*v)/M", "(push - w*w*q - 2*z*w*v)/M", 1.0, "0.0"),
        ("-w*w*q - 2*z*w*v + push", "(-w*w*q - 2*z*w*v + push)/9.81", 1 / 9.81, None),
        ("-w*w*sin(q) - z*v*abs(v)", "3.5 - 1000*(w*w*sin(q) + z*v*abs(v))", 1000.0, None),
    ],
)
def test_an_accelerometer_is_recognised_by_what_states_do_to_it(
    derivative: str, output: str, factor: float, rest: str | None
) -> None:
    """Whatever else it reads, in any unit; the output stays what it was while nothing is added."""
    model = isolator(derivative, output)
    found = felt_in(model.outputs[0], model.states[1], model)
    assert found is not None and found[0] == pytest.approx(factor, rel=1e-12)
    if rest is not None:
        assert ex.to_text(found[1]) == rest
    pushed = with_force(model, "v", ex.parse("7*q", "force"))
    rng = np.random.default_rng(1)
    x, u = rng.standard_normal(2), rng.standard_normal(len(model.inputs))
    mass = 3.0 if derivative.endswith("/M") else 1.0
    before, after = (compile_equations(m).read(x, u, model.theta)[0][0] for m in (model, pushed))
    assert after - before == pytest.approx(factor * 7 * x[0] / mass, rel=1e-9)
    still = compile_equations(with_force(model, "v", ex.parse("0*q", "force"))).read(x, u, model.theta)[0][0]
    assert still == pytest.approx(before, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("derivative", "output"),
    [
        ("-w*w*q - 2*z*w*v - base", "-w*w*q"),  # a spring's force alone
        ("-w*w*q - 2*z*w*v - base", "-w*w*q - 2.2*z*w*v"),
        ("-w*w*q - 2*z*w*v - base", "q"),
        ("-w*w*q - 2*z*w*v - base", "base"),
        ("(push - w*w*q)/M", "push - w*w*q"),  # a force: by M, which may move, more than what accelerates
        ("-0.05*v + push", "v"),  # a number of its own alone: a velocity is proportional to its decay
        ("-w*v + push", "v"),
        ("push", "v"),
    ],
)
def test_what_is_not_the_whole_of_an_equation_feels_no_force_on_it(derivative: str, output: str) -> None:
    model = isolator(derivative, output)
    assert felt_in(model.outputs[0], model.states[1], model) is None
    pushed = with_force(model, "v", ex.parse("7*q", "force"))
    assert ex.to_text(pushed.outputs[0].equation) == ex.to_text(model.outputs[0].equation)


CART = """
[model]
name = "pendulum on a cart"
time = "continuous"
[parameters]
m = { value = 1.0, unit = "kg", free = true }
b = { value = 5.0, unit = "N s/m", free = true }
l = { value = 0.3, unit = "m", free = true }
[[state]]
name = "v"
derivative = "(3*u - b*v + 0.2*sin(th))/(m + 0.2*sin(th)**2)"
[[state]]
name = "th"
derivative = "om"
[[state]]
name = "om"
derivative = "(9.81*sin(th) - (3*u - b*v + 0.2*sin(th))/(m + 0.2*sin(th)**2)*cos(th))/l"
[[output]]
name = "angle"
equation = "th"
"""


def test_a_force_reaches_every_state_whose_equation_repeats_the_acceleration() -> None:
    """Friction on a cart that did not turn its pendulum had no name; the pendulum's own force stays its own."""
    model = equations_file.from_toml(tomllib.loads(CART), CART, "cart.toml")
    pushed = with_force(model, "v", ex.parse("0.7", "force"))
    known = {"u": 0.4, "v": 0.2, "th": 0.3, "om": 0.1, "m": 1.1, "b": 5.0, "l": 0.3}

    def slopes(of: Equations) -> dict[str, float]:
        values = {k: np.array([v]) for k, v in known.items()}
        return {s.name: float(ex.values_of(written_out(s.derivative, of), values)[0]) for s in of.states}

    before, after = slopes(model), slopes(pushed)
    assert after["v"] - before["v"] == pytest.approx(0.7)
    assert after["om"] - before["om"] == pytest.approx(-0.7 * np.cos(0.3) / 0.3)
    assert after["th"] == before["th"]
    turned = slopes(with_force(model, "om", ex.parse("0.7", "force")))
    assert turned["om"] - before["om"] == pytest.approx(0.7 / 0.3) and turned["v"] == before["v"]  # a torque over l
    shaped, added = shape_forces(model, 10.0, 0.01)
    known |= dict.fromkeys(added, 0.0) | {p.name: p.value for p in shaped.parameters if p.name not in known}
    assert added == ("unmeasured_v", "unmeasured_om")
    known["unmeasured_v"] = 0.5
    assert slopes(shaped)["om"] - before["om"] == pytest.approx(-0.5 * np.cos(0.3) / 0.3)
