"""What a model remembers from sample to sample: written and read, settled at the start, alike in every kind of run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import Compiled, compile_equations, simulate

Array = NDArray[np.float64]
STEP = 0.1
CONTINUOUS = """
[model]
name = "a smoothed reading, a play and a count"
[parameters]
tau = { value = 0.35, min = 0.0, unit = "s", free = true }
gap = 0.3
[[auxiliary]]
name = "twice"
equation = "2*x"
[[memory]]
name = "slow"
next = "slow + (twice - slow)*(1 - exp(-step_s/tau))"
settled = "twice"
unit = "m"
[[memory]]
name = "before"
next = "slack"
settled = "twice + u"
[[memory]]
name = "slack"
next = "min(max(slack, twice + u - gap), twice + u + gap)"
settled = "twice + u"
[[memory]]
name = "passed"
next = "passed + step_s"
settled = "-step_s"
[[state]]
name = "x"
derivative = "-x + u"
initial = { value = 0.4, free = true }
unit = "m"
[[output]]
name = "read"
equation = "slow"
unit = "m"
[[output]]
name = "loose"
equation = "slack"
[[output]]
name = "late"
equation = "before"
[[output]]
name = "clock"
equation = "passed"
"""
DISCRETE = CONTINUOUS.replace('count"\n', 'count"\ntime = "discrete"\nsample_time_s = 0.1\n').replace(
    'derivative = "-x + u"', 'next = "0.9*x + 0.1*u"'
)
RNG = np.random.default_rng(11)
U = np.repeat(RNG.standard_normal(40), 3)[:, None]


def load(text: str, folder: Path) -> Equations:
    (folder / "model.toml").write_text(text)
    return equations_file.load(folder / "model.toml")


@pytest.fixture(scope="module", params=["continuous", "discrete"])
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    text = CONTINUOUS if request.param == "continuous" else DISCRETE
    return compile_equations(load(text, tmp_path_factory.mktemp(str(request.param))))


def states(model: Equations, u: Array, corrections: Array | None = None) -> Array:
    """Reference: x' = u − x exact for a held input, or x⁺ = 0.9 x + 0.1 u; after each row a correction is added."""
    x, keep = np.empty(len(u) + 1), 0.9 if model.sample_time_s else np.exp(-STEP)
    x[0] = 0.4
    for k, v in enumerate(u):
        x[k + 1] = keep * x[k] + (1 - keep) * v + (0.0 if corrections is None else corrections[k])
    return x


def readings(x: Array, u: Array, step: float = STEP) -> Array:
    """Reference for all four outputs, each with means of its own."""
    twice, rows = 2 * x[: len(u)], len(u)
    a = np.exp(-step / 0.35)
    slow = signal.lfilter([1 - a], [1, -a], twice, zi=[a * twice[0]])[0]
    slack, at = np.empty(rows), twice[0] + u[0]
    for k in range(rows):
        aim = twice[k] + u[k]
        at = aim - 0.3 if aim - at > 0.3 else aim + 0.3 if at - aim > 0.3 else at
        slack[k] = at
    late = np.concatenate([slack[:1], slack[:-1]])
    return np.column_stack([slow, slack, late, step * np.arange(rows)])


def predict(c: Compiled, y: Array, K: Array, *, stride: int = 1, generate: bool = False) -> tuple[Array, Array, Array]:
    return c.predict(U, y, c.model.theta, K, c.model.x0, STEP, 4, stride, generate)


def test_a_free_run_remembers(compiled: Compiled) -> None:
    """Classical Runge–Kutta at a step of 0.1 of the time constant errs by 1e-7 a step; the memories are exact."""
    y = simulate(compiled, U, compiled.model.theta, compiled.model.x0, STEP)
    np.testing.assert_allclose(y, readings(states(compiled.model, U[:, 0]), U[:, 0]), atol=2e-6)


def test_memories_start_settled(compiled: Compiled) -> None:
    """A plant at rest under a constant input shows no transient of its memories, wherever it rests."""
    model = compiled.model
    for level in (-3.0, 0.0, 7.0):
        u = np.full((30, 1), level)
        y = simulate(compiled, u, model.theta, np.concatenate([[level], np.full(4, np.nan)]), STEP)
        np.testing.assert_allclose(y[:, :3], np.tile([2 * level, 3 * level, 3 * level], (30, 1)), rtol=1e-12)
    x = compiled.settled(np.array([2.0]), np.array([1.0]), model.theta, STEP)
    np.testing.assert_allclose(x, [2.0, 4.0, 5.0, 5.0, 0.0], atol=1e-15)
    assert np.all(np.isnan(model.x0[1:])) and len(model.x0) == 5


