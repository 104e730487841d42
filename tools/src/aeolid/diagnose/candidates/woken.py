"""Fit the best candidates on with each noise that is far off brought back, as the baseline was (S5)."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.refit import free_with, judge
from aeolid.diagnose.predictor.awake import awakened
from aeolid.diagnose.rules import in_force

_LEADERS = 4  # best candidates, whatever is said against them


def woken(prepared: Prepared, candidates: Sequence[Candidate], known: Collection[str]) -> list[Candidate]:
    """Return those of the best candidates that a noise brought back leads to a better fit, but for the known ones.

    The noise of a rig has several optima, and an effect starts at the one that stood in for it: process noise on the
    speed of a mass took the place of the force that nobody recorded and of the sensor's levels, which the baseline's
    own noise had been brought back from. Of a drive that rings 108 nats, of a dead time beside it 78. Cost: as
    `awakened`, for each. Nothing where gains are free.
    """
    if prepared.surrogate is not None or not prepared.free.noise:
        return []
    led = sorted((c for c in candidates if c.complete and not c.unlisted), key=lambda c: -c.score)[:_LEADERS]
    found = []
    for c in (c for c in led if c.key not in known):
        if prepared.deadline.skips(f"{c.key} with other noise"):
            break
        stage, predictor = prepared.only(c.attachments), c.predictor
        fit = awakened(predictor, c.fit, free_with(stage.fit.free, c.attachments, stage))
        if fit.log_posterior > c.fit.log_posterior + in_force().evidence.tied_nats:
            found.append(judge(stage, predictor, stage.fit, fit, c.attachments, select_density(prepared)))
    return found
