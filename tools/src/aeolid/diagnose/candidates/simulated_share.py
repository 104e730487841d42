"""Ask what of a static law's simulation error each hypothesis takes, whatever the noise model makes of it (S4).

What a law without states lacks is often as smooth as its inputs: two rows back tell the next one, and one-step errors
hold little of a missing damping that is all of the simulation error. So the bank is asked once more with noise that has
no memory, whose likelihood is the squared simulation error.
"""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.scoring.scores import Row, score_bank

_MOST = 6  # families, the best of each


def is_static(prepared: Prepared) -> bool:
    """Tell whether the declared model follows its inputs at once."""
    return prepared.linear is None and not prepared.declared.states and not prepared.declared.memories


def by_simulation(prepared: Prepared, seed: int) -> list[Row]:
    """Return the best hypothesis of each family that takes some of the simulation error; none with states."""
    if not is_static(prepared) or not prepared.predictor.var_order:
        return []
    predictor = prepared.predictor.with_order(0)
    fit = fit_quietly(predictor, prepared.fit.point, prepared.free)
    if fit is None or prepared.deadline.skips("what each effect takes of the simulation error"):
        return []
    asked = [a for a in prepared.hypotheses if not a.always_fit and a.entry != unlisted.ID]
    bank = score_bank(replace(prepared, predictor=predictor, fit=fit), asked, seed)
    found: dict[str, Row] = {}
    for row in bank.rows:
        if row.testable and row.z > 0:
            found.setdefault(entry(row.attachment.entry).family, row)
    return list(found.values())[:_MOST]
