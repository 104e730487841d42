"""Say what to set in a simulator so that it has an effect, with the values that were told."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.settings import DERIVED


def settings(effect: str, place: str = "", values: Mapping[str, float] | None = None) -> tuple[tuple[str, str], ...]:
    """Return (simulator, what to set) for an effect at a place with its values; none where no simulator has a switch.

    values: by symbol of the entry's quantities. Where a value that a row names was not told, or is not finite, the
    general row stands.
    """
    told = {n: v for n, v in (values or {}).items() if math.isfinite(v)}
    for name, (source, of) in DERIVED.items():
        if source in told and (source != "tau_s" or told[source] > 0):
            told[name] = of(told[source])
    found = []
    for row in entry(effect).settings:
        if re.search(row.at, place.lower()) is None:
            continue
        try:
            found.append((row.simulator, row.valued.format(**told)))
        except KeyError:
            found.append((row.simulator, row.general or row.valued))
    return tuple(found)
