"""Look once more at a static law where coloured noise took all, with noise that has less of a memory (S5).

A noise model of order 8 rings like two modes: of a flexible arm whose motor sweeps through its modes it left nothing to
explain, and the arm's free run erred by all of its motion. So what takes half of the squared simulation error and is
borne out with noise of the usual orders is found all the same; no colour of noise can be simulated from the inputs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.refit import finalists
from aeolid.diagnose.candidates.simulated_share import by_simulation, is_static
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.noise import preferred_order
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.diagnose.selection.first_effect import First, first_effect, kin


def looked_at_plainly(first: First, seed: int) -> First:
    """Return what is found with noise of order 2 at most; the first look where that has a winner or this has none."""
    rules = in_force().selection
    prepared = first.prepared
    if first.winner is not None or not is_static(prepared) or prepared.deadline.skips("a look with plainer noise"):
        return first
    burns = [s.burn for s in prepared.predictor.segments]
    order = preferred_order(prepared.predictor.innovations(prepared.fit.point), burns)
    if order >= (prepared.predictor.var_order or 0):
        return first
    predictor = prepared.only(()).predictor.with_order(order)
    fit = fit_quietly(predictor, prepared.fit.point, prepared.free)
    if fit is None:
        return first
    plain = replace(prepared.only(()), predictor=predictor, fit=fit)
    bank = score_bank(plain, plain.hypotheses, seed)
    rows = {r.attachment.key: r for r in [*finalists(bank), *by_simulation(plain, seed)]} if bank.loud else {}
    fitted = fit_rows(plain, list(rows.values()))
    fitted += fit_rows(plain, kin(bank, fitted)) if fitted else []
    allowed = [c for c in fitted if _share(plain, c) > rules.plain_noise_share]
    winner, found = first_effect(plain, sorted(allowed, key=lambda c: -c.score))
    return first if winner is None else First(plain, bank, found, winner)


def _share(plain: Prepared, candidate: Candidate) -> float:
    """Return what share of the squared simulation error an effect takes; none where noise may drive it."""
    if any(a.gain_states for a in candidate.attachments):
        return 0.0
    squares = []
    for predictor, fit in ((plain.predictor, plain.fit), (candidate.predictor, candidate.fit)):
        _, other, point = predictor.score_elsewhere(fit, plain.split.select)
        errors = zip(other.innovations(point), other.segments, strict=True)
        squares.append(np.nansum([np.nansum(e[s.burn :] ** 2, axis=0) for e, s in errors], axis=0))
    return float(np.min(1 - squares[1] / np.maximum(squares[0], 1e-300)))
