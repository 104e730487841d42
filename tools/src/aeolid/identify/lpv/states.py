"""Hold the estimated state sequence, which both algorithms of paper 001 end in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LARGEST_ORDER = 40  # states kept of a sequence


@dataclass(frozen=True, eq=False)
class StateSequence:
    """Hold the estimated states of a set of windows.

    singular_values (f l,) of Γ𝒦Z/√N, eq. (15); X (N, k) states scaled to √σ: the first n columns are those of order n,
    eq. (16).
    """

    singular_values: Array
    X: Array


@dataclass(frozen=True, eq=False)
class Estimate:
    """Hold the states and what the regression before them met.

    rank of `regressors` (of the windows, for the kernel); penalty (l,) relative to the largest singular value;
    freedom (l,): effective number of parameters; facts: what the method itself has to say, for JSON.
    """

    states: StateSequence
    rank: int
    regressors: int
    penalty: Array
    freedom: Array
    facts: dict[str, Any]


def largest_kept(values: Array, rounding: float) -> int:
    """Return the number of singular values above rounding, a fraction of the largest, at most LARGEST_ORDER."""
    if not len(values) or values[0] <= 0:
        return 0
    return min(int(np.count_nonzero(values > values[0] * len(values) * rounding)), LARGEST_ORDER)
