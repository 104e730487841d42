"""Write numbers as files can hold them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def json_text(facts: Any) -> str:
    """Return facts as a line of JSON: arrays as lists, null for numbers that are not finite, which JSON does not have.

    >>> json_text({"z": np.array([1.5, np.inf])})
    '{"z": [1.5, null]}\\n'
    """
    return json.dumps(_held(facts), allow_nan=False) + "\n"


def _held(value: Any) -> Any:
    """Return a value with all numbers in it as JSON can hold them."""
    if isinstance(value, dict):
        return {k: _held(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_held(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _held(value.tolist())
    return finite(value) if isinstance(value, float) else value
