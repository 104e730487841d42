"""Say what kind of machine a case is about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def is_turbine(context: Mapping[str, Any]) -> bool:
    """Tell whether the case says that the machine is a wind turbine."""
    return str(context.get("machine", "")).lower().replace("_", " ") in ("wind turbine", "turbine")
