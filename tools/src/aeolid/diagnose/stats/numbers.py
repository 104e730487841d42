"""Write numbers as files can hold them."""

from __future__ import annotations

import numpy as np


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None where it is not finite."""
    return float(value) if np.isfinite(value) else None
