"""Read lengths of time as people write them: 600, 600s, 10min, 1h, 1d, 50ms."""

from __future__ import annotations

import re
from typing import Any

from aeolid.errors import UsageError

UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}  # in seconds
_WRITTEN = re.compile(r"\s*(\+?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?)\s*([a-z]*)\s*", re.ASCII)
LONGEST = 1e12  # seconds, 30,000 years: what is longer is no length of time but a slip


def seconds_given(name: str, value: Any) -> Any:
    """Return the seconds of an argument that may be a text such as "10min"; what is no text is returned as it is.

    Raises UsageError, naming the argument, on a text that is no length of time.

    >>> seconds_given("duration", "1min"), seconds_given("duration", 60), seconds_given("duration", None)
    (60.0, 60, None)
    """
    if not isinstance(value, str):
        return value
    seconds = read_duration(value)
    if seconds is None:
        raise UsageError(f"{name} = {value!r} is no length of time; give seconds, or a text with a unit: 600, '10min'")
    return seconds


def read_duration(text: str, *, bare: bool = True) -> float | None:
    """Return the seconds of a length of time, None of any other text; negative ones and those beyond 1e12 s are none.

    bare: whether a number without a unit is one, in seconds.
    """
    found = _WRITTEN.fullmatch(text) if len(text) <= 40 else None
    if found is None or (found[2] not in UNITS and (found[2] or not bare)):
        return None
    seconds = float(found[1]) * UNITS.get(found[2], 1.0)
    return seconds if seconds <= LONGEST else None
