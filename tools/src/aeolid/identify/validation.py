"""Validate a model of any kind on one recording."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.fit import SHORTEST, Fit, Score, measure_fit, score, stretches
from aeolid.identify.free_run import started
from aeolid.identify.lpv.fit import measure_lpv_fit
from aeolid.identify.residuals import ResidualReport, ResidualTest, run_residual_tests
from aeolid.models.divergence import Divergence
from aeolid.models.equations_names import own_names
from aeolid.models.fill_values import told_with, without_fill_values
from aeolid.models.load import LinearModel, Model, discretise, diverged, matched
from aeolid.models.lpv_prediction import LpvModel
from aeolid.models.prediction import complete_stretches
from aeolid.models.rate import at_rate_of, holds_of, rate_of
from aeolid.record import Record

Array = NDArray[np.float64]
TAKEN_AS_EXACT = (
    "  the model is taken as exact: it does not say from how many samples it was estimated, and errors of estimated "
    "parameters show here too"
)
LONGEST_STEP = 100_000  # samples of a k-step prediction


@dataclass(frozen=True, eq=False)
class Validation:
    """Hold the fit of a model on one recording; what needs a noise model is None where there is none.

    notes: what was done to the samples first, plain warnings; exact: whether the innovations were tested as those of a
    model whose parameters have no errors.
    """

    free_run: Score
    fit: Fit | None
    residuals: ResidualReport | None
    divergence: Divergence | None = None
    notes: tuple[str, ...] = ()
    exact: bool = True

    @property
    def driven(self) -> bool:
        """Tell whether the model has an input, without which a free run says nothing of it."""
        return self.fit is None or self.fit.driven

    def worst_nrmse(self, metric: str) -> float:
        """Return the largest NRMSE of the outputs, infinite where it is not a number or not available.

        An output that is constant in the recording has none and is left out, unless all are.
        """
        scores = self.free_run if metric == "free-run" else None if self.fit is None else self.fit.one_step
        values = [] if scores is None else [v for n, v in scores.nrmse.items() if n not in scores.constant]
        return float(np.max([v if np.isfinite(v) else np.inf for v in values] or [np.inf]))

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines."""
        facts: dict[str, Any] = {"free_run": self.free_run.to_json(), "one_step": None, "k_step": {}, "residuals": None}
        if self.fit is not None:
            facts |= self.fit.to_json() | ({"free_run": self.free_run.to_json()} if self.driven else {})
        if self.residuals is not None:
            facts["residuals"] = self.residuals.to_json()
        facts["divergence"] = None if self.divergence is None else self.divergence.to_json()
        return facts | {"advice": list(self.advice), "notes": list(self.notes)}

    def _of_another_plant(self) -> tuple[str, ...]:
        """Return what to check where predictions and free run are both worse than the mean, or predictions diverge."""
        assert self.residuals is not None and self.fit is not None
        if self.residuals.diverging:
            return (
                f"One-step prediction of {', '.join(self.residuals.diverging)} diverges: A - K C has an eigenvalue "
                "outside the unit circle. The free run does not use K; identify again, or remove K from the model.",
            )
        one, free = self.fit.one_step.nrmse, self.free_run.nrmse
        lost = [name for name, error in one.items() if self.driven and error > 1.0 and not free[name] < 1.0]
        if not lost:
            return ()
        return (
            f"The model predicts {', '.join(lost)} worse than the mean does: the plant is not this model. Check units, "
            "signs and the operating point, or let aeolid diagnose say what differs.",
        )

    @property
    def advice(self) -> tuple[str, ...]:
        """Return what failed residual tests mean and what to do, a sentence or two for each kind."""
        if self.residuals is None or self.fit is None:
            return ()
        found = [*self._of_another_plant()]
        failed = [t for t in self.residuals.tests if t.verdict == "fail" and not found]
        noise = _worst([t for t in failed if t.kind == "whiteness"])
        if noise is not None:
            one, free = self.fit.one_step.nrmse[noise.output], self.free_run.nrmse[noise.output]
            found.append(
                f"The gain K does not fit the noise of {noise.output}: {noise.predictable:.1%} of its innovations "
                "follow from past outputs. K affects predictions and their deviations, not poles or free run. "
                "Identify with a longer past window or a higher order; if the noise has changed since, identify from "
                "this recording too."
                + (" A free run predicts better here than K does." if one > free and self.driven else "")
            )
        direct = _worst([t for t in failed if t.kind == "feedthrough"])
        if direct is not None:
            found.append(
                f"{direct.against} explains {direct.predictable:.1%} of the innovations of {direct.output} of the same "
                "sample, and past outputs do not move it: it acts at once. Identify with --feedthrough "
                f"{direct.against}, or auto."
            )
        dynamics = _worst([t for t in failed if t.kind == "input"])
        if dynamics is not None:
            found.append(
                f"Past {dynamics.against} explains {dynamics.predictable:.1%} of the innovations of {dynamics.output}: "
                "dynamics are missing or have changed. Raise the order, lengthen the past window or allow feedthrough; "
                "aeolid diagnose looks for the physics."
                + (" Under feedback a wrong K shows here too: mend that first." if noise is not None else "")
            )
        return tuple(found)

    def summary(self) -> str:
        """Return a few lines of text."""
        lines = [*self.notes, *([] if self.divergence is None else [f"WARNING: {self.divergence.text()}"])]
        for name in self.free_run.vaf:
            lines.append(f"{name}\n    free run  {self.free_run.text(name)}" if self.driven else name)
            if self.fit is not None:
                lines.append(f"    one step  {self.fit.one_step.text(name)}")
                lines += [f"  {k:4d} steps  {s.text(name)}" for k, s in self.fit.steps.items()]
        if self.residuals is None:
            return "\n".join([*lines, "no noise model: one-step prediction and residual tests are not available"])
        lines.append(self.residuals.text())
        for test in self.residuals.tests:
            if test.verdict in ("fail", "immaterial"):
                past = "its own past" if test.against == test.output else f"{test.against}'s past"
                if test.kind == "feedthrough":
                    past = f"{test.against} of the same sample"
                lines.append(f"  {test.output}: {test.predictable:.1%} predictable from {past} ({test.verdict})")
        if self.residuals.verdict == "immaterial":
            lines.append(
                "  immaterial: there beyond chance, but below 1 % of the variance or in rounding; one-step predictions "
                "lose nothing by it"
            )
        if self.exact and self.residuals.verdict == "fail":
            lines.append(TAKEN_AS_EXACT)
        return "\n".join([*lines, *self.advice])


