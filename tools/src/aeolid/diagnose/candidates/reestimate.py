"""Estimate what was chosen once more, on all data but the sealed ones (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.moved import moved_in
from aeolid.diagnose.candidates.plausible import objection, values_of, without_the_mute
from aeolid.diagnose.candidates.refit import without_slopes
from aeolid.diagnose.candidates.seen_values import (
    at_round_values,
    between_jumps,
    with_jump_deviations,
    with_limits_at_rest,
)
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.predictor import Predictor

_ITERATIONS = 10  # Gauss–Newton iterations: the start is the best of half the data
_TO_THE_END, _TOLERANCE = 40, 1e-3  # and nats: a fit that stops this short is within 0.05 deviations of its optimum


def baseline_of_all(prepared: Prepared) -> Prepared:
    """Return the bare stage with the fit and the selection data as its data, the baseline fitted to both.

    What selection data choose among is chosen by then; held back any longer they only blur the values (a swing gained
    25 nats on the sealed part, −2.5 at the worst, for its frequency alone; with them 26 at the worst). The stage as it
    was where the fit fails.
    """
    bare = prepared.only(())
    found = _fitted_to_all(prepared, bare.predictor, bare.fit)
    if found is None:
        return bare
    predictor, fit = found
    split = replace(bare.split, fit=predictor.segments, select=())
    return replace(bare, predictor=predictor, fit=fit, split=split)


def estimated_on_all(prepared: Prepared, candidate: Candidate) -> Candidate:
    """Return a candidate with the values that fit and selection data give together; its part in the race stays.

    Itself where these cannot be its values, or where the fit fails.
    """
    found = _fitted_to_all(prepared, candidate.predictor, candidate.fit)
    if found is None:
        return candidate
    predictor, fit = found
    model = predictor.compiled.model
    fit = between_jumps(predictor, fit, fit.free, candidate.attachments)
    fit = at_round_values(predictor, fit, fit.free, candidate.attachments)
    fit = with_limits_at_rest(predictor, fit, fit.free, candidate.attachments)
    fit = without_the_mute(candidate.attachments, fit, model)
    fit = with_jump_deviations(predictor, fit, candidate.attachments)
    if objection(candidate.attachments, fit, model, candidate.fit_gain, candidate.parameters):
        return candidate
    own = {s.name for a in candidate.attachments for s in a.slots}
    moved = tuple(m for m in moved_in(prepared.declared, model, fit) if m.parameter.name not in own)
    values = {a.key: values_of(a, fit, model) for a in candidate.attachments}
    return replace(candidate, fit=without_slopes(fit), predictor=predictor, values=values, moved=moved)


def _fitted_to_all(prepared: Prepared, predictor: Predictor, fit: Fit) -> tuple[Predictor, Fit] | None:
    """Fit from where a fit stands to fit and selection data; each stretch has a start of its own.

    Equations to the end, since these are the values that are told: with 0.02 nats to go they lie within 0.2 deviations
    of the optimum, and where, rounding chose (0.4 deviations apart on two processors, 0.004 since). Not free gains: a
    baseline of 27 went on to a predictor that ran 120 s well and diverged on the sealed data.
    """
    return fitted_to(predictor, fit, (*prepared.split.fit, *prepared.split.select))


def fitted_to(predictor: Predictor, fit: Fit, segments: Sequence[Segment]) -> tuple[Predictor, Fit] | None:
    """Fit to these stretches, those of `predictor` first, from where a fit to those stands; None where it fails."""
    elsewhere = predictor.score_elsewhere(fit, segments[len(predictor.segments) :])[2]
    both = predictor.on(segments)
    start = replace(fit.point, x0=(*fit.point.x0, *elsewhere.x0))
    how = (_TO_THE_END, _TOLERANCE) if fit.point.K is None else (_ITERATIONS,)
    again = fit_quietly(both, start, fit.free, *how)
    return None if again is None else (both, again)
