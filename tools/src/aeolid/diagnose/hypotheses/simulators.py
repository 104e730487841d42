"""Say what to set in a simulator so that it has an effect, with the values that were told."""

from __future__ import annotations

import re
from collections.abc import Mapping

from aeolid.diagnose.hypotheses.catalogue import entry


def settings(effect: str, place: str = "", values: Mapping[str, float] | None = None) -> tuple[tuple[str, str], ...]:
    """Return (simulator, what to set) for an effect at a place with its values; none where no simulator has a switch.

    Where a value that a row names was not told, the general row stands.
    """
    told = dict(values or {})
    if told.get("tau_s"):
        told["inverse_tau"] = 1.0 / told["tau_s"]
    if "density_change" in told:
        told["density_factor"] = 1.0 + told["density_change"]
    found = []
    for row in entry(effect).settings:
        if re.search(row.at, place.lower()) is None:
            continue
        try:
            found.append((row.simulator, row.valued.format(**told)))
        except KeyError:
            found.append((row.simulator, row.general or row.valued))
    return tuple(found)