def _worst(tests: list[ResidualTest]) -> ResidualTest | None:
    return max(tests, key=lambda t: t.predictable, default=None)


def horizons(steps: Iterable[int]) -> tuple[int, ...]:
    """Return the horizons k > 1 of a k-step prediction in order; raises UsageError outside 1 … 100000 samples."""
    values = sorted(set(steps))
    if any(not 1 <= v <= LONGEST_STEP for v in values):
        told = ",".join(map(str, values))
        raise UsageError(f"--steps {told}: every horizon must be within 1 … {LONGEST_STEP} samples")
    return tuple(v for v in values if v > 1)


def validate_recording(
    model: Model, record: Record, steps: Iterable[int] = (), windows: float | None = None
) -> tuple[Validation, Record]:
    """Validate a model on a recording as it was read; returns the recording as it was used, too.

    Samples that read a fill value count as missing, and a note says so (`fill_values`); a recording of a shorter sample
    time is brought to the model's; horizons that it is too short for are left out. windows: as there. Raises as
    `validate_model`.
    """
    (known,), notes = without_fill_values([record])
    with told_with(notes):
        used = at_rate_of(rate_of(model), known)
        found = validate_model(model, used, tuple(k for k in steps if k < len(used)), windows)
    return replace(found, notes=notes), used


def validate_model(
    model: Model, record: Record, steps: tuple[int, ...] = (), windows: float | None = None
) -> Validation:
    """Measure free run, one-step and k-step fit of a model, test its innovations, and say whether its run diverges.

    steps: horizons k > 1. windows: that the model was identified from, None where that is not known: its innovations
    are then tested as those of an exact model. Equations and models without a Kalman gain are scored by their free run
    alone, from first states that are estimated, of equations those that the file leaves free.
    """
    found, part = _measured(model, record, steps, windows), free_stretch(model, record)
    if not found.driven:
        return found
    model = started(model, part)
    return replace(found, divergence=diverged(model, part, model.simulate(part)))


def free_stretch(model: Model, record: Record) -> Record:
    """Return the longest stretch of a recording in which nothing that drives the model is missing."""
    driven = (*model.inputs, *(model.state_space.scheduling if isinstance(model, LpvModel) else ()))
    runs = complete_stretches(np.column_stack([matched(record, driven, own_names(model)), record.time_s]), SHORTEST)
    start, stop = max(runs, key=lambda r: r[1] - r[0], default=(0, len(record)))
    return record.slice(start, stop)


def _measured(model: Model, record: Record, steps: tuple[int, ...], windows: float | None) -> Validation:
    if isinstance(model, LpvModel) and model.state_space.K is not None:
        fit, u = measure_lpv_fit(model.state_space, [record], steps)
        return _tested(model, fit, u, model.state_space.order)
    linear = None
    if isinstance(model, LinearModel):  # of continuous time the gain is dropped
        holds = holds_of(record, [s.name for s in model.inputs])
        linear = discretise(model.state_space, record.sample_time_s, holds)
    if linear is None or linear.K is None:
        matched(record, model.inputs, own_names(model))
        y, model = matched(record, model.outputs), started(model, record)
        return Validation(score([s.name for s in model.outputs], y, model.simulate(record)), None, None)
    fit = measure_fit(linear, [record], steps)
    return _tested(model, fit, np.concatenate([u for _, u, _ in stretches(linear, record)]), linear.order, windows)


def _tested(model: Model, fit: Fit, u: Array, order: int, windows: float | None = None) -> Validation:
    """Return the fit with the tests of its innovations; u (N, r): of the same samples.

    A model of n states has n (2 l + r) parameters whatever the basis. Estimated from so many windows, each adds 1/(l N)
    of an innovation's variance to its errors on samples that it has not seen, mean over the outputs.
    """
    outputs, inputs = len(model.outputs), len(model.inputs)
    estimated = order * (2 * outputs + inputs) / (outputs * windows) if windows else 0.0
    names = (tuple(s.name for s in model.outputs), tuple(s.name for s in model.inputs))
    report = run_residual_tests(
        fit.innovations, u, *names, nrmse=fit.one_step.nrmse, lengths=fit.lengths, order=order, estimated=estimated
    )  # fmt: skip
    return Validation(fit.free_run, fit, report, exact=not windows)
