"""Say how large an effect would have had to be for a pair to show it.

The evidence of a recording that lacks an effect falls by as many nats when the effect is put into it as that of one
that has it would gain: the size at which it falls by the nats of a detection is the least that would have been found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.explain import Explanation
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values

_FACTORS = ("factor",)  # names of values whose null is 1


def not_excluded(x: Explanation, named: set[str]) -> list[dict[str, Any]]:
    """Return, for each effect that was not named and has one value, the least size that would have been found.

    Where something was found, its place is left out: what else acts there was judged without it.
    """
    found: list[dict[str, Any]] = []
    taken = {f.scored.hypothesis.place for f in x.found if f.scored is not None}
    for hypothesis, grid in x.tried.values():
        if hypothesis.entry in named or len(hypothesis.names) != 1 or hypothesis.place in taken:
            continue
        if hypothesis.entry == "rate_limit":
            continue
        size = least_size(hypothesis, grid)
        if size is not None:
            value = {"value": size, "unit": hypothesis.units[0], "parameter": hypothesis.names[0]}
            found.append({"id": hypothesis.entry, "entry": hypothesis.place, "minimum_detectable": value})
    return found


def least_size(hypothesis: Hypothesis, grid: Sequence[tuple[Values, float]]) -> float | None:
    """Return the distance from the null at which the evidence has fallen by `excluded_nats`; None where it never does.

    Between grid points nats go with a power of the size. No smaller size is told than the smallest that is tried: the
    search begins at those.
    """
    rules = in_force().run_prior
    null = 1.0 if hypothesis.names[0] in _FACTORS else 0.0
    points = sorted((abs(v[0] - null), -gain) for v, gain in grid)
    enough = next((k for k, (_, nats) in enumerate(points) if nats >= rules.excluded_nats), None)
    if enough is None:
        return None
    size, nats = points[enough]
    before, less = points[enough - 1] if enough else (0.0, 0.0)
    if less > 0 and before < size:
        slope = np.log(size / before) / np.log(nats / less)
        return float(before * (rules.excluded_nats / less) ** slope)
    return float(max(size * np.sqrt(rules.excluded_nats / nats), before, points[0][0]))
