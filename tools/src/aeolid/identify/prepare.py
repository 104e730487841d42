"""Bring recordings to what the regressions take, and bring a result back to the recordings as they came.

Before: spikes out, missing cells drawn, slow motion off, rate lowered, dead times out. After: dead times become states
of the model, modes that lie beyond the new Nyquist frequency are marked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from aeolid.errors import UsageError
from aeolid.identify.delay import find_delays
from aeolid.identify.delay_states import with_delays, without_delays
from aeolid.identify.detrend import check_detrend, detrend
from aeolid.identify.folding import tell_of_folding
from aeolid.identify.missing import Completed, complete
from aeolid.identify.result import Identification, Settings
from aeolid.identify.spikes import check_robust, remove_spikes
from aeolid.models.rate import decimate_causally
from aeolid.record import Record

MISSING = ("auto", "leave-out")
GLANCE = 20  # samples of the window in which spikes and missing cells are looked for before a window is chosen


@dataclass(frozen=True, eq=False)
class Prepared:
    """Hold recordings on their way: raw as they came, late at the lower rate, completed without dead times.

    delays: inputs with the samples by which they act late; estimated: whether the data told them; notes: what was done;
    facts: the same for machines.
    """

    raw: Sequence[Record]
    late: Sequence[Record]
    completed: Completed
    delays: Mapping[str, int]
    estimated: bool
    notes: tuple[str, ...]
    facts: dict[str, Any]

    @property
    def records(self) -> Sequence[Record]:
        """Return the recordings as the regressions take them, missing cells drawn once."""
        return self.completed.records

    def finish(self, result: Identification) -> Identification:
        """Return the result of `records` as one of `raw`."""
        result = with_delays(result, self.late, self.delays, self.estimated)
        modes, told = tell_of_folding(result.modes, result.notes, self.raw, result.settings.decimation)
        return replace(result, modes=modes, notes=told)


def with_preparation(settings: Settings, missing: str, detrending: str, robust: str) -> Settings:
    """Return the settings with what is done to recordings first; raises UsageError on what does not exist."""
    if missing not in MISSING:
        raise UsageError(f"missing {missing!r} is none of {', '.join(MISSING)}")
    check_detrend(detrending)
    check_robust(robust)
    return replace(settings, missing=missing, detrend=detrending, robust=robust)


def prepare(records: Sequence[Record], settings: Settings, delays: Mapping[str, int] | str | None) -> Prepared:
    """Return the recordings as the settings say; delays as in `find_delays`.

    With Markov parameters of a stream the recordings stay whole: the filter had its own way with missing samples and
    spikes. Raises as `complete`, `find_delays` and `decimate_causally`.
    """
    span, factor = settings.past * settings.decimation, settings.decimation
    keep = settings.missing == "leave-out"
    done, spikes, notes = Completed(records), 0, []
    if settings.markov is None:
        cleaned = remove_spikes(records, settings.past, settings.robust)
        done = Completed(cleaned.records) if keep else complete(cleaned.records, settings.past)
        spikes, notes = cleaned.cells, [n for n in (cleaned.note, done.note) if n]
    done = done.each(partial(detrend, kind=settings.detrend, past_samples=span))
    if settings.detrend in ("linear", "high-pass"):
        notes.append(f"slow motion was taken off inputs and outputs alike ({settings.detrend})")
    slow = done.each(partial(slower, factor=factor))
    found = find_delays(slow.records, settings.past, settings.feedthrough, delays)
    facts = {"spikes": spikes, "cells_drawn": done.cells, "information": done.information}
    done = slow.each(partial(without_delays, delays=found))
    return Prepared(records, slow.records, done, found, delays == "auto", tuple(notes), {"preparation": facts})


def slower(records: Sequence[Record], factor: int) -> list[Record]:
    """Return the recordings at a rate lowered by a whole factor; see `decimate_causally`."""
    return [decimate_causally(r, factor) for r in records]


def at_a_glance(records: Sequence[Record], missing: str, detrending: str, robust: str) -> Completed:
    """Return the recordings as they will be, for what is chosen before a window is known.

    Raises as `complete`.
    """
    records = remove_spikes(records, GLANCE, robust).records
    done = Completed(records) if missing == "leave-out" else complete(records, GLANCE)
    return done if detrending == "high-pass" else done.each(partial(detrend, kind=detrending, past_samples=GLANCE))
