"""Find the state that a fitted predictor starts other data from."""

from __future__ import annotations

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
    """
    free = Free((), (), (), fit.free.x0)  # states of effects that are not in the fit stay at rest
    noise = replace(fit.noise, var=fit.noise.var[:0])
    best, choice = np.inf, fit.point.x0[0]
    for start in (head.compiled.model.x0, fit.point.x0[0]):
        point, damping = replace(fit.point, x0=(start,)), 1e-3
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
        if value < best:
            best, choice = value, point.x0[0]
    return choice


def _squares(predictor: Evaluator, point: Point, noise: Noise) -> tuple[float, Array]:
    base = predictor.whitened(predictor.innovations(point), noise)
    return (float(base @ base) if np.all(np.abs(base) < 1e9) else np.inf), base
