"""A free gain has to let errors die out wherever the data lead a nonlinear model, at a stop as between stops."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.bounded import held_starts, runs_away_at
from aeolid.diagnose.predictor.evaluation import HUGE
from aeolid.diagnose.predictor.gains import forgets
from aeolid.diagnose.predictor.point import Free, Point, Prior, Scales
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations

Array = NDArray[np.float64]
STEP, STOP = 0.1, 0.2
A = np.array([[0.98, 0.0985], [-0.39, 0.9]])  # of a swing at 0.32 Hz, sampled
STIFF = (
    20.0  # what a stop takes of the speed in a sample, by the way into it; the new speed moves on from the old place
)
STOPPED = -STIFF * np.array([A[0, 1], 1.0])
MODEL = f"""
[model]
time = "discrete"
sample_time_s = {STEP}
[parameters]
stop = {{ value = {STOP}, min = 0.0, max = 10.0, free = true }}
[[state]]
name = "q"
next = "{A[0, 0]}*q + {A[0, 1]}*(v - {STIFF}*max(q - stop, 0))"
[[state]]
name = "v"
next = "{A[1, 0]}*q + {A[1, 1]}*v + 0.5*u - {STIFF}*max(q - stop, 0)"
[[output]]
name = "position"
equation = "q"
"""
GAINS = Free((), (), ((0, 0), (1, 0)), ())


@cache
def predictor(stop: float = STOP) -> Predictor:
    """Return a predictor on a recording that touches the stop in a few rows, where it lies at 0.2."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-0.2, 0.2], 60), 5)
    x, y = np.zeros(2), np.empty((len(u), 1))
    for k, drive in enumerate(u):
        y[k] = x[0] + 1e-3 * rng.standard_normal()
        push = 0.5 * drive + 5e-3 * rng.standard_normal()
        x = A @ x + STOPPED * max(x[0] - STOP, 0.0) + [0.0, push]
    assert 3 < np.sum(y > STOP) < 30
    model = MODEL.replace(f"value = {STOP}", f"value = {stop}")
    compiled = compile_equations(equations_file.from_toml(tomllib.loads(model), model, "model.toml"))
    size = np.array([0.1, 0.3])
    scales = Scales(
        np.array([STOP]), size[:, None], size, np.array([0.0]), np.array([10.0]), Prior(np.zeros(1), np.zeros((1, 1))),
        y.std(axis=0),
    )  # fmt: skip
    return Predictor(compiled, (Segment(u[:, None], y, STEP, "touches", 0.0, 10),), scales, 0)


def start(gain: Array, stop: float = STOP) -> Point:
    return Point(np.array([stop]), np.zeros(3), gain, (np.zeros(2),))


def radius(gain: Array, touching: bool) -> float:
    F = A - gain @ [[1.0, 0.0]] + (np.outer(STOPPED, [1.0, 0.0]) if touching else 0.0)
    return float(np.max(np.abs(np.linalg.eigvals(F))))


def wild() -> Array:
    """Return a gain that forgets between stops and takes the model into one ever further."""
    gain = np.array([[1.5], [5.0]])
    assert radius(gain, False) < 1 < radius(gain, True)
    return gain


def test_a_gain_that_runs_away_at_a_stop_is_found_by_the_rows_that_touch_it() -> None:
    places = runs_away_at(predictor(), start(wild()))
    assert max(x[0] for x, _ in places) > STOP
    calm = np.array([[0.7], [3.0]])
    assert radius(calm, True) < 1
    assert runs_away_at(predictor(), start(calm)) == ()


def test_a_model_that_never_touches_its_stop_is_left_alone() -> None:
    assert runs_away_at(predictor(5.0), start(wild(), 5.0)) == ()


@pytest.mark.parametrize("iterations", [0, 20])
def test_a_fit_ends_with_a_gain_that_forgets_everywhere(iterations: int) -> None:
    p = predictor()
    fit = p.fit(start(wild()), GAINS, iterations)
    assert fit is not None and fit.point.K is not None
    for x in (np.zeros(2), np.array([STOP + 0.1, 0.0])):
        assert forgets(p.compiled, (x, np.zeros(1)), fit.point.theta, fit.point.K, STEP)
    assert runs_away_at(p, fit.point) == ()


def test_places_make_the_objective_endless_and_a_smaller_gain_is_gone_on_from() -> None:
    p, point = predictor(), start(wild())
    held = p.held_at(runs_away_at(p, point))
    assert p.objective(point) < HUGE == held.objective(point)
    (smaller,) = held_starts(held, (point,), GAINS)
    assert smaller.K is not None and held.objective(smaller) < HUGE
    assert np.allclose(smaller.K / wild(), smaller.K[0, 0] / wild()[0, 0]) and radius(smaller.K, True) < 1
    assert held_starts(held, (point,), Free((), (), (), (0,))) == []
