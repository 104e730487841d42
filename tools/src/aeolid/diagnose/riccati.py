"""Solve the filter Riccati equation, compiled: a fit asks for a gain with every parameter it moves, on every thread."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
FLOORS = (0.0, 1e-12)  # least sensor noise to be tried, in squares of what the process noise moves in one step
_TERMS, _SMALL = 14, 0.5  # Taylor terms of eˣ where ‖X‖₁ ≤ 0.5: the first one left out is below 1e-15


def steady_gain(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Solve the filter Riccati equation by structure-preserving doubling; returns A P Cᵀ (C P Cᵀ + R)⁻¹.

    Where a sensor noise is so small that R⁻¹ is singular to rounding, it counts as a millionth of what the process
    noise moves in one step. Zero where there is no finite solution.
    """
    A, C, Q = (np.ascontiguousarray(part, dtype=np.float64) for part in (A, C, Q))
    for floor in FLOORS:
        try:
            return double(A, C, Q, np.ascontiguousarray(R + np.diag(floor * np.diag(C @ Q @ C.T))))
        except np.linalg.LinAlgError:
            continue
    return np.zeros((len(A), len(C)))


@njit(cache=True, error_model="numpy", nogil=True)
def double(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Return the steady gain (n, l), zero where P grows beyond all bounds; LinAlgError where a matrix is singular.

    Doubling: Chu, Fan, Lin, Wang 2004, Int. J. Control 77(8); quadratic convergence, n³ an iteration. All arrays
    C-contiguous.
    """
    n = len(A)
    Ct = np.ascontiguousarray(C.T)
    eye, F, G, H = np.eye(n), np.ascontiguousarray(A.T), Ct @ np.linalg.solve(R, C), Q
    both = np.empty((n, 2 * n))
    for _ in range(40):
        both[:, :n], both[:, n:] = F, G
        W = np.linalg.solve(eye + G @ H, both)
        first, second = np.ascontiguousarray(W[:, :n]), np.ascontiguousarray(W[:, n:])
        Ft = np.ascontiguousarray(F.T)
        change = Ft @ H @ first
        G, H, F = G + F @ second @ Ft, H + change, F @ first
        if not np.all(np.abs(H) < 1e100):
            return np.zeros((n, len(C)))
        if np.linalg.norm(change) <= 1e-13 * np.linalg.norm(H):
            break
    return A @ H @ Ct @ np.linalg.inv(C @ H @ Ct + R)


@njit(cache=True, error_model="numpy", nogil=True)
def exponential(A: Array) -> Array:
    """Return e^A (n, n) by scaling and squaring of a Taylor series; infinite or NaN where it is out of all bounds.

    For matrices of a few states in balanced units, where scipy's expm, which holds the interpreter's lock, took half
    the time of a gain.
    """
    n = len(A)
    norm = 0.0
    for j in range(n):
        norm = max(norm, np.sum(np.abs(A[:, j])))
    if not norm < 1e10:
        return np.full((n, n), np.inf)
    halvings = 0
    while norm > _SMALL:
        norm, halvings = 0.5 * norm, halvings + 1
    X, result = A / 2.0**halvings, np.eye(n)
    for k in range(_TERMS, 0, -1):
        result = np.eye(n) + (X @ result) / k
    for _ in range(halvings):
        result = result @ result
    return result
