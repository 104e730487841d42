"""Fit the free values of equations to recordings by prediction errors, and hold them against a part left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import NUISANCE, Prepared
from aeolid.diagnose.candidates.moved import Moved, moved_in
from aeolid.diagnose.candidates.reestimate import fitted_to
from aeolid.diagnose.conclusion.correction import corrected_model
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import Finding, examine
from aeolid.diagnose.data.intersample import sampling_findings
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.selection.first_effect import settled_stage
from aeolid.diagnose.stats.numbers import finite
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
_APART = 3.0  # deviations by which two parts of the data may differ before the bands are said not to hold
_ALIKE = 0.99  # correlation of two estimates from which the data hardly tell them apart

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
        return f"{self.output}: errs by {ahead} one row ahead, by {free} in a free run"

    def _pair(self, fitted: float, declared: float) -> str:
        """Return an error with the fitted values, and with the declared ones in brackets."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        told = [f"{v:.3g}{unit}" if math.isfinite(v) else "no finite number" for v in (fitted, declared)]
        return f"{told[0]} ({told[1]})"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Hold equations with fitted values.

    model: with the values that all data give; values: these with their deviations, in the model's order. apart: names
    of values that differ between two parts of the data by more than their deviations say; those are then half of the
    difference. alike: pairs of values that the data hardly tell apart, with the correlation of their estimates.
    held_out: what was left out of the fit that `checks` are of.
    """

    model: Equations
    values: tuple[Moved, ...]
    apart: tuple[str, ...]
    alike: tuple[tuple[str, str, float], ...]
    checks: tuple[Check, ...]
    held_out: str
    findings: tuple[Finding, ...]

    def summary(self) -> str:
        """Return values and checks as text."""
        lines = ["fitted values (declared):", *_told(self.values)]
        for name in self.apart:
            lines.append(f"  note: {name} differs between two parts of the data; its deviation is half of that")
        for one, other, correlation in self.alike[:3]:
            lines.append(f"  note: these data hardly tell {one} from {other} (correlation {correlation:.3f})")
        lines.append(f"held against what a first fit did not have, {self.held_out}:")
        lines += [f"  {c.text()}" for c in self.checks]
        return "\n".join([*lines, *(f"note: {f.channel}: {f.finding}" for f in self.findings)])

    def to_json(self) -> dict[str, Any]:
        """Return all of it but the model, numbers that are not finite as None."""
        return {
            "parameters": [
                {"name": m.parameter.name, "value": m.value, "std": finite(m.std), "unit": m.parameter.unit,
                 "declared": m.parameter.value, "at_end_of_range": m.at_end,
                 "parts_differ": m.parameter.name in self.apart}
                for m in self.values
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
        band = f" ± {m.std:.2g}" if math.isfinite(m.std) else " (these data leave it open)"
        end = ", at the end of its range" if m.at_end else ""
        lines.append(f"  {m.parameter.name:<{width}}  {m.value:.5g}{band}{unit} ({m.parameter.value:.5g}{end})")
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
    step("fitting")
    prepared = settled_stage(case)
    split, predictor = prepared.split, prepared.predictor
    most = _fit(prepared, predictor, prepared.fit, (*split.fit, *split.select))
    step("holding against the part left out")
    checks = _checks(prepared, *most)
    step("fitting all data")
    whole = _fit(prepared, *most, (*split.fit, *split.select, *split.sealed))
    values, apart = _values(prepared, whole, _other_part(prepared, most))
    notes = (*findings, *left, *sampling_findings(prepared.records, prepared.sampling, case.records[0].sample_time_s))
    model = replace(corrected_model(prepared, whole[1], None), name=f"{declared.name} (fitted)")
    return Estimate(model, values, apart, _alike(*whole), checks, split.sealed_text, notes)


def _fit(prepared: Prepared, predictor: Predictor, fit: Fit, segments: tuple[Any, ...]) -> tuple[Predictor, Fit]:
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
    order = [p.name for p in prepared.declared.parameters]
    known = {m.parameter.name: m for m in _moved(prepared, *whole)}
    first, rest = ({m.parameter.name: m for m in _moved(prepared, *part)} for part in (
        (prepared.predictor, prepared.fit), other or whole))  # fmt: skip
    apart = []
    for name, m in known.items():
        a, b = first[name], rest[name]
        between, spread = abs(a.value - b.value), float(np.hypot(a.std, b.std))
        if other is not None and np.isfinite(spread) and between > _APART * spread:
            apart.append(name)
            known[name] = replace(m, std=max(m.std, 0.5 * between))
    return tuple(known[n] for n in order if n in known), tuple(n for n in order if n in apart)


def _moved(prepared: Prepared, predictor: Predictor, fit: Fit) -> list[Moved]:
    return moved_in(prepared.declared, predictor.compiled.model, fit)


def _alike(predictor: Predictor, fit: Fit) -> tuple[tuple[str, str, float], ...]:
    """Return pairs of physical values whose estimates are correlated by more than 0.99, the most alike first."""
    names = [predictor.compiled.model.parameters[i].name for i in fit.free.theta]
    found = []
    for i, one in enumerate(names):
        for j in range(i):
            correlation = float(fit.correlation[i, j])
            if abs(correlation) > _ALIKE and not any(n.startswith(NUISANCE) for n in (one, names[j])):
                found.append((names[j], one, correlation))
    return tuple(sorted(found, key=lambda pair: -abs(pair[2])))


def _checks(prepared: Prepared, predictor: Predictor, fit: Fit) -> tuple[Check, ...]:
    """Return how declared and fitted values meet the part left out, first states fitted to its first rows."""
    model = predictor.compiled.model
    theta = fit.point.theta.copy()
    for p in prepared.declared.parameters:
        if p.free:
            theta[model.index(p.name)] = p.value
    errors = []
    for point in (replace(fit.point, theta=theta), fit.point):
        still = replace(point, noise=np.zeros_like(point.noise), K=np.zeros_like(predictor.scales.gain))
        errors += [_missed(prepared, predictor, fit, p) for p in (point, still)]
    return tuple(
        Check(o.name, o.unit, *(float(errors[k][j]) for k in (0, 2, 1, 3))) for j, o in enumerate(model.outputs)
    )


def _missed(prepared: Prepared, predictor: Predictor, fit: Fit, point: Any) -> Array:
    """Return the root mean square innovations (l,) of the part left out; NaN where they are not finite."""
    segments, alone = prepared.split.sealed, predictor.with_order(0)
    if alone.noise_of(alone.innovations(point)) is None:
        return np.full(len(predictor.scales.spread), np.nan)
    held = alone.at(point, Free((), (), (), fit.free.x0))
    _, other, settled = alone.score_elsewhere(held, segments)
    parts = [e[s.burn :] for e, s in zip(other.innovations(settled), segments, strict=True)]
    with np.errstate(over="ignore", invalid="ignore"):
        found: Array = np.sqrt(np.nanmean(np.vstack(parts) ** 2, axis=0))
    return np.where(np.isfinite(found), found, np.nan)
