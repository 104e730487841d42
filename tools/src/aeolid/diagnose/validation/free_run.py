"""Fit the corrected model to what it is run for: free, with no measurement to hold it (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.diagnose.baseline.recorded_wind import PREFIX
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.data.split import Split
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.models.equations import Equations

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FreeRun:
    """Hold a fit of the free run, and the errors (l,) of both fits' free runs on the selection data.

    one_step: the fit that predicts one step ahead, which the values told are of; model: that of both; left: the errors
    (N, l) of the free run on the selection data.
    """

    model: Equations
    fit: Fit
    one_step: Fit
    before: Array
    after: Array
    left: Array

    def to_json(self) -> dict[str, Any]:
        """Return the errors by output, and each value that differs as it was told and as it runs free."""
        outputs = zip(self.model.outputs, self.before.tolist(), self.after.tolist(), strict=True)
        told, free = self.one_step.point.theta, self.fit.point.theta
        return {
            "outputs": [{"name": o.name, "unit": o.unit, "one_step": b, "free_run": a} for o, b, a in outputs],
            "parameters": [
                {"name": p.name, "unit": p.unit, "one_step": float(told[i]), "free_run": float(free[i])}
                for i, p in enumerate(self.model.parameters)
                if i in self.fit.free.theta
            ],
        }

    def astray(self, spreads: Array) -> str:
        """Say which outputs the values told lead further astray, run free, than these move; empty where none.

        spreads: (l,) standard deviations of the outputs. A slow part of the noise takes up, one step ahead, whatever is
        constant or slow: a temperature in degrees Fahrenheit (64 degC off, 2.4 beside a zero of 68 degC) and a furnace
        without its radiation (180 degC off) were "nothing is missing".
        """
        rows = zip(self.model.outputs, self.before.tolist(), spreads.tolist(), strict=True)
        found = [f"{o.name} by {b:.3g} {o.unit}".rstrip() for o, b, spread in rows if b > spread]
        if not found:
            return ""
        return (
            f"No effect was confirmed, and whether something is missing is open: run free, the model errs in"
            f" {' and '.join(found)}, more than this output moves; look at unit, zero and losses there"
        )


def fitted_to_run_free(predictor: Predictor, fit: Fit, split: Split) -> FreeRun | None:
    """Return the values with which a model runs free best, where the selection data bear out that they are better.

    `fit`, to the fit data and most often the selection data, predicts one step ahead: whatever its noise model takes
    for noise does not move its values, and a model that is only nearly right has noise that is not noise. With no gain
    at all the likelihood is that of the output error (Ljung 1999, section 7.4); in open loop its values are consistent
    whatever the noise is. It is maximised on the fit data, held against `fit` on the selection data, then maximised on
    both. None where the model does not forget its start (it cannot run free), where the fit fails or where it is not
    clearly better. Cost: 20 iterations of as many filter passes as there are free values, twice.
    """
    model = predictor.compiled.model
    theta = fit.point.theta.copy()
    theta[[i for i, p in enumerate(model.parameters) if p.name.startswith(PREFIX)]] = 0.0  # no file asks for that wind
    told = replace(fit.point, theta=theta, noise=np.zeros_like(fit.point.noise), K=np.zeros_like(predictor.scales.gain))
    physical = [i for i in fit.free.theta if not is_nuisance(model.parameters[i].name)]
    free, count = Free(tuple(physical), (), (), fit.free.x0), len(split.fit)
    part = predictor.on(split.fit).with_order(0)
    start = replace(told, x0=told.x0[:count])
    tried = fit_quietly(part, start, free)
    if tried is None:
        return None
    one_step = part.at(start, free)
    (before, _), (after, x0) = (_elsewhere(part, f, split.select) for f in (one_step, tried))
    if not _is_better(before, after, part.scales.spread):
        return None
    both = part.on((*split.fit, *split.select))
    final = fit_quietly(both, replace(tried.point, x0=(*tried.point.x0, *x0)), free)
    if final is None:
        return None
    was, now = (np.sqrt(np.nanmean(e**2, axis=0)) for e in (before, after))
    return FreeRun(model, final, fit, was, now, after)


def runs_better(free: FreeRun, than: FreeRun | None, spreads: Array) -> bool:
    """Tell whether the selection data bear one fit of the free run out over another; over none that was asked."""
    return than is None or _is_better(than.left, free.left, spreads)


def shows_zero(predictor: Predictor, fit: Fit, zeros: Sequence[str]) -> list[str]:
    """List the sensors' zeros that the free run tells from all its other free values, start included.

    A spring's rest or a force of the model may be the same constant, and then the sensor has none of its own.
    """
    rules = in_force().validation
    part = predictor.with_order(0)
    places = [predictor.compiled.model.index(z) for z in zeros]
    point = replace(fit.point, noise=np.zeros_like(fit.point.noise), K=np.zeros_like(predictor.scales.gain))
    if part.noise_of(part.innovations(point)) is None:  # it runs away with the values that predict one step ahead
        return []
    own = [i for i in fit.free.theta if i not in places]
    columns = part.at(point, Free((*own, *places), (), (), fit.free.x0)).jacobian
    rest = np.delete(columns, range(len(own), len(own) + len(places)), axis=1)
    told = []
    for k, name in enumerate(zeros):
        column = columns[:, len(own) + k]
        apart = column - rest @ lstsq(rest, column, rcond=1e-10)
        if np.linalg.norm(apart) > rules.zero_apart_share * np.linalg.norm(column) > 0:
            told.append(name)
    return told


def _elsewhere(predictor: Predictor, fit: Fit, segments: Sequence[Segment]) -> tuple[Array, tuple[Array, ...]]:
    """Return the free run's errors (N, l) on other data, and the starts, fitted to the first rows of each stretch."""
    _, other, point = predictor.score_elsewhere(fit, segments)
    errors = zip(other.innovations(point), segments, strict=True)
    return np.vstack([e[s.burn :] for e, s in errors]), point.x0


def _is_better(before: Array, after: Array, spreads: Array) -> bool:
    """Tell whether errors are smaller, one-sided at 5 %: the sum of squares over its deviation, from N^(1/2) blocks."""
    gained = np.nansum((before**2 - after**2) / spreads**2, axis=1)
    blocks = np.add.reduceat(gained, np.arange(0, len(gained), max(1, int(np.sqrt(len(gained))))))
    return bool(blocks.sum() > in_force().evidence.five_percent_z * np.sqrt(len(blocks)) * np.std(blocks) > 0)
