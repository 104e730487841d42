"""Give a baseline the values that a wiring of its channels asks for, so that these are not taken for a wiring (S0)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from aeolid.diagnose.baseline.wiring_columns import Wiring
from aeolid.diagnose.baseline.wiring_evidence import Judge
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
_MOST = 12  # evaluations of the errors and their slopes
_FAR = 1e3  # error, in deviations of an output, of a simulation that runs away
_INSIDE = 1e-9  # share of a range by which a start lies within it


def with_own_values(judge: Judge, wiring: Wiring) -> Judge:
    """Return the judge whose model has the free values, within their ranges, that simulate a wiring best.

    A law with two inputs of like size, whose damping grows with the speed, is told better by the declared values of
    its stiffness and damping exchanged: of a damper the two channels were swapped, 442 nats, and with values fitted to
    either wiring they were not. Linear models have no free values. Cost: some 12 (1 + p) simulations for p values.
    """
    model = judge.model
    if not isinstance(model, Equations):
        return judge
    places = [
        i
        for i, p in enumerate(model.parameters)
        if p.free and np.isfinite([p.minimum, p.maximum]).all() and p.minimum < p.maximum
    ]
    if not places:
        return judge
    low, high = np.array([(model.parameters[i].minimum, model.parameters[i].maximum) for i in places]).T
    width = high - low
    start = np.clip(model.theta[places], low + _INSIDE * width, high - _INSIDE * width)
    spread = np.maximum(np.vstack([wiring.apply(u, y)[1] for u, y in judge.blocks]).std(axis=0), 1e-300)

    def at(values: Array) -> Judge:
        parameters = list(model.parameters)
        for i, value in zip(places, values, strict=True):
            parameters[i] = replace(parameters[i], value=float(value))
        return Judge(replace(model, parameters=tuple(parameters)), judge.blocks, judge.step, reach=judge.reach)

    def errors(values: Array) -> Array:
        left = at(values).residuals(wiring, (0.0,) * len(judge.names[0]))
        if left is None:
            return np.full(judge.rows, _FAR)
        return np.asarray(np.clip(np.vstack(left) / spread, -_FAR, _FAR).ravel())

    found = least_squares(errors, start, bounds=(low, high), x_scale=width, max_nfev=_MOST)
    return at(found.x) if found.cost < 0.5 * float(np.sum(errors(model.theta[places]) ** 2)) else judge


def level_errors(judge: Judge, wiring: Wiring) -> Array:
    """Return the rms errors (l,) of simulations with the values that a wiring asks for, over the outputs' deviations.

    The level counts. Infinite where the model runs away.
    """
    left = with_own_values(judge, wiring).residuals(wiring, (0.0,) * len(judge.names[0]))
    outputs = np.vstack([wiring.apply(u, y)[1] for u, y in judge.blocks])
    if left is None:
        return np.full(outputs.shape[1], np.inf)
    spread = np.maximum(outputs.std(axis=0), 1e-300)
    errors: Array = np.sqrt(np.mean(np.vstack(left) ** 2, axis=0)) / spread
    return np.maximum(errors, 1e-9)
