"""Free runs and predictions take the integration steps that the states need which they pass, not those of the start."""

from __future__ import annotations

import tomllib
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, free_run, simulate
from aeolid.models.integration_steps import MOST_AT_START, substeps, substeps_along
from aeolid.models.load import LinearModel
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
HELD = np.repeat(np.random.default_rng(0).uniform(0.2, 1.5, 30), 10)
FASTER: dict[str, tuple[float, Callable[[float, float], float]]] = {
    "1.5*u - 1.5*v*abs(v)": (1.0, lambda v, u: 1.5 * u - 1.5 * v * abs(v)),
    "30*u - 10*v**3": (0.1, lambda v, u: 30 * u - 10 * v**3),
    "20*u - 3*(exp(v) - 1)": (0.2, lambda v, u: 20 * u - 3 * (np.exp(v) - 1)),
    "1e4*(u - v)": (0.1, lambda v, u: 1e4 * (u - v)),
}


def first_order(derivative: str) -> Equations:
    text = f'[[state]]\nname = "v"\nderivative = "{derivative}"\n[[output]]\nname = "y"\nequation = "v"\n'
    return equations_file.from_toml(tomllib.loads(text), text, "model.toml")


def reference(slope: Callable[[float, float], float], step: float) -> Array:
    """Return the state at each sample of HELD, from rest, by an integrator that chooses its own steps."""
    v, found = 0.0, []
    for u in HELD:
        found.append(v)
        part = solve_ivp(lambda _, x, u=u: [slope(x[0], u)], (0.0, step), [v], "LSODA", rtol=1e-10, atol=1e-12)
        v = float(part.y[0, -1])
    return np.array(found)


@pytest.mark.parametrize("derivative", FASTER)
def test_a_model_that_is_slow_at_its_start_is_followed_where_it_is_fast(derivative: str) -> None:
    """At rest a drag, a cubic spring or a diode has hardly a rate; one step a sample was wrong or exploded."""
    step, slope = FASTER[derivative]
    model = first_order(derivative)
    y = simulate(compile_equations(model), HELD[:, None], model.theta, model.x0, step)[:, 0]
    expected = reference(slope, step)
    assert np.sqrt(np.mean((y - expected) ** 2)) < 1e-4 * np.std(expected)  # rate times step 0.5: 3e-4 of a mode


def test_the_states_of_a_run_say_how_many_steps_they_need() -> None:
    """Of v' = u − v³ the rate is 3v²: at v = 2 and samples of 1 s 24 steps; rows that are not finite do not ask."""
    model = first_order("u - v**3")
    compiled, u = compile_equations(model), np.ones((3, 1))
    assert substeps(compiled, np.ones(1), model.theta, model.x0, 1.0) == 1
    X = np.array([[0.0], [2.0], [np.nan], [0.5]])
    assert substeps_along(compiled, X, u, model.theta, 1.0) == 24
    assert substeps_along(compiled, np.full((4, 1), np.nan), u, model.theta, 1.0) == 1


def test_a_part_that_is_too_fast_for_any_run_is_named_as_stiff() -> None:
    """A time constant of 0.1 µs beside samples of 0.1 s: the message says what to do, instead of numbers."""
    model = first_order("1e7*(u - v)")
    with pytest.raises(DataError, match=r"too fast for \d+ integration steps in each sample of 0\.1 s"):
        simulate(compile_equations(model), HELD[:, None], model.theta, model.x0, 0.1)


def test_a_run_that_grows_without_bound_ends() -> None:
    """v' = v² leaves the finite numbers whatever the steps are; the run takes a bounded number of them."""
    model = first_order("u*v*v + 1")
    with pytest.raises(DataError, match="leaves the finite numbers at sample"):
        simulate(compile_equations(model), HELD[:, None], model.theta, model.x0, 0.5)


def test_a_given_count_is_kept() -> None:
    """Runs that are compared to the last digits take the same steps: a slope is no difference of two integrations."""
    model = first_order("1.5*u - 1.5*v*abs(v)")
    compiled = compile_equations(model)
    runs = [free_run(compiled, HELD[:, None], model.theta, np.array([x]), 0.1, 3) for x in (0.0, 1e-7)]
    rise = (runs[1] - runs[0])[:40, 0] / 1e-7
    assert rise[0] == pytest.approx(1.0, rel=1e-6) and np.all(np.diff(rise) < 0) and np.all(rise > 0)
    assert MOST_AT_START >= 3


