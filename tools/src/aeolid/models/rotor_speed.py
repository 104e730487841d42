"""Read a rotor speed as people write it: 12.1rpm, 0.2Hz, 1.27rad/s, 72.6deg/s."""

from __future__ import annotations

import re

import numpy as np

from aeolid.errors import UsageError

PER_SECOND = {"rpm": 1 / 60, "hz": 1.0, "rad/s": 1 / (2 * np.pi), "deg/s": 1 / 360}  # revolutions
_WRITTEN = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?)\s*([a-z/]*)\s*", re.ASCII)


def read_rotor_speed(given: str | float) -> float:
    """Return a rotor speed in Hz; a number without a unit is in rpm. Raises UsageError on any other text, and on 0.

    >>> read_rotor_speed("12rpm"), read_rotor_speed(12), read_rotor_speed("72deg/s")
    (0.2, 0.2, 0.2)
    """
    text = given if isinstance(given, str) else repr(float(given))
    found = _WRITTEN.fullmatch(text.lower()) if len(text) <= 40 else None
    if found is None or (found[2] or "rpm") not in PER_SECOND:
        raise UsageError(f"rotor speed {text[:40]}: no speed; write 12.1rpm, 0.2Hz, 1.27rad/s or 72.6deg/s")
    speed = float(found[1]) * PER_SECOND[found[2] or "rpm"]
    if not 0 < abs(speed) < 1e6:
        raise UsageError(f"rotor speed {text[:40]}: a rotor that turns is needed; one that stands has modes, at(...)")
    return speed
