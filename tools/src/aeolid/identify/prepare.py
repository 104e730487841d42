"""Bring recordings to what the regressions take: spikes out, missing cells drawn, slow motion off, rate lowered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.decimate import decimate
from aeolid.identify.detrend import check_detrend, detrend
from aeolid.identify.missing import Completed, complete
from aeolid.identify.result import Settings
from aeolid.identify.spikes import check_robust, remove_spikes
from aeolid.record import Record

MISSING = ("auto", "leave-out")
FEWEST = 10.0  # windows times outputs a parameter of the model that is told


@dataclass(frozen=True, eq=False)
class Prepared:
    """Hold the recordings as the regressions take them; notes: what was done; facts: the same for machines."""

    completed: Completed
    notes: tuple[str, ...]
    facts: dict[str, Any]

    @property
    def records(self) -> Sequence[Record]:
        """Return the recordings, missing cells drawn once."""
        return self.completed.records


def with_preparation(settings: Settings, missing: str, detrending: str, robust: str) -> Settings:
    """Return the settings with what is done to recordings first; raises UsageError on what does not exist."""
    if missing not in MISSING:
        raise UsageError(f"missing {missing!r} is none of {', '.join(MISSING)}")
    check_detrend(detrending)
    check_robust(robust)
    return replace(settings, missing=missing, detrend=detrending, robust=robust)


def prepare(records: Sequence[Record], settings: Settings) -> Prepared:
    """Return the recordings as the settings say.

    With Markov parameters of a stream the recordings stay whole: the filter had its own way with missing samples and
    spikes. Raises as `complete` and `decimate`.
    """
    span = settings.past * settings.decimation
    if settings.markov is not None:
        done, spikes = Completed(records), 0
        notes: list[str] = []
    else:
        cleaned = remove_spikes(records, settings.past, settings.robust)
        keep = settings.missing == "leave-out"
        done = Completed(cleaned.records) if keep else complete(cleaned.records, settings.past)
        spikes, notes = cleaned.cells, [n for n in (cleaned.note, done.note) if n]
    sets = [detrend(s, settings.detrend, span) for s in (done.records, *done.others)]
    first, *others = [[decimate(r, settings.decimation) for r in s] for s in sets]
    done = replace(done, records=first, others=tuple(others))
    if settings.detrend in ("linear", "high-pass"):
        notes.append(f"slow motion was taken off inputs and outputs alike ({settings.detrend})")
    facts = {"spikes": spikes, "cells_drawn": done.cells, "information": done.information}
    return Prepared(done, tuple(notes), {"preparation": facts})


def require_enough(windows: int, order: int, inputs: int, outputs: int, source: str, lost: bool) -> str:
    """Return a warning where fewer than 10 windows stand behind a parameter, empty elsewhere; refuse where data miss.

    A model of n states has n (2 l + r) + l r parameters whatever the basis, a window l equations: below 10 of them a
    parameter the scatter of the answer is no longer small beside it. lost: whether missing samples took windows; a
    complete short recording is answered with a warning. Raises NotIdentifiable.
    """
    parameters = order * (2 * outputs + inputs) + outputs * inputs
    each = windows * outputs / parameters
    if each >= FEWEST:
        return ""
    text = f"{windows} windows of {outputs} outputs are {each:.1f} a parameter of a model of order {order}"
    if lost:
        raise NotIdentifiable(
            f"{source}: {text}, fewer than {FEWEST:.0f}; other windows hold missing samples: record longer, "
            "ask for a lower order or a shorter past window"
        )
    return f"{text}, fewer than {FEWEST:.0f}: the answer may be chance"
