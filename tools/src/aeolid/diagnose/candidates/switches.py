"""Find effects without a size, a reversed sign or swapped channels, by what they do to the model as it stands (S5)."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.starts import starts_of, with_gains_anew
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.predictor.point import shifted
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, Row


def paying(prepared: Prepared, bank: Bank) -> list[Row]:
    """Return the switches that predict better at once, switched on at one of the points where their fit would start.

    They have no small size at which a score could see them, and fitted values bend to them: an accelerometer's sign had
    z 0.8, left three constants at their ends and a bending mode worth 410 nats; itself it is worth 813. At the declared
    values it gains 173 nats, two swapped sensors over 15,000; of 20 switches that were not there every one lost 39 or
    more. Nor has what is late by several rows, of which no score at none is left: two clocks three rows apart had z
    0.5, and nothing else spoke. Costs two predictions a start, a hundredth of a fit.
    """
    asked = (r for r in bank.rows if r.testable and (r.attachment.is_switch or _is_late(r.attachment)))
    return [r for r in asked if _pays(prepared, r)]


def _is_late(attachment: Attachment) -> bool:
    """Tell whether an effect shifts inputs in time and does nothing else."""
    return [s.label for s in attachment.slots] in (["delay_s"], ["offset_s"])


def _pays(prepared: Prepared, row: Row) -> bool:
    """Compare on with off from the same start; where the gain is free, the best of a ladder of gains for each."""
    stage = prepared.only([row.attachment])
    objective, linear = stage.predictor.objective, stage.linear
    off = {s.name: s.null for s in row.attachment.slots}
    if linear is not None and stage.fit.point.K is not None and stage.surrogate is None:
        declared = replace(stage.fit.point, theta=stage.extended.theta)
        ladders = [
            with_gains_anew(stage, linear, shifted(declared, stage.extended, v)) for v in (row.attachment.fixed, off)
        ]
        if all(ladders):
            return min(map(objective, ladders[0])) < min(map(objective, ladders[1]))
    starts = [start for group in starts_of(stage, stage.fit, [row]) for start in group]
    least = 0.0 if row.attachment.is_switch else in_force().evidence.two_deviations_nats
    return any(objective(start) < objective(shifted(start, stage.extended, off)) - least for start in starts)
