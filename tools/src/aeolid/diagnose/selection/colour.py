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


def rings_undriven(candidate: Candidate) -> bool:
    """Tell whether a candidate is noise in a narrow band: one mode that no input drives, of little damping."""
    if len(candidate.attachments) > 1 or not (candidate.undriven and candidate.complete):
        return False
    values = candidate.values[candidate.attachments[0].key]
    return "frequency_hz" in values and values.get("damping", (1.0, 0.0))[0] < in_force().hypotheses.narrow_damping


def survives_colour(prepared: Prepared, candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Tell whether an effect still gains beside a mode that no input drives and that explains far more.

    True where no such mode is. Noise in a narrow band makes anything look useful that lets the predictor resonate:
    eddies at 0.6 Hz, worth 440 nats to such a mode, made a sensor look 32 ms late (60 nats, none beside the mode). A
    broad one is the colour of a sensor's noise, and whatever is constant drowns in it (a loss of 0.25 % of the power,
    176 nats alone, 1 beside a mode of 0.079 Hz with a damping of 0.3). Cost: one fit.
    """
    bands = [c for c in candidates if rings_undriven(c) and leads(c, candidate)]
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
