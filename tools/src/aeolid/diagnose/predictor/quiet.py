"""Lower noise that nobody would miss, so that rounding does not choose what the data leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.forces import FORCE, RATE
from aeolid.models.equations import Equations

Bools = NDArray[np.bool_]
_QUIETEST = 1e-2  # least amplitude of quieter noise, in sizes


def quieted(predictor: Predictor, point: Point, free: Free) -> Point:
    """Lower each process noise as long as that costs next to nothing.

    Where a sensor is nearly exact, noise a thousand times too loud predicts as well: the gain changes no more. What was
    fitted from there on stayed there, at an amplitude that rounding chose, and ended at one of several optima (of a
    positioning stage 4 and 50 nats apart). From quiet noise it ends at the same one, if not always the highest.
    """
    limit, states = predictor.objective(point) + in_force().predictor.unheard_noise_nats, len(point.x0[0])
    for i in (i for i in free.noise if i < states):
        while point.noise[i] > _QUIETEST:
            noise = point.noise.copy()
            noise[i] /= np.sqrt(10.0)
            trial = replace(point, noise=noise)
            if predictor.objective(trial) > limit:
                break
            point = trial
    return _forgetful(predictor, point, free, limit)


def _forgetful(predictor: Predictor, point: Point, free: Free, limit: float) -> Point:
    """Give silent forces their declared memory back: of one without amplitude rounding chose 4 seconds or an hour."""
    model, theta = predictor.compiled.model, point.theta.copy()
    for _, rate in silent_forces(model, point):
        if rate in free.theta:
            theta[rate] = model.parameters[rate].value
    trial = replace(point, theta=theta)
    return point if np.array_equal(theta, point.theta) or predictor.objective(trial) > limit else trial


def audible(model: Equations, fit: Fit) -> Bools:
    """Tell which columns of a fit's sensitivities say what the fit could do: all but those of silent forces.

    An amplitude that was fitted to nothing imitates nothing. Its column is next to nothing, too, but a direction as
    good as any: the tanks' overflow had z 13.2 or 10.9, by what memory rounding had left to a silent force.
    """
    silent = silent_forces(model, fit.point)
    found = np.ones(fit.jacobian.shape[1], dtype=bool)
    theta, noise = {rate for _, rate in silent}, {state for state, _ in silent}
    found[: len(fit.free.theta)] = [i not in theta for i in fit.free.theta]
    found[len(fit.free.theta) :][: len(fit.free.noise)] = [i not in noise for i in fit.free.noise]
    return found


def silent_forces(model: Equations, point: Point) -> list[tuple[int, int]]:
    """List the unmeasured forces without amplitude: index of the state, and of the rate at which it forgets."""
    place = {p.name: i for i, p in enumerate(model.parameters)}
    pairs = [(i, place.get(RATE + s.name.removeprefix(FORCE))) for i, s in enumerate(model.states)]
    return [(i, rate) for i, rate in pairs if rate is not None and point.noise[i] <= _QUIETEST]
