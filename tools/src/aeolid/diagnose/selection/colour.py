"""Try what an effect still gains beside noise in a band of which the model knows nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.baseline.frame import carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.refit import as_rows, refit
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.rivals import leads


def survives_colour(prepared: Prepared, candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Tell whether an effect still gains beside a mode that no input drives and that explains far more.

    True where no such mode is. Noise in a narrow band makes anything look useful that lets the predictor resonate:
    eddies at 0.6 Hz, worth 440 nats to such a mode, made a sensor look 32 ms late (60 nats, none beside the mode).
    Cost: one fit.
    """
    bands = [c for c in candidates if c.undriven and c.complete and leads(c, candidate)]
    if not bands:
        return True
    band = max(bands, key=lambda c: c.score)
    both = prepared.only((*band.attachments, *candidate.attachments))
    point = carry_point(band.fit.point, band.predictor.compiled.model, both.extended)
    base = replace(band.fit, point=point, free=both.free)
    found = refit(both, base, [*as_rows(band), *as_rows(candidate)], select_density(prepared))
    if found is None:
        return False
    added = found.select_gain - band.select_gain  # the fit gain counts from the band's already
    return added > 0 and found.fit_gain - found.handicap + added > in_force().selection.coloured_noise_nats
