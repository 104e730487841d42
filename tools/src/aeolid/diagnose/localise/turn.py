"""Average over the rotor's angle: what turns with the rotor stays, gusts and waves average out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.rules import in_force
from aeolid.models.angles import radians_a_unit
from aeolid.record import Channel

Array = NDArray[np.float64]
BINS = 36  # of a turn of the rotor


def angles_deg() -> Array:
    """Return the middle of each bin (36,) in degrees."""
    middle: Array = (np.arange(BINS) + 0.5) * 360.0 / BINS
    return middle


def mean_over_turn(angle: Array, y: Array) -> Array | None:
    """Return the mean of each column of y (N, l) in each bin of an angle (N,) in rad, less its mean over the turn.

    Rows with a value that is not finite are left out. The result is (36, l); None where a bin has fewer rows than the
    rule `bin_samples`.
    """
    known = np.isfinite(y).all(axis=1) & np.isfinite(angle)
    place = (np.mod(angle[known], 2 * np.pi) / (2 * np.pi) * BINS).astype(int) % BINS
    count = np.bincount(place, minlength=BINS)
    if count.min() < in_force().localise.bin_samples:
        return None
    means = np.column_stack([np.bincount(place, c, minlength=BINS) / count for c in y[known].T])
    found: Array = means - means.mean(axis=0)
    return found


def turning_errors(
    segments: Sequence[Segment],
    names: Sequence[str],
    channels: Sequence[Channel],
    series: Mapping[str, Mapping[str, Any]],
) -> dict[str, Any]:
    """Return what both models leave over of each output, averaged over the rotor's angle: measured less predicted.

    segments: those of the series, in its order; names: of their inputs, one a column of u. Empty where no angle is
    recorded, or where the rotor does not go round often enough. Keys by output: azimuth_deg, before, after, unit.
    """
    channel = next((c for c in channels if c.role == "azimuth" and c.name in names), None)
    if channel is None or not series:
        return {}
    place = names.index(channel.name)
    values = np.concatenate([s.u[:: s.stride, place][s.burn : len(s.y)] for s in segments])
    time_s = np.concatenate([s.scored_s for s in segments])
    angle = radians_a_unit(channel.unit, values) * values
    found: dict[str, Any] = {}
    for output, facts in series.items():
        measured, *predicted = (np.array(facts[k], dtype=float) for k in ("measured", "before", "after"))
        if len(measured) != len(angle) or np.max(np.abs(time_s - facts["time_s"])) > 0.5 * segments[0].step:
            return {}  # of other stretches
        means = mean_over_turn(angle, np.column_stack([measured - p for p in predicted]))
        if means is not None:
            found[output] = {"azimuth_deg": angles_deg().tolist(), "before": means[:, 0].tolist(),
                             "after": means[:, 1].tolist(), "unit": facts.get("unit") or ""}  # fmt: skip
    return found
