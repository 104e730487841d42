"""Bring recordings to what the regressions take, and bring a result back to the recordings as they came.

Before: the sample rate is lowered, dead times are taken out. After: dead times become states of the model, modes that
lie beyond the new Nyquist frequency are marked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from aeolid.identify.delay import find_delays
from aeolid.identify.delay_states import with_delays, without_delays
from aeolid.identify.folding import tell_of_folding
from aeolid.identify.result import Identification, Settings
from aeolid.models.rate import decimate_causally
from aeolid.record import Record


@dataclass(frozen=True, eq=False)
class Prepared:
    """Hold recordings on their way: raw as they came, late at the lower rate, records without dead times.

    delays: inputs with the samples by which they act late; estimated: whether the data told them.
    """

    raw: Sequence[Record]
    late: Sequence[Record]
    records: Sequence[Record]
    delays: Mapping[str, int]
    estimated: bool

    def finish(self, result: Identification) -> Identification:
        """Return the result of `records` as one of `raw`."""
        result = with_delays(result, self.late, self.delays, self.estimated)
        modes, told = tell_of_folding(result.modes, result.notes, self.raw, result.settings.decimation)
        return replace(result, modes=modes, notes=told)


def prepare(records: Sequence[Record], settings: Settings, delays: Mapping[str, int] | str | None) -> Prepared:
    """Return the recordings as the settings say; raises as `find_delays` and `decimate_causally`."""
    late = [decimate_causally(r, settings.decimation) for r in records]
    found = find_delays(late, settings.past, settings.feedthrough, delays)
    return Prepared(records, late, without_delays(late, found), found, delays == "auto")
