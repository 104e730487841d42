"""Say what kind of machine a case is about."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

MOST_BLADES = 9


def blades_of(context: Mapping[str, Any]) -> int:
    """Return the number of blades, 3 where the case does not say."""
    count = context.get("blades", 3)
    return count if isinstance(count, int) and 1 <= count <= MOST_BLADES else 3


def is_turbine(context: Mapping[str, Any]) -> bool:
    """Tell whether the case says that the machine is a wind turbine: by both words, or by `turbine` alone.

    >>> [is_turbine({"machine": m}) for m in ("5 MW wind-turbine", "turbine", "steam turbine", "rig")]
    [True, True, False, False]
    """
    words = re.findall(r"[a-z]+", str(context.get("machine", "")).lower())
    return words == ["turbine"] or "windturbine" in words or {"wind", "turbine"} <= set(words)
