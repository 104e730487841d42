"""Solve the filter Riccati equation, compiled: a fit asks for a gain with every parameter it moves, on every thread.

Plain loops over the matrices of a few states: numba's own linear algebra keeps the first diagnosis after an
installation waiting longer for the compiler, and a gain takes no less time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
FLOORS = (0.0, 1e-12)  # least sensor noise to be tried, in squares of what the process noise moves in one step
_MOST = 40  # doublings: the P of 2^40 samples
_BEYOND = 1e100
_TERMS, _SMALL, _HUGE = 14, 0.5, 1e10  # Taylor terms of eˣ where ‖X‖₁ ≤ 0.5: the first one left out is below 1e-15


def steady_gain(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Solve the filter Riccati equation by structure-preserving doubling; returns A P Cᵀ (C P Cᵀ + R)⁻¹.

    Where a sensor noise is so small that R⁻¹ is singular to rounding, it counts as a millionth of what the process
    noise moves in one step. Zero where there is no finite solution.
    """
    A, C, Q = (np.ascontiguousarray(part, dtype=np.float64) for part in (A, C, Q))
    gain = np.zeros((len(A), len(C)))
    for floor in FLOORS:
        if double(A, C, Q, np.ascontiguousarray(R + np.diag(floor * np.diag(C @ Q @ C.T))), gain):
            break
    return gain


@njit(cache=True, error_model="numpy", nogil=True)
def double(A: Array, C: Array, Q: Array, R: Array, gain: Array) -> bool:
    """Write the steady gain (n, l), zero where P grows beyond all bounds; false where a matrix is singular.

    Doubling: Chu, Fan, Lin, Wang 2004, Int. J. Control 77(8); quadratic convergence, n³ an iteration. All arrays
    C-contiguous.
    """
    n, m = len(A), len(C)
    gain[:] = 0.0
    weighted = C.copy()
    if not solve(R.copy(), weighted):
        return False
    F, G, H = transposed(A), product(transposed(C), weighted), Q.copy()
    both, left = np.empty((n, 2 * n)), np.empty((n, n))
    for _ in range(_MOST):
        Ft, GH = transposed(F), product(G, H)
        for i in range(n):
            for j in range(n):
                both[i, j], both[i, n + j] = F[i, j], G[i, j]
                left[i, j] = GH[i, j] + (1.0 if i == j else 0.0)
        if not solve(left, both):
            return False
        first, second = both[:, :n].copy(), both[:, n:].copy()
        change, further = product(Ft, product(H, first)), product(product(F, second), Ft)
        F = product(F, first)
        size = moved = 0.0
        for i in range(n):
            for j in range(n):
                G[i, j] += further[i, j]
                H[i, j] += change[i, j]
                if not abs(H[i, j]) < _BEYOND:
                    return True
                size += H[i, j] ** 2
                moved += change[i, j] ** 2
        if moved <= 1e-26 * size:
            break
    seen = product(H, transposed(C))
    innovation = product(C, seen)
    for i in range(m):
        for j in range(m):
            innovation[i, j] += R[i, j]
    ahead = transposed(product(A, seen))
    if not solve(innovation, ahead):
        return False
    gain[:] = transposed(ahead)
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def exponential(A: Array) -> Array:
    """Return e^A (n, n) by scaling and squaring of a Taylor series; infinite where it is out of all bounds.

    For balanced units: scipy's expm, which is for all matrices, holds the interpreter's lock.
    """
    n = len(A)
    norm = 0.0
    for j in range(n):
        column = 0.0
        for i in range(n):
            column += abs(A[i, j])
        if not column < _HUGE:
            return np.full((n, n), np.inf)
        norm = max(norm, column)
    halvings = 0
    while norm > _SMALL:
        norm, halvings = 0.5 * norm, halvings + 1
    result = np.zeros((n, n))
    for k in range(_TERMS, -1, -1):  # Horner's rule
        result = product(A, result)
        for i in range(n):
            for j in range(n):
                result[i, j] *= 0.5**halvings / (k + 1)
            result[i, i] += 1.0
    for _ in range(halvings):
        result = product(result, result)
    return result


@njit(cache=True, error_model="numpy", nogil=True)
def product(A: Array, B: Array) -> Array:
    """Return A B."""
    result = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                result[i, j] += A[i, k] * B[k, j]
    return result


@njit(cache=True, error_model="numpy", nogil=True)
def transposed(A: Array) -> Array:
    """Return Aᵀ in rows of its own."""
    result = np.empty((A.shape[1], A.shape[0]))
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            result[j, i] = A[i, j]
    return result


@njit(cache=True, error_model="numpy", nogil=True)
def solve(A: Array, B: Array) -> bool:
    """Replace B (n, k) by A⁻¹ B and A by what elimination with pivots leaves; false where a pivot is zero or NaN."""
    n, k = B.shape
    for c in range(n):
        p = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[p, c]):
                p = i
        if not abs(A[p, c]) > 0.0:
            return False
        if p != c:
            for j in range(n):
                A[c, j], A[p, j] = A[p, j], A[c, j]
            for j in range(k):
                B[c, j], B[p, j] = B[p, j], B[c, j]
        for i in range(c + 1, n):
            factor = A[i, c] / A[c, c]
            for j in range(c + 1, n):
                A[i, j] -= factor * A[c, j]
            for j in range(k):
                B[i, j] -= factor * B[c, j]
    for c in range(n - 1, -1, -1):
        for j in range(k):
            B[c, j] /= A[c, c]
        for i in range(c):
            for j in range(k):
                B[i, j] -= A[i, c] * B[c, j]
    return True
