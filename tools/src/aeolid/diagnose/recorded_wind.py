"""Let a baseline know what a recorded wind tells of the wind that the model has to guess (S1)."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.catalogue.wind import winds, with_more_wind
from aeolid.diagnose.exogenous import Exogenous
from aeolid.diagnose.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State

Array = NDArray[np.float64]
GAIN = "recorded_wind_gain"
TYPICAL = 1.0  # 1/s, typical size of the gain
_MOST = 5.0  # of one a sample: beyond that the model's wind is the recorded one, noise and all


def with_recorded_wind(model: Equations, channels: Sequence[Exogenous], samples: Array, step: float) -> Equations:
    """Return the model with its wind w drawn towards a recorded one v, by a free gain kappa >= 0.

        dw/dt = f(w) + kappa*(v - m - w),    felt elsewhere: w* = w + (1 - exp(-kappa*step/2))*(v - m - w)
        w+ = f(w*),    felt elsewhere: w* = w + (1 - exp(-kappa*step))*(v - m - w)    (sample to sample)

    m is the mean of v less the value at which w rests: a model's wind may be the gust or all of it. Where w moves
    during a step half of the way is gone at once, so that what is felt in the mean is what is known then. It is how a
    Kalman filter corrects a wind by an anemometer that errs: kappa grows with the gusts and falls with the anemometer's
    noise; where it tells nothing it is none. The wind of a model is a state that only noise drives; a predictor learns
    of a gust when the rotor answers, the anemometer before. Without this whatever else follows its channel foretells
    gusts: a pitch gain that switches with the recorded wind had a name on recordings that lacked nothing.

    channels, samples (N, k): what the model has no use for; taken is the first of role scheduling in the unit of the
    wind. step: sample time of the inputs in s. A model that has no wind (`catalogue.wind`) or several is returned as
    it is, and so it is where none is recorded.
    """
    found = winds(model)
    told = [i for i, c in enumerate(channels) if c.role == "scheduling" and [c.unit] == [s.unit for s in found]]
    if not told:
        return model
    wind, mean = found[0].name, float(samples[:, told[0]].mean()) - _at_rest(found[0], model)
    ahead = ex.parse(f"{channels[told[0]].symbol} - {mean!r} - {wind}", "recorded wind")
    first = step if model.sample_time_s else 0.5 * step
    at_once = ex.combine("*", ex.parse(f"1 - exp(-{GAIN}*{first!r})", "recorded wind"), ahead)
    states = tuple(_drawn(s, ahead, at_once, model) if s.name == wind else s for s in model.states)
    gain = Parameter(GAIN, 0.0, "1/s", 0.0, _MOST / step, True)
    return with_more_wind(replace(model, parameters=(*model.parameters, gain), states=states), wind, at_once)


def _drawn(wind: State, ahead: ast.expr, at_once: ast.expr, model: Equations) -> State:
    if model.sample_time_s:
        better = ex.combine("+", ast.Name(id=wind.name), at_once)
        return replace(wind, derivative=ex.substitute(written_out(wind.derivative, model), {wind.name: better}))
    return replace(wind, derivative=ex.combine("+", wind.derivative, ex.combine("*", ast.Name(id=GAIN), ahead)))


def _at_rest(wind: State, model: Equations) -> float:
    """Return the value at which the wind of a model stays; its start where it has no such value."""
    known = {p.name: np.asarray(p.value) for p in model.parameters}
    known |= {s.name: np.asarray(0.0) for s in model.states}
    written = written_out(wind.derivative, model)
    still, moved = (float(ex.values_of(written, known | {wind.name: np.asarray(w)})) for w in (0.0, 1.0))
    rate = moved - still - (1.0 if model.sample_time_s else 0.0)
    return -still / rate if rate else wind.initial
