"""Find the state that a fitted predictor starts other data from."""

from __future__ import annotations

import ast
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.evaluation import Evaluator
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.noise import Noise
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.sensitivity import sensitivity
from aeolid.diagnose.predictor.steps import limited_step, limits_of

Array = NDArray[np.float64]


def settled(head: Evaluator, fit: Fit) -> Array:
    """Fit the initial state on the head of a segment: damped least squares from the declared and the fitted start.

    In white noise: a coloured one takes the level of slow states for its own, and tells a start by differences alone.
    Where an output shows an absolute value, the mirror image of each start is tried, too: a motor that ran backwards
    was begun forwards, and the 45 nats that this cost refused a rectified sensor of 1,455.
    """
    free = Free((), (), (), fit.free.x0)  # states of effects that are not in the fit stay at rest
    noise = replace(fit.noise, var=fit.noise.var[:0])
    starts = [head.compiled.model.x0, fit.point.x0[0]]
    if _shows_no_sign(head):
        starts += [-start for start in starts]
    best, choice = np.inf, fit.point.x0[0]
    for start in starts:
        value, x0 = _descended(head, fit.point, start, free, noise)
        if value < best:
            best, choice = value, x0
    return choice


def _shows_no_sign(head: Evaluator) -> bool:
    """Tell whether an output of the model is an absolute value, which two states share."""
    calls = (n for o in head.compiled.model.outputs for n in ast.walk(o.equation) if isinstance(n, ast.Call))
    return any(isinstance(n.func, ast.Name) and n.func.id == "abs" for n in calls)


def _descended(head: Evaluator, point: Point, start: Array, free: Free, noise: Noise) -> tuple[float, Array]:
    """Return the least sum of squares that damped least squares reach from a start, and the state there."""
    point, damping = replace(point, x0=(start,)), 1e-3
    value, base = _squares(head, point, noise)
    for _ in range(15):
        if not np.isfinite(value):
            break
        jacobian = sensitivity(head, point, noise, base, free)
        normal = jacobian.T @ jacobian, jacobian.T @ base  # no prior knows of the start
        limits = limits_of(head, point, free, jacobian.shape[1])
        before = value
        for _ in range(8):
            trial = head.move(point, free, limited_step(*normal, damping, limits))
            trial_value, trial_base = _squares(head, trial, noise)
            if trial_value < value:
                point, value, base, damping = trial, trial_value, trial_base, damping * 0.1
                break
            damping = damping * 10 + 1e-6
        if before - value < 1e-3 * (1 + value):
            break
    return value, point.x0[0]


def _squares(predictor: Evaluator, point: Point, noise: Noise) -> tuple[float, Array]:
    base = predictor.whitened(predictor.innovations(point), noise)
    return (float(base @ base) if np.all(np.abs(base) < 1e9) else np.inf), base
