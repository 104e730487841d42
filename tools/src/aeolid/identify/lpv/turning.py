"""Keep of an identification what the analysis of a periodic model needs: the speed of angles, the spread of A."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.rotor import Rotation, rotation_by_parts
from aeolid.models.periodic import angle_of
from aeolid.record import Record

Array = NDArray[np.float64]
MOST_ENTRIES = 200  # of A⁽ⁱ⁾ whose covariance a model file holds: 20,000 numbers, 0.4 MB


@dataclass(frozen=True, eq=False)
class Turning:
    """Hold how each angle of the scheduling turned, and the covariance of the entries of A over μ = (s − offset)/scale.

    speeds: by angle, in Hz, signed as the angle grows; covariance of [A⁽¹⁾ A⁽²⁾ …] row by row, None where it is not
    known, the model is not scheduled by an angle, or it has more than `MOST_ENTRIES` entries.
    """

    speeds: dict[str, Rotation]
    covariance: Array | None
    offset: Array
    scale: Array

    def to_json(self) -> dict[str, Any]:
        """Return the speeds as JSON facts, nothing where no angle schedules."""
        if not self.speeds:
            return {}
        told = {n: {"frequency_hz": r.frequency_hz, "deviation_hz": r.deviation_hz} for n, r in self.speeds.items()}
        return {"rotation": told}

    def covariance_json(self) -> dict[str, Any]:
        """Return the covariance as JSON facts, its lower triangle row by row; nothing where there is none to keep."""
        if self.covariance is None:
            return {}
        lower = self.covariance[np.tril_indices(len(self.covariance))]
        return {"A_covariance": {"lower": lower.tolist(), "offset": self.offset.tolist(), "scale": self.scale.tolist()}}


def turning_of(
    records: Sequence[Record], scheduling: Sequence[str], covariance: Array | None, offset: Array, scale: Array
) -> Turning:
    """Return what to keep; scheduling: names of the channels, of which cosine and sine of an angle tell its speed."""
    speeds = {}
    for angle in dict.fromkeys(filter(None, map(angle_of, scheduling))):
        pair = (f"{angle}_cos", f"{angle}_sin")
        found = None if not set(pair) <= set(scheduling) else _pooled([(r, r.columns(pair)) for r in records])
        if found is not None:
            speeds[angle] = found
    keep = bool(speeds) and covariance is not None and len(covariance) <= MOST_ENTRIES
    return Turning(speeds, covariance if keep else None, offset, scale)


def _pooled(parts: Sequence[tuple[Record, Array]]) -> Rotation | None:
    """Return the mean speed over recordings, weighted by their length, and its deviation within and between them."""
    found = [(len(r), rotation_by_parts(v[:, 0], v[:, 1], r.sample_time_s)) for r, v in parts]
    known = [(n, f) for n, f in found if f is not None]
    if not known:
        return None
    weight = np.array([n for n, _ in known], float)
    speed, spread = (np.array([getattr(f, k) for _, f in known]) for k in ("frequency_hz", "deviation_hz"))
    mean = float(np.average(speed, weights=weight))
    return Rotation(mean, float(np.sqrt(np.average(spread**2 + (speed - mean) ** 2, weights=weight))))
