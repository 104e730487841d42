"""Recognise an output that shows only the size of what it measures (S0)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force


def folded_of(v: NDArray[np.float64]) -> str | None:
    """Recognise an absolute value: nothing below zero, yet zero is touched again and again with a sharp turn.

    v (N,): finite samples, codes and strays left out. Noise may take an absolute value a little below zero.
    """
    rules = in_force().data
    low, spread = float(v.min()), float(np.ptp(v))
    if low < -rules.folded_below * spread or low > rules.folded_above * spread:
        return None
    near = v < rules.folded_near * spread
    visits = int(np.sum(np.diff(near.astype(int)) == 1))
    inside = float(np.mean(near))
    if visits < rules.folded_visits or inside >= rules.folded_inside:
        return None
    below = int(np.sum(v < 0))
    sign = f"never below {low:.3g} ({below} of {len(v)} negative)" if below else "never negative"
    return f"{sign}, yet reaches zero {visits} times: an absolute value or one-sided sensor would do that"
