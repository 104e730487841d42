"""Leave out of a case what its channels did not measure, and say so; what cannot be left out stays a fault (S0)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.data.standing import Stretch, stretches_of
from aeolid.diagnose.data.strays import dropouts_of, strays_of, without_codes
from aeolid.diagnose.rules import in_force
from aeolid.record import Record

Array = NDArray[np.float64]
_ARRIVAL, _LEAVING = 2, 1  # samples of a rest that stay: that the machine came to rest there, and from where it left


def masked_case(case: Case) -> tuple[Case, tuple[Finding, ...]]:
    """Return the case with stuck, resting, coded and stray samples missing, and what follows from leaving them out.

    A missing output updates no state and no likelihood; a missing input cuts a recording there. A recording of several
    in which no output is left is not used. A fault is what leaves less than half of an output's samples.
    """
    rules = in_force().data
    stretches = stretches_of(case.records, case.baseline)
    stuck, resting = ([s for s in stretches if s.kind == kind] for kind in ("stuck", "rest"))
    known = [_without_codes(r) for r in case.records]
    known = [_without(r, [s for s in stuck if s.record == k]) for k, r in enumerate(known)]
    findings = tuple(f for c in case.records[0].of("output") for f in _what_is_left(c.name, case.records, known))
    records = [_without(r, [s for s in resting if s.record == k]) for k, r in enumerate(known)]
    used = [r for r in records if _rows(r) >= rules.fewest_samples] or records
    if len(used) < len(records):
        names = ", ".join(r.source.rsplit("/", 1)[-1] for r in records if _rows(r) < rules.fewest_samples)
        text = "too few samples are left of the outputs; not used"
        findings = (*findings, Finding("unused", names, text, "warning"))
    return replace(case, records=tuple(used)), findings


def _without_codes(record: Record) -> Record:
    """Return the recording with codes for "no value" missing in every channel that takes part.

    Of the outputs dropouts and strays are missing, too.
    """
    values = record.values.copy()
    for column, channel in enumerate(record.channels):
        if channel.role != "ignore":
            values[:, column] = without_codes(values[:, column])
        if channel.role == "output":
            values[dropouts_of(values[:, column]), column] = np.nan
            values[strays_of(values[:, column]), column] = np.nan
    return record if np.array_equal(values, record.values, equal_nan=True) else replace(record, values=values)


def _without(record: Record, stretches: Sequence[Stretch]) -> Record:
    """Return the recording with these stretches missing but for their ends; a stuck sensor's first was real."""
    if not stretches:
        return record
    values = record.values.copy()
    names = [c.name for c in record.channels]
    for s in stretches:
        first, last = (_ARRIVAL, _LEAVING) if s.kind == "rest" else (1, 0)
        values[s.start + first : max(s.stop - last, s.start + first), names.index(s.channel)] = np.nan
    return replace(record, values=values)


def _what_is_left(name: str, before: Sequence[Record], after: Sequence[Record]) -> list[Finding]:
    """Return a fault where too much of what an output measured had to be left out, by the rule `missing_share`."""
    had, has = (sum(int(np.isfinite(r.column(name)).sum()) for r in records) for records in (before, after))
    if had - has <= in_force().data.missing_share * had:
        return []
    text = f"{had - has} of {had} samples are stuck, codes or strays: too little is left"
    return [Finding("left out", name, text, "fault")]


def _rows(record: Record) -> int:
    return int(np.any(np.isfinite(record.matrix("output")), axis=1).sum())
