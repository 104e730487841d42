"""A fit's step within its limits: against a general-purpose optimiser, and the walls' slopes against differences."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, minimize

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.steps import Limits, expected_gain, limited_step, limits_of, next_damping
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations

Array = NDArray[np.float64]


def problem(seed: int, size: int = 8) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((40, size)) * 10.0 ** rng.uniform(-3, 3, size)
    return J.T @ J, J.T @ rng.standard_normal(40)


def free_limits(count: int, size: int) -> Limits:
    return Limits(np.zeros(count), np.full(count, -np.inf), np.full(count, np.inf), np.zeros((0, size)), np.zeros(0))


def test_without_limits_it_is_the_damped_solution() -> None:
    gram, push = problem(1)
    step = limited_step(gram, push, 0.0, free_limits(3, 8))
    np.testing.assert_allclose(gram @ step, push, rtol=1e-6)
    damped = limited_step(gram, push, 0.5, free_limits(3, 8))
    np.testing.assert_allclose((gram + 0.5 * np.diag(np.diag(gram))) @ damped, push, rtol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_the_limited_step_is_the_best_within_the_limits(seed: int) -> None:
    """Two entries stand at the ends of their ranges, one wall lies in the way; SLSQP, scaled, is the reference."""
    gram, push = problem(seed)
    size = np.sqrt(np.diag(gram))
    plain = np.linalg.solve(gram, push)
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    low[0], high[1] = (0.0 if plain[0] < 0 else -np.inf), (0.0 if plain[1] > 0 else np.inf)
    wall = np.random.default_rng(seed + 50).standard_normal(8) * size
    slack = 0.3 * abs(wall @ plain)
    limits = Limits(np.zeros(3), low, high, wall[None] * np.sign(wall @ plain), np.array([slack]))
    step = limited_step(gram, push, 0.0, limits)
    assert np.all(step[:3] >= low - 1e-12) and np.all(step[:3] <= high + 1e-12)
    assert (limits.slopes @ step)[0] <= slack * (1 + 1e-9)

    def cost(z: Array) -> float:
        s = z / size
        return float(0.5 * s @ gram @ s - push @ s)

    bounds = [(lo * f, hi * f) for lo, hi, f in zip(low, high, size, strict=False)] + [(None, None)] * 5
    constraint = LinearConstraint(limits.slopes / size, -np.inf, slack)
    best = minimize(cost, np.zeros(8), bounds=bounds, constraints=constraint, method="SLSQP", tol=1e-14)
    assert cost(step * size) == pytest.approx(best.fun, rel=1e-5, abs=1e-8)


OSCILLATOR = """
[parameters]
w = { value = 3.0, min = 0.5, max = 10.0, free = true }
d = { value = 0.05, min = 0.0, max = 5.0, free = true }
[[state]]
name = "q"
derivative = "v"
[[state]]
name = "v"
derivative = "-w**2*q - d*v + u"
[[output]]
name = "position"
equation = "q"
[[output]]
name = "speed"
equation = "v"
"""


def slow_predictor() -> tuple[Predictor, Point]:
    """Return a predictor that hardly forgets: a lightly damped oscillator with small gains."""
    compiled = compile_equations(equations_file.from_toml(tomllib.loads(OSCILLATOR), OSCILLATOR, "model.toml"))
    rng = np.random.default_rng(1)
    segment = Segment(rng.standard_normal((200, 1)), rng.standard_normal((200, 2)), 0.1, "test", 0.0, 0)
    two = np.ones(2)
    scales = Scales(
        np.array([3.0, 0.05]), np.ones((2, 2)), two, np.array([0.5, 0.0]), np.array([10.0, 5.0]),
        Prior(compiled.model.theta, np.zeros((0, 2))), two,
    )  # fmt: skip
    K = np.array([[0.004, 0.001], [-0.002, 0.003]])
    return Predictor(compiled, (segment,), scales, 0), Point(compiled.model.theta, np.zeros(4), K, (np.zeros(2),))


def modulus(predictor: Predictor, point: Point) -> float:
    from aeolid.diagnose.predictor.gains import closed_loop

    assert point.K is not None
    closed, _ = closed_loop(predictor.compiled, predictor.middle, point.theta, point.K, predictor.segments[0].step)
    return float(np.max(np.abs(np.linalg.eigvals(closed))))


def test_the_walls_slopes_are_those_of_the_eigenvalues() -> None:
    """Central differences of the modulus, 1e-5 wide, agree to 1e-4; the slack is half the distance from the circle."""
    predictor, point = slow_predictor()
    free = Free((0, 1), (), tuple((i, j) for i in range(2) for j in range(2)), (0, 1))
    limits = limits_of(predictor, point, free, 8)
    assert len(limits.slack) == 2  # a pair
    np.testing.assert_allclose(limits.slack, 0.5 * (1 - modulus(predictor, point)))
    h = 1e-5
    for place in range(6):
        values = []
        for side in (h, -h):
            if place < 2:
                theta = point.theta.copy()
                theta[place] += side
                values.append(modulus(predictor, replace(point, theta=theta)))
            else:
                K = np.array(point.K)
                K[divmod(place - 2, 2)] += side
                values.append(modulus(predictor, replace(point, K=K)))
        slope = (values[0] - values[1]) / (2 * h)
        np.testing.assert_allclose(limits.slopes[:, place], slope, rtol=1e-3, atol=1e-5)
    np.testing.assert_array_equal(limits.slopes[:, 6:], 0.0)  # a start moves no eigenvalue


def test_no_walls_where_gains_follow_from_noise_or_all_is_forgotten() -> None:
    predictor, point = slow_predictor()
    gains = tuple((i, j) for i in range(2) for j in range(2))
    assert not len(limits_of(predictor, replace(point, K=None), Free((0,), (0,), (), ()), 2).slack)
    fast = replace(point, K=np.array([[0.5, 0.0], [0.0, 0.5]]))
    assert not len(limits_of(predictor, fast, Free((0,), (), gains, ()), 5).slack)


def test_damping_follows_what_a_step_gained_of_what_was_expected() -> None:
    assert next_damping(1.0, 0.9) < 1.0 == next_damping(1.0, 0.5) < next_damping(1.0, 0.1)
    rng = np.random.default_rng(2)
    before, after = (float(np.sum(s * rng.standard_normal(1000) ** 2)) for s in (1.0, 0.3))
    level = before / 1000  # residuals of size one before
    gained = 0.5 * 1000 * np.log(before / after)
    assert expected_gain(0.5 * (before - after) / level, 1000) == pytest.approx(gained)
    assert expected_gain(1.0, 10**6) == pytest.approx(1.0, rel=1e-5)
    assert np.isfinite(expected_gain(1e9, 10)) and expected_gain(0.0, 10) > 0
