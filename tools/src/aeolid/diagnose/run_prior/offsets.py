"""Ask whether blades that stand at another angle than the recorded one explain other levels of wind and thrust.

A constant error of the angle moves the recording along the simulator's own operating curve, so that one number must
bring wind and thrust back together. Thinner air, too, goes with another angle at a given wind, but not on that curve,
and it changes what a degree of pitch does, which an offset leaves as it was.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.laws import Shift, shifts_of
from aeolid.record import Record

ANGLE = r"pitch|blpit|beta"  # names of a collective pitch angle
Array = NDArray[np.float64]
_STEPS = 4  # of Gauss and Newton: the laws are polynomials of second degree
_FIRST = 0.1  # of the angle's deviation: step of the difference quotients
THRUST = ("thrust", "thrust without wind")


@dataclass(frozen=True)
class Offset:
    """Hold by how much the recorded angle of a channel exceeds the one that explains the levels: value, deviation.

    Laws share their means, so the deviation is that of one of them.

    left: deviations by which all laws are missed together when the angle is put right.
    """

    channel: str
    unit: str
    value: float
    deviation: float
    left: float

    @property
    def explains(self) -> bool:
        """Tell whether wind and thrust come back together."""
        return self.left < in_force().run_prior.law_sure_deviations


def offset_of(
    records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any], laws: Mapping[str, Shift]
) -> Offset | None:
    """Return the offset of the pitch angle with which wind and thrust are nearest to the runs' laws (Gauss-Newton).

    None where no pitch angle is recorded or where no law of the thrust could contradict that of the wind. Cost: nine
    times that of the laws.
    """
    channel = next((c for c in records[0].of("input") if re.search(ANGLE, c.name.lower())), None)
    told = [law for law in ("wind", *THRUST) if law in laws]
    if channel is None or "wind" not in laws or len(told) < 2:
        return None

    def at(offset: float) -> Array:
        """Return the deviations by which each law is missed; not a number where too few means are compared."""
        found = shifts_of([_moved(r, channel.name, -offset) for r in records], runs, context)
        return np.array([found[law].z if law in found else np.nan for law in told])

    step = _FIRST * float(np.nanstd(np.concatenate([r.column(channel.name) for r in records])))
    offset, curvature = 0.0, 0.0
    for _ in range(_STEPS):
        z, further = at(offset), at(offset + step)
        slope = (further - z) / step
        curvature = float(slope @ slope)
        if not curvature > 0:  # an angle that no law knows, or too few means so far off
            return None
        offset -= float(slope @ z) / curvature
    left = at(offset)
    if not np.isfinite(left).all():
        return None
    return Offset(
        channel.name, channel.unit, offset, float(np.sqrt(len(told) / curvature)), float(np.linalg.norm(left))
    )


def _moved(record: Record, name: str, by: float) -> Record:
    """Return the recording with a constant added to one channel."""
    values = record.values.copy()
    values[:, [c.name for c in record.channels].index(name)] += by
    return replace(record, values=values)
