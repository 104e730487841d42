"""March Kalman's gain through gaps as `gap_gains` says, compiled: plain loops, since these compile in a second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.compiled import njit

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]


@njit(cache=True, error_model="numpy", nogil=True)
def _product(X: Array, Y: Array, out: Array) -> None:
    """Write X Y, (p, q) times (q, r)."""
    for i in range(X.shape[0]):
        for j in range(Y.shape[1]):
            out[i, j] = 0.0
        for k in range(X.shape[1]):
            x = X[i, k]
            for j in range(Y.shape[1]):
                out[i, j] += x * Y[k, j]


@njit(cache=True, error_model="numpy", nogil=True)
def _divide(X: Array, S: Array) -> None:
    """Write X S⁻¹ in place of X (n, l); S (l, l), symmetric and positive definite, becomes its Cholesky factor L."""
    size = len(S)
    for j in range(size):
        for k in range(j):
            S[j, j] -= S[j, k] * S[j, k]
        S[j, j] = np.sqrt(S[j, j])
        for i in range(j + 1, size):
            for k in range(j):
                S[i, j] -= S[i, k] * S[j, k]
            S[i, j] /= S[j, j]
    for row in range(len(X)):
        for j in range(size):
            for k in range(j):
                X[row, j] -= S[j, k] * X[row, k]
            X[row, j] /= S[j, j]
        for j in range(size - 1, -1, -1):
            for k in range(j + 1, size):
                X[row, j] -= S[k, j] * X[row, k]
            X[row, j] /= S[j, j]


@njit(cache=True, error_model="numpy", nogil=True)
def march(
    A: Array, C: Array, K: Array, R: Array, there: Array, gap: Flags, k: int, active: bool, P: Array, faded: float,
    rows: Rows, gains: Array,
) -> tuple[int, int, bool]:  # fmt: skip
    """Go on from sample k until `rows` is full, as `gap_gains._march` does."""
    n, m, count, moving = A.shape[1], C.shape[1], 0, len(A) > 1
    Ct, PC, moved, cross, AP = np.empty((n, m)), np.empty((n, m)), np.empty((n, m)), np.empty((n, m)), np.empty((n, n))
    S, noise, lost = np.empty((m, m)), np.empty((n, n)), np.empty((n, n))
    while count < len(rows):
        while k < len(gap) and not (active or gap[k]):
            k += 1
        if k == len(gap):
            break
        if not active:
            P[:, :] = 0.0
        i, seen = k if moving else 0, there[k]
        for a in range(m):
            for b in range(n):
                Ct[b, a] = C[i, a, b] * seen[a]
        _product(P, Ct, PC)
        _product(Ct.T, PC, S)
        _product(A[i], PC, moved)
        _product(K[i], R, cross)
        _product(cross, K[i].T, noise)
        for a in range(m):
            for b in range(m):
                S[a, b] += R[a, b] * seen[a] * seen[b]
            S[a, a] += 1.0 - seen[a]
            for b in range(n):
                moved[b, a] += cross[b, a] * seen[a]
        gains[count] = moved
        _divide(gains[count], S)
        _product(gains[count], moved.T, lost)
        _product(A[i], P, AP)
        _product(AP, A[i].T, P)
        power = least = 0.0
        for a in range(n):
            for b in range(n):
                P[a, b] += noise[a, b] - lost[a, b]
                power += P[a, b] ** 2
                least += noise[a, b] ** 2
        rows[count], count, k = k, count + 1, k + 1
        active = not np.sqrt(power) <= faded * np.sqrt(least)
    return count, k, active
