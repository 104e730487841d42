"""Try what an effect still gains beside noise of which the model knows nothing: in a narrow band, or of any colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.diagnose.baseline.frame import carry_point
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.refit import as_rows, refit
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.noise import RICH_ORDERS, preferred_order
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
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
    base = replace(band.fit, point=point, free=both.free, jumps=())
    found = refit(both, base, [*as_rows(band), *as_rows(candidate)], select_density(prepared))
    if found is None:
        return False
    added = found.select_gain - band.select_gain  # the fit gain counts from the band's already
    return added > 0 and found.fit_gain - found.handicap + added > in_force().selection.coloured_noise_nats


def survives_richer_noise(prepared: Prepared, candidate: Candidate) -> bool:
    """Tell whether an effect still gains where the noise may have any colour that the data ask for.

    True where what remains with the effect is as white as the noise model has it. A noise model of order 2 at most
    leaves a force its place (see `noise`), but noise of a higher order then bends the constants, and whatever adds a
    pole to the noise looks useful: a flexible arm's own simulation with noise like its residual made the sensor 16 ms
    late (464 and 117 nats; −13 and −122 with order 12, in which the model is 1,140 nats likelier without it). What is
    missing keeps its gain (the arm's modes: 223 and 19, then 282 and 65). Cost: two or three fits.
    """
    if prepared.surrogate is not None:
        return True
    predictor, fit = candidate.predictor, candidate.fit
    burns = [s.burn for s in predictor.segments]
    order = preferred_order(predictor.innovations(fit.point), burns, orders=RICH_ORDERS)
    if order <= (predictor.var_order or 0):
        return True
    bare = prepared.only(())
    starts = [bare.fit.point, bare.carried(fit.point, predictor.compiled.model)]
    plain, whole = bare.predictor.with_order(order), predictor.with_order(order)
    without, beside = _fitted(plain, starts, bare.free), _fitted(whole, [fit.point], fit.free)
    if without is None or beside is None:
        return True
    select = prepared.split.select
    more = whole.score_elsewhere(beside, select)[0] - plain.score_elsewhere(without, select)[0]
    gained, spread = float(more.sum()), float(np.sqrt(len(more)) * np.std(more))
    total = beside.log_posterior - without.log_posterior - candidate.handicap + gained
    return gained > -spread and total > in_force().selection.coloured_noise_nats


def _fitted(predictor: Predictor, starts: Sequence[Point], free: Free) -> Fit | None:
    """Return the best fit from some starts; None where all diverge."""
    fits = [fit_quietly(predictor, start, free) for start in starts]
    return max((f for f in fits if f is not None), key=lambda f: f.log_posterior, default=None)
