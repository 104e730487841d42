"""Hold a declared law without states against the recordings at long horizons: robustly, fold by fold.

A law y = g(u; θ) without memory is a scatter plot. One-step errors cannot judge it where the noise model's slow part
takes an offset or a factor up: a torque constant that was 17 % off moved no prediction. So where nothing else was found
the declared values are fitted to the simulation error itself, by a loss that regions where another law holds cannot
bend (soft L1, scaled by the errors' median), on all folds but one in turn, and judged on the one left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import location
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.errors import DataError
from aeolid.models.equations import Equations, Parameter
from aeolid.models.integrate import compile_equations, simulate

Array = NDArray[np.float64]
_FOLDS = 5  # stretches of a single recording; several recordings are the folds
_PASSES = 3  # fits, each scaled by the errors of the one before
_STEP = 1e-4  # of a value, by which it is moved to see what it does
_OWN = 1e-2  # of what a value does, that others cannot do: with less its deviation is a hundred times as large
_NORMAL = 1.4826  # median of absolute errors to a standard deviation


@dataclass(frozen=True)
class StaticLaw:
    """Hold the values that the law has on the recordings, their spread over folds, and what every fold gains."""

    model: Equations
    moved: tuple[tuple[Parameter, float, float], ...]  # declared value, fitted value, its deviation
    names: tuple[str, ...]  # folds
    gain: float  # nats on folds left out
    interval: tuple[float, float]
    before: dict[str, float]  # mean absolute error over the spread, by output
    after: dict[str, float]


@dataclass(frozen=True)
class _Fold:
    name: str
    u: Array
    y: Array


def static_law(case: Case, seed: int) -> StaticLaw | None:
    """Return the law refitted where every fold left out is predicted better by it; None for any other baseline.

    Cost: some hundred evaluations of the law on all samples.
    """
    model = case.baseline
    if not isinstance(model, Equations) or model.states or model.memories:
        return None
    places = [i for i, p in enumerate(model.parameters) if _is_open(p)]
    folds = _folds(case, model)
    if not places or len(folds) < 2:
        return None
    spread = np.nanstd(np.vstack([f.y for f in folds]), axis=0)
    if not np.all(spread > 0):
        return None
    step = case.records[0].sample_time_s
    try:
        law = _Law(model, places, spread, step)
        return _judged(law.on(law.told_apart(folds)), folds, seed)
    except DataError:
        return None


class _Law:
    """Evaluate the law with some of its values replaced, in spreads of the outputs."""

    def __init__(self, model: Equations, places: Sequence[int], spread: Array, step: float) -> None:
        self.model, self.places, self.spread, self.step = model, list(places), spread, step
        self.compiled = compile_equations(model)
        self.declared = model.theta[self.places]

    def errors(self, factors: Array, folds: Sequence[_Fold]) -> list[Array]:
        """Return y − g(u; θ) of each fold (N, l), missing where y is; θ the declared values times the factors."""
        theta = self.model.theta.copy()
        theta[self.places] = self.declared * factors
        return [(f.y - simulate(self.compiled, f.u, theta, self.model.x0, self.step)) / self.spread for f in folds]

    def on(self, places: Sequence[int]) -> _Law:
        """Return the same law with other values to be replaced."""
        return _Law(self.model, places, self.spread, self.step)

    def told_apart(self, folds: Sequence[_Fold]) -> list[int]:
        """Return the places of values that can be fitted together: none whose effect others make up for.

        Of K g only the product is seen: free values are taken first, then in the order in which they are declared.
        Cost: one evaluation of the law for each value.
        """
        usual = np.concatenate([e.ravel() for e in self.errors(np.ones(len(self.places)), folds)])
        kept: list[int] = []
        basis: list[Array] = []
        for own in sorted(range(len(self.places)), key=lambda k: not self._parameter(self.places[k]).free):
            factors = np.ones(len(self.places))
            factors[own] += _STEP
            moved = np.concatenate([e.ravel() for e in self.errors(factors, folds)]) - usual
            left = size = np.nan_to_num(moved)
            for direction in (*basis, *basis):  # twice: what rounding leaves is taken off as well
                left = left - (direction @ left) * direction
            if float(np.linalg.norm(left)) > _OWN * float(np.linalg.norm(size)) > 0:
                kept.append(self.places[own])
                basis.append(left / np.linalg.norm(left))
        return sorted(kept)

    def fit(self, folds: Sequence[_Fold]) -> Array:
        """Return the factors (k,) of the declared values that fit the folds best, within the declared ranges."""
        bounds = np.array([(p.minimum / p.value, p.maximum / p.value) for p in map(self._parameter, self.places)])
        low, high = bounds.min(axis=1), bounds.max(axis=1)

        def residual(factors: Array) -> Array:
            e = np.concatenate([e.ravel() for e in self.errors(factors, folds)])
            known: Array = e[np.isfinite(e)]
            return known

        factors = np.ones(len(self.places))
        for _ in range(_PASSES):
            scale = max(_NORMAL * float(np.median(np.abs(residual(factors)))), 1e-9)
            factors = np.asarray(least_squares(residual, factors, bounds=(low, high), loss="soft_l1", f_scale=scale).x)
        found: Array = factors
        return found

    def at_an_end(self, factors: Array) -> bool:
        """Tell whether a value was driven to the end of its declared range."""
        near = 1 - in_force().hypotheses.range_end
        values = self.declared * factors
        ends = [(p.minimum, p.maximum) for p in map(self._parameter, self.places)]
        return any(min(abs(v - e) for e in pair) < near * abs(v) for v, pair in zip(values, ends, strict=True))

    def _parameter(self, place: int) -> Parameter:
        return self.model.parameters[place]


def _is_open(parameter: Parameter) -> bool:
    """Tell whether a value may be another: declared free, or within a range. What is held without one is a constant."""
    inside = parameter.minimum < parameter.value < parameter.maximum and parameter.value != 0
    return inside and (parameter.free or math.isfinite(parameter.maximum - parameter.minimum))


def _folds(case: Case, model: Equations) -> list[_Fold]:
    least = in_force().data.compared_rows
    whole = []
    for record in case.records:
        u, y = model.inputs_of(record), record.columns([o.name for o in model.outputs])
        rows = np.all(np.isfinite(u), axis=1)
        whole.append(_Fold(record.source.rsplit("/", 1)[-1], u[rows], y[rows]))
    if len(whole) == 1:
        pairs = zip(np.array_split(whole[0].u, _FOLDS), np.array_split(whole[0].y, _FOLDS), strict=True)
        whole = [_Fold(f"{whole[0].name}, part {k + 1}", u, y) for k, (u, y) in enumerate(pairs)]
    return [f for f in whole if int(np.all(np.isfinite(f.y), axis=1).sum()) >= least]


def _moved(factors: Array, std: Array) -> list[int]:
    """Return the places of values that moved: by more than between folds, and enough to be seen."""
    deviations = in_force().evidence.moved_deviations
    least = 1 - in_force().conclusion.law_better_share
    return [i for i, f in enumerate(factors) if abs(f - 1) > deviations * std[i] and abs(f - 1) > least]


def _judged(law: _Law, folds: Sequence[_Fold], seed: int) -> StaticLaw | None:
    rules = in_force().conclusion
    gains, before, after = [], [], []
    for k, fold in enumerate(folds):
        others = [f for j, f in enumerate(folds) if j != k]
        factors = law.fit(others)
        sizes = [np.nanmean(np.abs(np.vstack(law.errors(x, others))), axis=0) for x in (np.ones(len(factors)), factors)]
        old, new = (np.abs(law.errors(x, [fold])[0]) for x in (np.ones(len(factors)), factors))
        if np.nanmean(new) > rules.law_better_share * np.nanmean(old):
            return None
        each = np.nansum(np.log(sizes[0] / sizes[1]) + old / sizes[0] - new / sizes[1], axis=1)
        gains.append(each / _memory(new))
        before.append(old)
        after.append(new)
    if float(np.nanmean(np.vstack(before))) <= in_force().validation.adequate_spread_share:
        return None  # as good as any need be: values off by as much as usual, and what any sensor adds
    total = np.concatenate(gains)
    interval = block_interval(total, seed)
    own = np.array([law.fit([f]) for f in folds])
    all_of_them, std = law.fit(folds), own.std(axis=0, ddof=1)
    sure, unproven = _moved(all_of_them, std), interval[0] <= in_force().evidence.proven_nats
    if unproven or not sure or law.at_an_end(all_of_them) or np.nanmean(np.vstack(after)) > rules.law_right_share:
        return None
    theta = {law.model.parameters[p].name: float(law.declared[i] * all_of_them[i]) for i, p in enumerate(law.places)}
    parameters = tuple(replace(p, value=theta.get(p.name, p.value)) for p in law.model.parameters)
    moved = tuple(
        (law.model.parameters[law.places[i]], theta[law.model.parameters[law.places[i]].name],
         float(abs(law.declared[i]) * std[i]))
        for i in sure
    )  # fmt: skip
    names = [o.name for o in law.model.outputs]
    shown = [dict(zip(names, np.nanmean(np.vstack(x), axis=0).tolist(), strict=True)) for x in (before, after)]
    return StaticLaw(
        replace(law.model, parameters=parameters), moved, tuple(f.name for f in folds), float(total.sum()), interval,
        shown[0], shown[1],
    )  # fmt: skip


def _memory(errors: Array) -> float:
    """Return the samples over which errors are alike: the first at which their correlation is below 1/e."""
    left = np.nan_to_num(errors.sum(axis=1) - np.nanmean(errors.sum(axis=1)))
    power = float(left @ left)
    for lag in range(1, len(left) // 4):
        if float(left[lag:] @ left[:-lag]) < power / math.e:
            return float(lag)
    return float(max(len(left) // 4, 1))


def with_static_law(diagnosis: dict[str, Any], law: StaticLaw) -> dict[str, Any]:
    """Return a diagnosis that found nothing to name as one that accuses the declared values of the law."""
    words = ", ".join(f"{p.name} {v:.4g} instead of {p.value:.4g} {p.unit}".strip() for p, v, _ in law.moved)
    kind = entry("parameter_error")
    effect = {
        "id": kind.id, "family": kind.family,
        "statement": f"the law is right, declared values are not: {words}",
        "location": location(f"parameter:{law.moved[0][0].name}"), "equation": kind.equation,
        "parameters": {p.name: {"value": v, "std": s, "unit": p.unit} for p, v, s in law.moved},
        "rivals": [], "weight": 1.0,
    }  # fmt: skip
    sealed = {
        "data": f"each in turn, left out of the fit: {', '.join(law.names)}", "log_likelihood_gain": law.gain,
        "interval": list(law.interval), "nrmse_before": law.before, "nrmse_after": law.after, "recovered_fraction": 1.0,
    }  # fmt: skip
    said = f"{effect['statement']}; seen in the simulated outputs, which one-step predictions do not show"
    return diagnosis | {
        "verdict": "parameter", "statement": said, "effects": [effect], "location": effect["location"],
        "sealed": diagnosis["sealed"] | sealed, "next_experiment": None,
    }  # fmt: skip
