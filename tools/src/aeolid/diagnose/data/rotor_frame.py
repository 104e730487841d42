"""Bring what is measured on the blades into the frame that does not turn, and say what rate is worth fitting."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from aeolid.record import Channel, Record

Array = NDArray[np.float64]
_CONTENT = 0.95  # of an output's power lies below the frequency that sets the rate
_PER_PERIOD = 6.0  # samples a period of that frequency
_FEWEST = 1500  # samples that must remain


def blade_sets(record: Record, context: Mapping[str, Any]) -> list[tuple[str, tuple[str, ...]]]:
    """List outputs that stand for one quantity on each blade: (stem, names), where the rotor angle is recorded.

    They are called alike but for a number 1 … blades at the end; `blades` stands in the context.
    """
    blades = context.get("blades")
    if not record.names("azimuth") or not isinstance(blades, int) or not 2 < blades < 10:
        return []
    stems: dict[str, dict[int, str]] = {}
    for channel in record.of("output"):
        match = re.fullmatch(r"(.*?)_?([1-9])", channel.name)
        if match:
            stems.setdefault(match[1], {})[int(match[2])] = channel.name
    return [
        (stem, tuple(names[b] for b in range(1, blades + 1)))
        for stem, names in stems.items()
        if sorted(names) == list(range(1, blades + 1))
    ]


def to_fixed_frame(record: Record, sets: Sequence[tuple[str, tuple[str, ...]]]) -> Record:
    """Replace each set of blade outputs by its mean over the blades, `<stem>_collective` (Coleman, Feingold 1958).

    A linear time-invariant model holds for the mean over the rotor, not for a single blade.
    """
    dropped = {name for _, names in sets for name in names}
    kept = [i for i, c in enumerate(record.channels) if c.name not in dropped]
    values = [record.values[:, kept]] + [record.columns(names).mean(axis=1)[:, None] for _, names in sets]
    added = [Channel(f"{stem}_collective", record.unit(names[0]), "output") for stem, names in sets]
    return replace(record, values=np.hstack(values), channels=(*(record.channels[i] for i in kept), *added))


def worth_rate(record: Record) -> int:
    """Return by how much to decimate so that six samples remain a period of the outputs' fastest content."""
    fastest = 0.0
    for name in record.names("output"):
        y = record.column(name)
        y = y[np.isfinite(y)]
        f, power = welch(y, 1 / record.sample_time_s, nperseg=min(2048, len(y)))
        share = np.cumsum(power[1:])
        if share[-1] > 0:
            fastest = max(fastest, float(f[1:][np.searchsorted(share, _CONTENT * share[-1])]))
    factor = int(1 / (record.sample_time_s * _PER_PERIOD * fastest)) if fastest > 0 else 1
    return max(1, min(factor, len(record) // _FEWEST))