@pytest.mark.parametrize("step", [0.1, 0.3])
def test_the_time_goes_on_within_a_sample(step: float) -> None:
    """x' = sin 2t: held over each sample the time was half a sample late, 17 % at 0.3 s. An output sees its row's."""
    text = '[[state]]\nname = "x"\nderivative = "sin(2*time_s) + 0*u"\n[[output]]\nname = "y"\nequation = "x"\n'
    text += '[[output]]\nname = "clock"\nequation = "time_s"\n'
    model = equations_file.from_toml(tomllib.loads(text), text, "model.toml")
    time = step * np.arange(100)
    columns = {"u": np.zeros(100), "time_s": time}
    u = np.column_stack([columns[s.name] for s in model.inputs])
    y = simulate(compile_equations(model), u, model.theta, model.x0, step)
    np.testing.assert_allclose(y[:, 0], (1 - np.cos(2 * time)) / 2, atol=1e-3 * step)  # 2⁴ step⁵/2880 a step
    np.testing.assert_array_equal(y[:, 1], time)


MEMORIES = {
    "an intermediate between two memories": ("a", "u", "u", "max(-100, b)", 'name = "b"\nequation = "a"'),
    "the memory itself": ("a", "u", "u", "max(-100, a)", ""),
}


@pytest.mark.parametrize("what", MEMORIES)
def test_a_memory_sees_those_before_it_as_they_are_now(what: str) -> None:
    """Through an intermediate a memory saw the one before it a sample late, and not at all where that was to settle."""
    first, following, settled, second, auxiliary = MEMORIES[what]
    text = f'[[memory]]\nname = "{first}"\nnext = "{following}"\nsettled = "{settled}"\n'
    text += f'[[memory]]\nname = "c"\nnext = "{second}"\nsettled = "0"\n[[output]]\nname = "y"\nequation = "c"\n'
    text += f"[[auxiliary]]\n{auxiliary}\n" if auxiliary else ""
    model = equations_file.from_toml(tomllib.loads(text), text, "model.toml")
    y = simulate(compile_equations(model), HELD[:, None], model.theta, model.x0, 0.1)
    np.testing.assert_array_equal(y[:, 0], HELD)


def test_an_intermediate_of_a_memory_is_known_when_that_has_settled() -> None:
    """m⁺ = m − 0.1 (m − u) from m = u: the intermediate m − u was none for ever, computed before the memory settled."""
    text = '[[memory]]\nname = "m"\nnext = "m - 0.1*a"\nsettled = "u"\n[[auxiliary]]\nname = "a"\nequation = "m - u"\n'
    text += '[[output]]\nname = "y"\nequation = "m"\n'
    model = equations_file.from_toml(tomllib.loads(text), text, "model.toml")
    y = simulate(compile_equations(model), HELD[:, None], model.theta, model.x0, 0.1)[:, 0]
    m, expected = HELD[0], []
    for u in HELD:
        m -= 0.1 * (m - u)
        expected.append(m)
    np.testing.assert_allclose(y, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('[[state]]\nname = "x"\nderivative = "(u - x)/step_s"\n', "step_s is known in"),
        ('[[auxiliary]]\nname = "a"\nequation = "u*step_s"\n', "step_s is known in"),
        ('[[memory]]\nname = "m"\nnext = "u"\nsettled = "m"\n', "settled uses itself"),
        (
            '[[memory]]\nname = "m"\nnext = "u"\nsettled = "a"\n[[auxiliary]]\nname = "a"\nequation = "2*n"\n'
            '[[memory]]\nname = "n"\nnext = "u"\nsettled = "u"\n',
            "settled uses 'n', which must stand before it",
        ),
    ],
)
def test_what_is_not_known_there_is_refused(text: str, fault: str) -> None:
    """The step outside memories ended as a defect of the program; what settles on a later memory was no number."""
    text += '[[output]]\nname = "y"\nequation = "u"\n'
    with pytest.raises(DataError, match=fault):
        equations_file.from_toml(tomllib.loads(text), text, "model.toml")


@pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])
def test_a_linear_model_and_its_equations_start_alike(hold: str) -> None:
    """x' = u − x as matrices and as a formula, from zero and from 0.7, first input 1.3: between samples as declared."""
    u = 1.3 + 0.4 * np.sin(0.3 * 0.5 * np.arange(200))
    record = Record(0.5 * np.arange(200), u[:, None], (Channel("u", "", "input", hold=hold),), 0.5, "r.csv", "")
    signals = (Signal("u"),), (Signal("y"),), (Signal("x"),)
    one = np.ones((1, 1))
    for start in (0.0, 0.7):
        space = StateSpace(-one, one, one, 0 * one, None, np.array([start]), None, 0.0, *signals)
        text = f'[[state]]\nname = "x"\nderivative = "u - x"\ninitial = {start}\n'
        text += '[[output]]\nname = "y"\nequation = "x"\n'
        model = equations_file.from_toml(tomllib.loads(text), text, "model.toml")
        linear = LinearModel(space, "zero" if start == 0.0 else "model").simulate(record)
        np.testing.assert_allclose(linear, model.simulate(record), atol=2e-3)  # of rest alone 0.2: Γ₂ u of the start
        assert linear[0, 0] == pytest.approx(start, abs=1e-12)
