"""Ask at a finer rate whether rows that lie far apart hide a mode: what swings between them is folded, not absent."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.hypotheses.parts.modes import highest_hz
from aeolid.diagnose.scoring.scores import Row, score_bank
from aeolid.errors import NotIdentifiable


def hides_a_mode(case: Case, coarse: Prepared, spacing: int, seed: int) -> bool:
    """Tell whether a mode beyond what the rows of a look show leads the score bank at a finer spacing.

    Folded into the band of rows 0.3 s apart, the torsion of a drive train at 2.2 Hz had no candidate that ran to the
    end of that band; the clocks seemed 22 ms apart (68 nats, and `immaterial`), where at the recording's own rate the
    mode has 1,099 nats on the fit data and 248 on the selection data. Led by something else, as by the dry friction of
    a stage at 1 kHz, all that is missing looks like a mode as well, and the look would be as dear as the first.
    """
    try:
        fine = prepare(case, spacing, coarse.deadline, replace(coarse.sampling, free=False))
    except NotIdentifiable:
        return False
    bank = score_bank(fine, fine.hypotheses, seed)
    return any(_at(row) > highest_hz(coarse.site) for row in bank.loud[:1])


def is_beyond(candidate: Candidate | None, coarse: Prepared) -> bool:
    """Tell whether what was found is a mode beyond what the rows of a look show."""
    if candidate is None:
        return False
    model, theta = candidate.predictor.compiled.model, candidate.fit.point.theta
    found = [float(theta[model.index(s.name)]) for a in candidate.attachments for s in _frequencies(a)]
    return any(f > highest_hz(coarse.site) for f in found)


def _frequencies(attachment: Attachment) -> list[Slot]:
    return [s for s in attachment.slots if s.label == "frequency_hz"]


def _at(row: Row) -> float:
    """Return the frequency at which a mode scores highest, in Hz."""
    return max((row.grid.get(s.name, 0.0) for s in _frequencies(row.attachment)), default=0.0)
