"""Estimate where equations start on a recording: the first states that the model file leaves free."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import Compiled, compile_equations, free_run, free_steps
from aeolid.models.prediction import channel_weights
from aeolid.models.rate import read_as_declared
from aeolid.record import Record

Array = NDArray[np.float64]
_HEAD, _TENTH, _MOST = 500, 10, 20_000  # rows that a start is estimated from: 500, or a tenth, of 20,000 at most
_ITERATIONS, _TRIES = 20, 8  # of Gauss–Newton, and dampings of one step
_SEEN = 1e-3  # deviations of the outputs by which a finite difference of one state moves them
_LEAST = 1e-6  # share of the squares below which a step is the last


def with_estimated_start(model: Equations, record: Record) -> Equations:
    """Return the equations with the first states that are free (`initial = { value, free = true }`) estimated.

    Least squares of the free run over the first tenth of the recording, at least 500 rows, each output by its own
    deviation, by damped Gauss–Newton from the file's values and from what outputs show that are a state themselves. Not
    over all of it: what a model errs later would be made up for by a start that the first samples contradict. The model
    as it is where none is free, where no output is recorded, or where nothing fits the whole recording better. Cost:
    n + 1 runs of that part an iteration, at most 20 of these.
    """
    places = [i for i, s in enumerate(model.states) if s.initial_free]
    recorded = [j for j, o in enumerate(model.outputs) if any(c.name == o.name for c in record.channels)]
    if not places or not recorded:
        return model
    part = record.slice(0, min(len(record), _TENTH * _MOST))
    y, u = part.columns([model.outputs[j].name for j in recorded]), model.inputs_of(part)
    rows = min(len(part), max(_HEAD, len(part) // _TENTH))
    if not np.isfinite(y[:rows]).any() or not np.isfinite(u).all():
        return model
    compiled = compile_equations(read_as_declared(model, part))
    all_of, errors = (_errors_of(compiled, u[:k], y[:k], recorded, part.sample_time_s) for k in (len(part), rows))
    fitted = [_fitted(errors, x0, places) for x0 in (model.x0, _as_recorded(model, recorded, y))]
    x0 = min(fitted, key=lambda pair: pair[0])[1]
    if not _squares(all_of(x0)) < _squares(all_of(model.x0)):
        return model
    states = zip(model.states, x0[: len(model.states)].tolist(), strict=True)  # memories start settled
    return replace(model, states=tuple(replace(s, initial=v) for s, v in states))


def _errors_of(
    compiled: Compiled, u: Array, y: Array, recorded: Sequence[int], step: float
) -> Callable[[Array], Array]:  # fmt: skip
    """Return what gives the free run's errors (M,) from a start, of what was measured, in deviations of each output."""
    known, theta = np.isfinite(y), compiled.model.theta
    count = free_steps(compiled, u, theta, compiled.model.x0, step)  # the same for all starts, whose runs are compared
    level = np.nan_to_num(np.nanmean(np.where(known.any(axis=0), y, 0.0), axis=0))
    weight = channel_weights(np.where(known, y, level))

    def errors(x0: Array) -> Array:
        with np.errstate(all="ignore"):  # what runs away is not finite, and no start to go on from
            left: Array = ((y - free_run(compiled, u, theta, x0, step, count)[:, recorded]) * weight)[known]
        return left

    return errors


def _as_recorded(model: Equations, recorded: Sequence[int], y: Array) -> Array:
    """Return the file's start with what the first sample shows of free states that are outputs themselves."""
    names, x0 = [s.name for s in model.states], model.x0.copy()
    for column, j in enumerate(recorded):
        text = ex.to_text(model.outputs[j].equation)
        if text in names and model.states[names.index(text)].initial_free and np.isfinite(y[0, column]):
            x0[names.index(text)] = y[0, column]
    return x0


def _fitted(errors: Callable[[Array], Array], x0: Array, places: Sequence[int]) -> tuple[float, Array]:
    """Minimise the squares over some states; returns squares and states."""
    left, steps, damping = errors(x0), {i: 1e-6 * max(1.0, abs(float(x0[i]))) for i in places}, 1e-3
    value = _squares(left)
    for _ in range(_ITERATIONS if np.isfinite(value) else 0):
        slopes = np.column_stack([_slope(errors, x0, left, i, steps) for i in places])
        gram, downhill, before = slopes.T @ slopes, slopes.T @ left, value
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        for _ in range(_TRIES):
            step = lstsq(gram / np.outer(size, size) + damping * np.eye(len(size)), downhill / size)
            trial = x0.copy()
            trial[list(places)] -= step / size
            if _squares(moved := errors(trial)) < value:
                x0, left, value, damping = trial, moved, _squares(moved), damping * 0.2
                break
            damping = damping * 10
        if before - value <= _LEAST * before:
            break
    return value, x0


def _slope(errors: Callable[[Array], Array], x0: Array, left: Array, place: int, steps: dict[int, float]) -> Array:
    """Return d(errors)/d(state), its step brought to where it moves the outputs by a thousandth of their deviation."""
    for _ in range(2):
        trial = x0.copy()
        trial[place] += steps[place]
        slope = (errors(trial) - left) / steps[place]
        moved = float(np.sqrt(np.mean(slope**2))) if np.isfinite(slope).all() else 0.0
        if not moved:
            return np.zeros_like(left)
        if 0.1 * _SEEN < moved * steps[place] < 10 * _SEEN:
            break
        steps[place] = _SEEN / moved
    result: Array = slope
    return result


def _squares(left: Array) -> float:
    return float(left @ left) if np.isfinite(left).all() else np.inf
