"""Fit the free values of equations to recordings by prediction errors, and hold them against a part left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.moved import Moved, moved_in
from aeolid.diagnose.candidates.reestimate import fitted_to
from aeolid.diagnose.conclusion.correction import corrected_model
from aeolid.diagnose.data.bridging import bridged_case
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import Finding, examine
from aeolid.diagnose.data.intersample import sampling_findings
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.first_effect import settled_stage
from aeolid.diagnose.stats.numbers import finite
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.diagnose.validation.told_values import free_errors, rms, run_errors, told_values, widened
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.models.equations import Equations
from aeolid.wording import plus_minus

Array = NDArray[np.float64]

Step = Callable[[str], None]


@dataclass(frozen=True)
class Check:
    """Hold how an output of the part left out is met: root mean square errors in its unit, NaN where a run diverges.

    declared and fitted: with which values; one row ahead, and run free.
    """

    output: str
    unit: str
    declared_ahead: float
    fitted_ahead: float
    declared_free: float
    fitted_free: float

    def text(self) -> str:
        """Return it as a clause."""
        ahead = self._pair(self.fitted_ahead, self.declared_ahead)
        free = self._pair(self.fitted_free, self.declared_free)
        return f"{self.output}: error one sample ahead {ahead}, in a free run {free}"

    def _pair(self, fitted: float, declared: float) -> str:
        """Return an error with the fitted values, and with the declared ones in brackets."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        told = [f"{v:.3g}{unit}" if math.isfinite(v) else "no finite number" for v in (fitted, declared)]
        return f"{told[0]} ({told[1]})"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Hold equations with fitted values.

    model: with the values that all data give; values: these with their deviations, in the model's order. by_run: they
    are those of the free run, since those of one-step predictions exclude them and run worse on what was left out;
    others: those of predictions then, else those of the run that are excluded. apart: names of values that differ
    between two parts of the data by more than their deviations say; those are then half of the difference. alike: pairs
    of values that the data hardly tell apart, with the correlation of their estimates.
    held_out: what was left out of the fit that `checks` are of.
    """

    model: Equations
    values: tuple[Moved, ...]
    by_run: bool
    others: tuple[Moved, ...]
    apart: tuple[str, ...]
    alike: tuple[tuple[str, str, float], ...]
    checks: tuple[Check, ...]
    held_out: str
    findings: tuple[Finding, ...]

    def summary(self) -> str:
        """Return values and checks as text."""
        lines = ["fitted values (declared):", *_told(self.values)]
        lines += self._contradiction()
        for name in self.apart:
            lines.append(f"  note: {name} differs between two parts of the data; its deviation is half of that")
        for one, other, correlation in self.alike[:3]:
            lines.append(f"  note: these data hardly tell {one} from {other} (correlation {correlation:.3f})")
        lines.append(f"validation of a first fit on data that it was not fitted to, {self.held_out}:")
        lines += [f"  {c.text()}" for c in self.checks]
        return "\n".join([*lines, *(f"note: {f.channel}: {f.finding}" for f in self.findings)])

    def _contradiction(self) -> list[str]:
        """Return a note where the free run and one-step predictions give values that exclude each other."""
        if not self.others:
            return []
        told = ", ".join(f"{m.parameter.name} {m.value:.5g}" for m in self.others)
        if self.by_run:
            return [
                f"  note: these values are those of the free run; one-step predictions give {told} and run worse on "
                "what was left out, so something fast is missing in the equations (how friction turns over, a lag)"
            ]
        return [
            f"  note: a fit of the free run gives {told}, which these exclude; something is missing in the equations, "
            "and their deviations are half of that"
        ]

    def to_json(self) -> dict[str, Any]:
        """Return all of it but the model, numbers that are not finite as None."""
        return {
            "parameters": [
                {"name": m.parameter.name, "value": m.value, "std": finite(m.std), "unit": m.parameter.unit,
                 "declared": m.parameter.value, "at_end_of_range": m.at_end,
                 "parts_differ": m.parameter.name in self.apart}
                for m in self.values
            ],
            "values_of": "free run" if self.by_run else "predictions",
            "contradicted_by": [
                {"name": m.parameter.name, "value": m.value, "std": finite(m.std)} for m in self.others
            ],
            "alike": [{"parameters": [a, b], "correlation": c} for a, b, c in self.alike],
            "held_out": self.held_out,
            "checks": [
                {"output": c.output, "unit": c.unit}
                | {k: finite(getattr(c, k)) for k in ("declared_ahead", "fitted_ahead", "declared_free", "fitted_free")}
                for c in self.checks
            ],
            "data_notes": [f.to_json() for f in self.findings],
        }  # fmt: skip


def _told(values: Sequence[Moved]) -> list[str]:
    """Return a line for each value: with its deviation, its unit and what was declared."""
    lines, width = [], max(len(m.parameter.name) for m in values)
    for m in values:
        unit = f" {m.parameter.unit}" if m.parameter.unit not in ("", "1") else ""
        open_ = "" if math.isfinite(m.std) else " (these data leave it open)"
        end = ", at the end of its range" if m.at_end else ""
        told = f"{plus_minus(m.value, m.std, 5)}{open_}{unit}"
        lines.append(f"  {m.parameter.name:<{width}}  {told} ({m.parameter.value:.5g}{end})")
    return lines


def estimate(case: Case, step: Step = lambda text: None) -> Estimate:
    """Fit the free values of the equations of a case; `step(text)` is called as each part of the work begins.

    A last part of the recordings, or one of several, is left out of a first fit and says how well its values foretell;
    then all data are fitted. The noise of process and sensors is fitted, too (a Kalman predictor with a VAR noise
    model), so that predictions, not free runs, are as good as can be; maximum likelihood, with what is known of values
    as their prior. Raises UsageError where no value is free, NotIdentifiable where the data cannot carry a fit.
    """
    declared = case.baseline
    if not isinstance(declared, Equations):
        raise UsageError(f"{case.baseline_file}: equations (model.toml) are needed, whose values can be fitted")
    if not any(p.free for p in declared.parameters):
        raise UsageError(f"{case.baseline_file}: no parameter has free = true, so there is nothing to fit")
    findings = examine(case.records, case.baseline)
    case, left = masked_case(case)
    case, over = bridged_case(case)
    step("fitting")
    prepared = settled_stage(case)
    split, predictor = prepared.split, prepared.predictor
    most = _fit(predictor, prepared.fit, (*split.fit, *split.select))
    step("fitting all data")
    whole = _fit(*most, (*split.fit, *split.select, *split.sealed))
    values, apart = _values(prepared, whole, _other_part(prepared, most))
    step("fitting the free run")
    told = told_values(prepared, most, whole, (values, apart))
    checks = _checks(prepared, *most, told.held)
    sampled = sampling_findings(prepared.records, prepared.sampling, case.records[0].sample_time_s)
    notes = (*findings, *left, *over, *sampled)
    model = replace(corrected_model(prepared, told.fit, None), name=f"{declared.name} (fitted)")
    return Estimate(
        model, told.values, told.by_run, told.others, told.apart, _alike(*whole), checks, split.sealed_text, notes
    )  # fmt: skip


def _fit(predictor: Predictor, fit: Fit, segments: tuple[Any, ...]) -> tuple[Predictor, Fit]:
    """Fit to the given stretches, of which those of `fit` come first; the fit must have all of them before."""
    found = fitted_to(predictor, fit, segments)
    if found is None:
        raise NotIdentifiable("the fit to all data diverges; check units, signs and ranges of the free values")
    return found


def _other_part(prepared: Prepared, most: tuple[Predictor, Fit]) -> tuple[Predictor, Fit] | None:
    """Return the fit to what the first fit did not have; None where that diverges."""
    predictor, fit = most
    segments = (*prepared.split.select, *prepared.split.sealed)
    start = predictor.score_elsewhere(fit, segments)[2]
    other = predictor.on(segments)
    found = other.fit(start, fit.free, iterations=40)
    return None if found is None else (other, found)


def _values(
    prepared: Prepared, whole: tuple[Predictor, Fit], other: tuple[Predictor, Fit] | None
) -> tuple[tuple[Moved, ...], tuple[str, ...]]:
    """Return the values of all data, and which of them differ between the first part and the rest."""
    parts = None if other is None else (_moved(prepared, prepared.predictor, prepared.fit), _moved(prepared, *other))
    return widened(prepared.declared, _moved(prepared, *whole), parts)


def _moved(prepared: Prepared, predictor: Predictor, fit: Fit) -> list[Moved]:
    return moved_in(prepared.declared, predictor.compiled.model, fit)


def _alike(predictor: Predictor, fit: Fit) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of physical values whose estimates are correlated by more than 0.99, the most alike first."""
    conclusion = in_force().conclusion
    names = [predictor.compiled.model.parameters[i].name for i in fit.free.theta]
    found = []
    for i, one in enumerate(names):
        for j in range(i):
            correlation = float(fit.correlation[i, j])
            nuisance = any(is_nuisance(n) for n in (one, names[j]))
            if abs(correlation) > conclusion.indistinct_correlation and not nuisance:
                found.append((names[j], one, correlation))
    return tuple(sorted(found, key=lambda pair: -abs(pair[2])))


def _checks(prepared: Prepared, predictor: Predictor, fit: Fit, held: Array) -> tuple[Check, ...]:
    """Return how declared values and those of a first fit, held (np,), meet the part left out, starts fitted to it."""
    model = predictor.compiled.model
    theta = fit.point.theta.copy()
    for p in prepared.declared.parameters:
        if p.free:
            theta[model.index(p.name)] = p.value
    errors = []
    for values in (theta, held):
        errors.append(rms(run_errors(prepared, predictor, fit, replace(fit.point, theta=values))))
        errors.append(rms(free_errors(prepared, predictor, fit, values)))
    return tuple(
        Check(o.name, o.unit, *(float(errors[k][j]) for k in (0, 2, 1, 3))) for j, o in enumerate(model.outputs)
    )
