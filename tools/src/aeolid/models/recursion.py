"""Run linear state recursions over long recordings without a Python loop over samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHORT = 48  # below this many samples the plain loop is faster than another halving


def run_states(A: Array, forced: Array, x0: Array) -> Array:
    """Return the states x_0 … x_N of x⁺ = A x + f_k.

    A (n, n), forced (N, n), x0 (n,); returns (N + 1, n). Pairs of samples are merged into one step of A² until few
    are left (f_{2j+1} + A f_{2j}), so that the work is matrix products: about 4 N n² operations, log₂ N calls.
    An unstable A grows as it does in the plain loop; the result may then hold infinities.

    >>> run_states(np.array([[0.5]]), np.ones((3, 1)), np.zeros(1)).ravel().tolist()
    [0.0, 1.0, 1.5, 1.75]
    """
    samples = len(forced)
    if samples <= SHORT:
        return _run_plain(A, forced, x0)
    half = samples // 2
    first, second = forced[0 : 2 * half : 2], forced[1 : 2 * half : 2]
    even = run_states(A @ A, first @ A.T + second, x0)  # (half + 1, n): x_0, x_2, …
    states = np.empty((samples + 1, len(x0)))
    states[0 : 2 * half + 1 : 2] = even
    states[1 : 2 * half : 2] = even[:-1] @ A.T + first
    if samples % 2:
        states[samples] = A @ states[samples - 1] + forced[samples - 1]
    return states


def _run_plain(A: Array, forced: Array, x0: Array) -> Array:
    states = np.empty((len(forced) + 1, len(x0)))
    states[0] = x0
    for k, f in enumerate(forced):
        states[k + 1] = A @ states[k] + f
    return states
