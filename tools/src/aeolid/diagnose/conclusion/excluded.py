"""List what a recording would have shown, had it been large enough (S8)."""

from __future__ import annotations

from typing import Any

from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.scoring.scores import minimum_detectable
from aeolid.diagnose.stats.numbers import finite


def not_excluded(study: Study, named: set[str]) -> list[dict[str, Any]]:
    """List, for each entry that was not named, the smallest effect that this recording would have shown.

    Each once at a place; several sizes there are those of its forms. What no form of it has a size for is listed
    without one.
    """
    result = []
    for row in study.bank.rows:
        if row.attachment.entry in named | {unlisted.ID}:
            continue
        location = row.attachment.location["entry"]
        least = minimum_detectable(row, study.bank.fair) if row.testable else {}
        if not least:
            note = "not testable with these data" if not row.testable else "size depends on where it acts"
            result.append({"id": row.attachment.entry, "entry": location, "minimum_detectable": None, "note": note})
        for label, value in least.items():
            value = {"value": finite(value["value"]), "unit": value["unit"], "parameter": label}
            result.append({"id": row.attachment.entry, "entry": location, "minimum_detectable": value})
    sized = {(r["id"], r["entry"]) for r in result if r["minimum_detectable"]}
    told = [r for r in result if r["minimum_detectable"] or (r["id"], r["entry"]) not in sized]
    return [r for k, r in enumerate(told) if r not in told[:k]]