def test_a_start_may_be_given(compiled: Compiled) -> None:
    """What does not start as NaN goes on from where it stood."""
    model = compiled.model
    _, P, X = predict(compiled, np.full((len(U), 4), np.nan), np.zeros((1, 4)))
    half = len(U) // 2
    again = compiled.predict(
        U[half:], np.full((len(U) - half, 4), np.nan), model.theta, np.zeros((1, 4)), X[half], STEP, 4, 1, False
    )
    np.testing.assert_array_equal(again[1], P[half:])
    np.testing.assert_array_equal(again[2], X[half:])


def test_a_prediction_with_gaps_is_corrected_where_there_is_something(compiled: Compiled) -> None:
    """The correction goes to the states, the memories follow from them; reference apart from the product."""
    model = compiled.model
    y = readings(states(model, U[:, 0]), U[:, 0]) + 0.2 * np.random.default_rng(5).standard_normal((len(U), 4))
    y[20:50] = np.nan
    y[70, 1] = np.nan
    K = np.array([[0.2, 0.05, 0.0, 0.0]])
    E, P, X = predict(compiled, y, K)
    assert np.all(np.isfinite(P)) and np.all(np.isfinite(X[1:]))
    np.testing.assert_array_equal(np.isnan(E), np.isnan(y))
    np.testing.assert_allclose(E[np.isfinite(y)], (y - P)[np.isfinite(y)], atol=1e-15)
    corrections = np.nansum(E * K, axis=1)
    x = states(model, U[:, 0], corrections)
    np.testing.assert_allclose(X[:, 0], x, atol=2e-6)
    np.testing.assert_allclose(P, readings(x, U[:, 0]), atol=5e-6)


def test_innovations_generate_what_they_came_from(compiled: Compiled) -> None:
    y = np.random.default_rng(6).standard_normal((len(U), 4))
    K = np.array([[0.2, 0.05, 0.01, 0.0]])
    E, _, X = predict(compiled, y, K)
    nothing, generated, path = predict(compiled, E, K, generate=True)
    np.testing.assert_array_equal(nothing, E)
    np.testing.assert_allclose(generated + E, y, atol=1e-12)
    np.testing.assert_allclose(path[:, 0], X[:, 0], atol=1e-12)


def test_memories_are_renewed_at_the_rate_of_the_outputs(compiled: Compiled) -> None:
    """With a stride the state runs on every input, the memories once a row, with the time of a row."""
    model = compiled.model
    P = predict(compiled, np.full((40, 4), np.nan), np.zeros((1, 4)), stride=3)[1]
    x = states(model, U[:, 0])
    np.testing.assert_allclose(P, readings(x[:-1][::3], U[::3, 0], 3 * STEP), atol=2e-6)


@pytest.mark.parametrize("text", [CONTINUOUS, DISCRETE], ids=["continuous", "discrete"])
def test_a_file_keeps_its_memories(text: str, tmp_path: Path) -> None:
    model = load(text, tmp_path)
    written = equations_file.to_toml(model)
    again = load(written, tmp_path)
    assert [(m.name, m.unit) for m in again.memories] == [("slow", "m"), ("before", ""), ("slack", ""), ("passed", "")]
    assert equations_file.to_toml(again) == written
    runs = [simulate(compile_equations(m), U, m.theta, m.x0, STEP) for m in (model, again)]
    np.testing.assert_array_equal(*runs)


def test_the_command_simulates_a_model_with_memories(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(CONTINUOUS)
    (tmp_path / "roles.toml").write_text(
        '[recording]\nsample_time_s = 0.1\n[[channel]]\nname = "u"\nunit = "m"\nrole = "input"\n'
    )
    (tmp_path / "rec.csv").write_text("u\n" + "\n".join(f"{v!r}" for v in U[:, 0].tolist()) + "\n")
    names = [str(tmp_path / n) for n in ("model.toml", "rec.csv", "roles.toml", "sim.csv")]
    assert main(["simulate", names[0], names[1], "--roles", names[2], "--out", names[3]]) == 0
    table = np.genfromtxt(names[3], delimiter=",", names=True)
    model = equations_file.load(names[0])
    y = simulate(compile_equations(model), U, model.theta, model.x0, STEP)
    np.testing.assert_allclose(np.column_stack([table[o.name] for o in model.outputs]), y, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('settled = "twice"\n', "", r"\[\[memory\]\] 1 slow: settled is missing"),
        ('name = "passed"', 'name = "x"', "'x' is defined twice"),
        ('name = "passed"', 'name = "step_s"', "'step_s' cannot be a name"),
        ('next = "slack"', 'next = "round(slack)"', "function 'round' is not known"),
        ('next = "slack"', "next = 3", "an expression in quotes is needed"),
        ('settled = "-step_s"', 'settled = "-step_s"\nstart = 0', "unknown key 'start'"),
    ],
)
def test_a_slip_in_a_memory_is_named(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in CONTINUOUS
    with pytest.raises(DataError, match=said):
        load(CONTINUOUS.replace(old, new, 1), tmp_path)
