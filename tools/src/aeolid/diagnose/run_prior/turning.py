"""Recover how far the rotor has turned from its recorded speed, where no angle is recorded.

The angle is known up to where it began; a force that turns with the rotor is a sum of its cosine and sine, so that the
beginning is no matter to it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.models.rotor_angle import integrated
from aeolid.record import Record

Array = NDArray[np.float64]
_SPEED = r"(rot(or)?|gen(erator)?|lss|hss|shaft).{0,6}(speed|spd|rpm|omega|gag?v)|(^|_)omega|(^|_)n_?(gen|rot)|rpm"
_UNITS = {"rpm": np.pi / 30, "1/min": np.pi / 30, "rad/s": 1.0, "deg/s": np.pi / 180, "Hz": 2 * np.pi, "1/s": 2 * np.pi}


def turned(record: Record, context: Mapping[str, Any]) -> Array | None:
    """Return the rotor's angle (N,) in rad from its first sample on, from a speed of the rotor or the generator.

    A generator's is divided by `gearbox_ratio`; without `rated_speed_rad_s`, or where no speed fits it, None.
    """
    rules = in_force().run_prior
    rated = context.get("rated_speed_rad_s")
    if not rated:
        return None
    for channel in record.channels:
        if channel.unit not in _UNITS or not re.search(_SPEED, channel.name.lower()):
            continue
        speed = record.column(channel.name) * _UNITS[channel.unit]
        if not np.isfinite(speed).any():
            continue
        mean = float(np.nanmean(speed))
        for ratio in (1.0, float(context.get("gearbox_ratio") or 1.0)):
            if rules.slowest_turning < mean / (ratio * float(rated)) < rules.fastest_turning:
                return integrated(speed / ratio, record.sample_time_s)
    return None
