"""Bring what is measured on the blades into the frame that does not turn, and say what rate is worth fitting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from aeolid.models.blade_sets import BladeSet, numbered, replaced
from aeolid.record import Record

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
    return [
        (stem, tuple(names[b] for b in range(1, blades + 1)))
        for stem, names in numbered(record.names("output")).items()
        if sorted(names) == list(range(1, blades + 1))
    ]


def to_fixed_frame(record: Record, sets: Sequence[tuple[str, tuple[str, ...]]]) -> Record:
    """Replace each set of blade outputs by its mean over the blades, `<stem>_collective` (Coleman, Feingold 1958).

    A linear time-invariant model holds for the mean over the rotor, not for a single blade.
    """
    parts = [record.columns(names).mean(axis=1)[:, None] for _, names in sets]
    return replaced(record, [BladeSet(stem, names) for stem, names in sets], parts)


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
