"""Runs of compiled models against independent integrators, and the laws of the one-step predictor."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from scipy.integrate import solve_ivp

from aeolid.diagnose.data.held import discretise
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.input_filters import delay_held_input, lag_held_input
from aeolid.models.integrate import (
    Compiled,
    compile_equations,
    numeric_jacobian,
    output_jacobian,
    simulate,
    substeps,
)
from aeolid.models.march import eigenvalues_at_most
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
PENDULUM = """
[parameters]
w = 4.0
d = 0.8
[[state]]
name = "angle"
derivative = "rate"
initial = 0.4
[[state]]
name = "rate"
derivative = "-w**2*sin(angle) - d*rate*abs(rate) + torque"
[[output]]
name = "tip"
equation = "sin(angle)"
[[output]]
name = "speed"
equation = "rate + 0.1*torque"
"""


def parse(text: str) -> Equations:
    return equations_file.from_toml(tomllib.loads(text), text, "model.toml")


@cache
def pendulum() -> Compiled:
    return compile_equations(parse(PENDULUM))


def held_input(samples: int, seed: int) -> Array:
    return np.repeat(np.random.default_rng(seed).normal(0, 5, size=(samples // 10 + 1, 1)), 10, axis=0)[:samples]


def predict(compiled: Compiled, u: Array, y: Array, K: Array, step: float, stride: int = 1, generate: bool = False):  # type: ignore[no-untyped-def]
    model = compiled.model
    count = substeps(compiled, np.median(u, axis=0), model.theta, model.x0, step)
    return compiled.predict(u, y, model.theta, K, model.x0, step, count, stride, generate)


def reference(u: Array, step: float) -> Array:
    def flow(_: float, x: Array, push: float) -> list[float]:
        return [x[1], -16 * np.sin(x[0]) - 0.8 * x[1] * abs(x[1]) + push]

    x, rows = np.array([0.4, 0.0]), []
    for push in u[:, 0]:
        rows.append([np.sin(x[0]), x[1] + 0.1 * push])
        x = solve_ivp(flow, (0, step), x, args=(push,), rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
    return np.array(rows)


@pytest.mark.parametrize("step", [0.02, 0.1])
def test_the_free_run_agrees_with_scipy(step: float) -> None:
    """The fourth-order rule errs by (ωh)^5/120 a step (ω = 4 rad/s); the drag lets errors live for some 2 s.

    3e-5 more for the kink of rate·|rate|, whose second derivative jumps: h³ · 400 / 100 at h = 0.02 s.
    """
    compiled = pendulum()
    u = held_input(120, 3)
    y = simulate(compiled, u, compiled.model.theta, compiled.model.x0, step)
    expected = reference(u, step)
    bound = (4 * step) ** 5 / 120 * 2 / step + 3e-5
    assert np.max(np.abs(y - expected) / expected.std(axis=0)) < bound


def test_the_bound_is_never_below_the_fastest_eigenvalue() -> None:
    """2000 matrices of 1 to 8 rows, in units up to a million times apart: else a fast model ran in steps too long."""
    rng = np.random.default_rng(1)
    for _ in range(2000):
        n = int(rng.integers(1, 9))
        matrix = rng.standard_normal((n, n)) * 10 ** rng.uniform(-6, 6, (n, 1))
        assert eigenvalues_at_most(matrix) >= np.max(np.abs(np.linalg.eigvals(matrix))) * (1 - 1e-12)
    assert not np.isfinite(eigenvalues_at_most(np.full((2, 2), 1e100))) and eigenvalues_at_most(np.zeros((0, 0))) == 0.0


@pytest.mark.parametrize(("step", "count"), [(0.1, 1), (0.2, 2), (1.0, 8)])
def test_the_steps_follow_the_fastest_eigenvalue(step: float, count: int) -> None:
    """A pendulum of 4 rad/s, at most half a radian a step: at rest, and where it swings against its drag."""
    compiled, u = pendulum(), np.zeros(1)
    rest = np.zeros(2)
    assert substeps(compiled, u, compiled.model.theta, rest, step) == count
    assert substeps(compiled, u, compiled.model.theta, np.array([0.0, 1e-9]), step) == count


def test_more_substeps_converge_with_the_fourth_power() -> None:
    compiled = pendulum()
    model = compiled.model
    u, step = held_input(40, 5), 0.1
    expected = reference(u, step)
    blank, K = np.full((40, 2), np.nan), np.zeros((2, 2))
    errors = []
    for count in (2, 4, 8):
        y = compiled.predict(u, blank, model.theta, K, model.x0, step, count, 1, False)[1]
        errors.append(np.linalg.norm(y - expected))
    ratios = np.array(errors[:-1]) / errors[1:]  # 16 in theory; |rate|·rate has a kink, which costs some of it
    assert np.all(ratios > 9), ratios


def linear(order: int = 4, seed: int = 2) -> StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((order, order))
    A *= 0.9 / np.max(np.abs(np.linalg.eigvals(A)))
    return StateSpace(
        A=A, B=rng.standard_normal((order, 2)), C=rng.standard_normal((2, order)), D=rng.standard_normal((2, 2)),
        K=0.1 * rng.standard_normal((order, 2)), x0=rng.standard_normal(order), sample_time_s=0.1,
        inputs=(Signal("pitch", "deg", offset=1.5), Signal("torque", "N m", offset=-3.0)),
        outputs=(Signal("speed", "rad/s", offset=7.0), Signal("acc", "m/s^2")),
        states=tuple(Signal(f"x{i + 1}") for i in range(order)), innovation_covariance=np.eye(2),
    )  # fmt: skip


def test_a_discrete_model_equals_the_state_space_run() -> None:
    """Both do the same sums in another order: equality to rounding."""
    model = linear()
    u = np.random.default_rng(4).normal(1.0, 2.0, size=(300, 2))
    converted = compile_equations(equations_of(model, shaped_noise=True))
    y = simulate(converted, u, converted.model.theta, converted.model.x0, 0.1)
    np.testing.assert_allclose(y, model.simulate(u), rtol=1e-11, atol=1e-11)


def test_a_continuous_model_is_held_over_a_sample() -> None:
    text = (
        '[[state]]\nname = "a"\nderivative = "-2*a + u"\n[[state]]\nname = "b"\nderivative = "a - 0.5*b"\n'
        '[[output]]\nname = "y"\nequation = "b"\n'
    )
    continuous = linear(2)
    system = StateSpace(
        A=np.array([[-2.0, 0.0], [1.0, -0.5]]), B=np.array([[1.0], [0.0]]), C=np.array([[0.0, 1.0]]),
        D=np.zeros((1, 1)), K=None, x0=np.zeros(2), sample_time_s=0.0, inputs=(Signal("u"),),
        outputs=(Signal("y"),), states=continuous.states, innovation_covariance=None,
    )  # fmt: skip
    u = held_input(200, 7)
    exact = discretise(system, 0.05).simulate(u)
    compiled = compile_equations(parse(text))
    y = simulate(compiled, u, compiled.model.theta, compiled.model.x0, 0.05)
    np.testing.assert_allclose(y, exact, rtol=0, atol=5e-6 * np.std(exact))  # 0.1^5/120 a step, 40 steps of memory


def fine(u: Array, count: int) -> Array:
    return np.repeat(u, count)


@pytest.mark.parametrize("tau", [0.02, 0.3, 1.0, 4.3])
def test_a_lag_equals_its_fine_simulation(tau: float) -> None:
    """The mean over each step of 1/(τs+1) on a held input; reference: exact recursion on 1000 points a step."""
    u, count = np.random.default_rng(8).standard_normal(60), 1000
    decay = np.exp(-1 / (count * tau))
    state = signal.lfilter([1 - decay], [1, -decay], fine(u, count), zi=[decay * u[0]])[0]
    before = np.concatenate([[u[0]], state[:-1]])
    means = 0.5 * (before + state).reshape(60, count).mean(axis=1)
    np.testing.assert_allclose(lag_held_input(u, tau), means, atol=1e-4)  # trapezoid: (1/(1000·0.02))²/12 = 2e-4 of τ


@pytest.mark.parametrize("delay", [0.0, 0.25, 1.0, 3.7, 80.0])
def test_a_delay_equals_its_fine_simulation(delay: float) -> None:
    u, count = np.random.default_rng(9).standard_normal(60), 1000
    shift = round(delay * count)
    late = np.concatenate([np.full(shift, u[0]), fine(u, count)])[: 60 * count]
    np.testing.assert_allclose(delay_held_input(u, delay), late.reshape(60, count).mean(axis=1), atol=1e-12)


def test_no_lag_is_no_change() -> None:
    u = np.random.default_rng(10).standard_normal(50)
    np.testing.assert_array_equal(lag_held_input(u, 0.0), u)
    np.testing.assert_array_equal(delay_held_input(u, 0.0), u)


def test_corrections_at_a_stride_keep_the_model_at_the_fine_rate() -> None:
    """Without gain a stride changes which rows are read, nothing else; with gain the rows in between are not used."""
    compiled = pendulum()
    u = held_input(120, 3)
    blank, none, gain = np.full((120, 2), np.nan), np.zeros((2, 2)), np.full((2, 2), 0.05)
    every = predict(compiled, u, blank, none, 0.02)
    third = predict(compiled, u, blank[:40], none, 0.02, stride=3)
    np.testing.assert_array_equal(third[1], every[1][::3])
    np.testing.assert_array_equal(third[2], every[2][::3])
    measured = np.random.default_rng(1).standard_normal((40, 2))
    # a correction at row k acts after the model ran to the next measured row
    strided = predict(compiled, u, measured, gain, 0.02, stride=3)
    x = compiled.model.x0
    for k in range(40):
        run = compiled.predict(u[3 * k : 3 * k + 3], blank[:3], compiled.model.theta, none, x, 0.02, 1, 1, False)
        np.testing.assert_allclose(strided[1][k], run[1][0], rtol=1e-12, atol=1e-12)
        x = run[2][3] + gain @ (measured[k] - run[1][0])
    np.testing.assert_allclose(strided[2][-1], x, rtol=1e-12, atol=1e-12)


def test_a_missing_output_corrects_nothing() -> None:
    compiled = pendulum()
    u, rng = held_input(60, 3), np.random.default_rng(2)
    y, K = rng.standard_normal((60, 2)), 0.1 * rng.standard_normal((2, 2))
    y[20:30, 0] = np.nan
    e, predicted, states = predict(compiled, u, y, K, 0.02)
    assert np.all(np.isnan(e[20:30, 0])) and np.all(np.isfinite(states)) and np.all(np.isfinite(predicted))
    mute = y.copy()
    mute[20:30, 0] = predicted[20:30, 0]  # a measurement that agrees corrects nothing either
    np.testing.assert_array_equal(predict(compiled, u, mute, K, 0.02)[2], states)


@pytest.mark.parametrize("discrete", [False, True])
def test_generating_and_predicting_are_inverse(discrete: bool) -> None:
    """y = ŷ(e) + e, and the predictor run on that y gives e back to rounding."""
    compiled = compile_equations(equations_of(linear(), shaped_noise=True)) if discrete else pendulum()
    model, rng = compiled.model, np.random.default_rng(3)
    n, step = len(model.states), 0.1 if discrete else 0.02
    u, innovations = rng.standard_normal((80, len(model.inputs))), rng.standard_normal((80, 2))
    K = 0.05 * rng.standard_normal((n, 2))
    _, predicted, made = predict(compiled, u, innovations, K, step, generate=True)
    found, _, states = predict(compiled, u, predicted + innovations, K, step)
    np.testing.assert_allclose(found, innovations, atol=1e-9)
    np.testing.assert_allclose(states, made, atol=1e-9)


def test_jacobians_are_the_derivatives() -> None:
    """Central differences of step 1e-6 in double precision: 1e-8 relative."""
    compiled = pendulum()
    x, u = np.array([0.3, -0.7]), np.array([0.5])
    J = numeric_jacobian(compiled, x, u, compiled.model.theta)
    np.testing.assert_allclose(J, [[0, 1], [-16 * np.cos(0.3), -0.8 * 2 * 0.7]], atol=1e-7)
    C = output_jacobian(compiled, x, u, compiled.model.theta)
    np.testing.assert_allclose(C, [[np.cos(0.3), 0], [0, 1]], atol=1e-7)


def test_another_sample_time_is_refused() -> None:
    compiled = compile_equations(equations_of(linear(), shaped_noise=True))
    with pytest.raises(DataError, match="resample"):
        simulate(compiled, np.zeros((5, 2)), compiled.model.theta, compiled.model.x0, 0.2)


def test_division_by_zero_is_no_crash() -> None:
    text = '[[state]]\nname = "a"\nderivative = "1/(a - a)"\n[[output]]\nname = "y"\nequation = "a + 0*u"\n'
    compiled = compile_equations(parse(text))
    with pytest.raises(DataError, match="finite"):
        simulate(compiled, np.zeros((5, 1)), compiled.model.theta, compiled.model.x0, 0.2)


def test_a_model_without_states_reads_its_inputs() -> None:
    compiled = compile_equations(parse('[[output]]\nname = "y"\nequation = "2*u + 1"\n'))
    np.testing.assert_array_equal(
        simulate(compiled, np.array([[1.0], [2.0]]), np.zeros(0), np.zeros(0), 0.1), [[3], [5]]
    )
