"""Carry what was fitted over to another fit of the baseline, or to another reading of the inputs (S5)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.frame import carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.refit import as_rows, refit
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]


def against(candidate: Candidate, prepared: Prepared, change: Array) -> Candidate:
    """Return a candidate measured against another fit of the baseline; change: old less new density of each sample."""
    difference = candidate.select_difference + change
    gain = candidate.fit.log_posterior - prepared.fit.log_posterior
    return replace(candidate, fit_gain=gain, select_gain=float(difference.sum()), select_difference=difference)


def better_baseline(prepared: Prepared, candidates: list[Candidate]) -> Prepared | None:
    """Return the stage with a better fit of the baseline, found where a candidate ended; None where there is none.

    A fit that stopped short would make a finding of what any further step gains (110 nats on a recording that lacks
    nothing).
    """
    evidence = in_force().evidence
    bare = prepared.only(())
    points = [bare.carried(c.fit.point, c.predictor.compiled.model) for c in candidates]
    starts = sorted(points, key=bare.predictor.objective)[:1]
    if (
        not starts
        or bare.predictor.objective(starts[0]) > bare.predictor.objective(bare.fit.point) - evidence.tied_nats
    ):
        return None
    predictor = bare.predictor.with_order(bare.predictor.choose_var_order(starts[0]))
    fit = fit_quietly(predictor, starts[0], bare.free)
    if fit is None or fit.log_posterior < bare.fit.log_posterior + evidence.tied_nats:
        return None
    return replace(bare, predictor=predictor, fit=fit)


def taken_up(prepared: Prepared, candidate: Candidate) -> Candidate | None:
    """Return a candidate fitted from where it ended with other readings of the inputs; None where that diverges."""
    if prepared.deadline.skips(f"{candidate.key} with the inputs read otherwise"):
        return None
    stage, density = prepared.only(candidate.attachments), select_density(prepared)
    point = carry_point(candidate.fit.point, candidate.predictor.compiled.model, stage.extended)
    start = replace(candidate.fit, point=point, free=stage.free, jumps=())
    found = refit(stage, start, as_rows(candidate), density, ahead=candidate.fit_gain)
    if found is None:
        return None
    return against(replace(found, parameters=candidate.parameters), prepared, np.zeros(len(density)))
