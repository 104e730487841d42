"""Find Kalman's gain around samples in which outputs are missing, for predictors that have theirs without gaps.

Of x⁺ = A x + K e, y = C x + e, cov e = R, with the outputs o that are there: with P the covariance of the state,
S = C_o P C_oᵀ + R_oo and G = (A P C_oᵀ + K R_o) S⁻¹ it is P⁺ = A P Aᵀ + K R Kᵀ − G S Gᵀ (Anderson and Moore 1979,
section 5.5). P is zero before the first gap, and again where it has FADED: then G = K. So it is where the matrices are
those of each sample (a scheduled model): nothing in it takes them to be the same from one to the next.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]
FADED = 1e-4  # of the noise in a step: what a gap has added to the state's covariance then shows in no error
CHUNK = 4096  # gains that are held at a time; the first of these are found before the compiled loop is loaded


class GapGains:
    """Find the gains of a recording, part after part."""

    def __init__(self, R: Array | None, order: int) -> None:
        """Begin. R (l, l): covariance of the innovations, None where it is not known; order: n."""
        known = R is not None and bool(np.isfinite(R).all()) and np.linalg.eigvalsh(R)[0] > 0
        self._R = np.ascontiguousarray(R, dtype=np.float64) if known else None
        self._P, self._active, self._march = np.zeros((order, order)), False, _march

    def of(self, A: Array, C: Array, K: Array, known: Flags) -> Iterator[tuple[Rows, Array]]:
        """Yield the samples k (c,) of a part whose gain is not K, in order, and their gains (c, n, l), CHUNK at most.

        A, C, K: (n, n), (l, n), (n, l), or of each sample, with a leading axis of N; known (N, l): which outputs are
        there. Without R, or where it is singular, K stays for the outputs that are there. Cost: some n³ operations a
        sample from a gap on until P has faded.
        """
        gap: Flags = np.asarray(~known.all(axis=1))
        if self._R is None:
            rows = np.flatnonzero(gap)
            for start in range(0, len(rows), CHUNK):
                at = rows[start : start + CHUNK]
                yield at, (K if K.ndim == 2 else K[at]) * known[at][:, None, :]
            return
        A, C, K = (np.ascontiguousarray(M if M.ndim == 3 else M[None], dtype=np.float64) for M in (A, C, K))
        size, k, there = min(CHUNK, len(gap)), 0, known.astype(np.float64)
        while k < len(gap) and (self._active or gap[k:].any()):
            rows, gains = np.empty(size, dtype=np.int64), np.empty((size, *K.shape[1:]))
            with np.errstate(all="ignore"):  # the covariance of an unstable mode that no output shows overflows
                count, k, self._active = self._march(
                    A, C, K, self._R, there, gap, k, self._active, self._P, FADED, rows, gains
                )
            yield rows[:count], gains[:count]
            if count == CHUNK:
                from aeolid.models.gap_gains_compiled import march  # half a second to load, not for a few gaps

                self._march = march

    def around(self, A: Array, C: Array, K: Array, known: Flags) -> Array:
        """Return the gains (N, n, l) of all samples of a part; A, C, K, known as in `of`."""
        out = K.copy() if K.ndim == 3 else np.tile(K, (len(known), 1, 1))
        for rows, gains in self.of(A, C, K, known):
            out[rows] = gains
        return out


def _march(
    A: Array, C: Array, K: Array, R: Array, there: Array, gap: Flags, k: int, active: bool, P: Array, faded: float,
    rows: Rows, gains: Array,
) -> tuple[int, int, bool]:  # fmt: skip
    """Go on from sample k until `rows` is full; returns how many it holds, the next sample, whether P is not faded yet.

    there (N, l): 1 where an output is known, else 0; P (n, n) is carried on in place. `gap_gains_compiled.march` does
    the same.
    """
    count, moving = 0, len(A) > 1
    while count < len(rows):
        while k < len(gap) and not (active or gap[k]):
            k += 1
        if k == len(gap):
            break
        if not active:
            P[:, :] = 0.0
        i, seen = k if moving else 0, there[k]
        cross, Ck = np.dot(K[i], R), C[i] * seen.reshape(-1, 1)  # an output that is missing has a row of zeros …
        PC = np.dot(P, Ck.T)
        S = np.dot(Ck, PC) + R * np.outer(seen, seen) + np.diag(1.0 - seen)  # … and its own unit of variance
        moved = np.dot(A[i], PC) + cross * seen
        noise = np.dot(cross, K[i].T)
        if np.isfinite(S).all() and np.isfinite(moved).all():
            G = np.linalg.solve(S, moved.T).T
        else:
            G = np.full_like(moved, np.nan)
        P[:, :] = np.dot(np.dot(A[i], P), A[i].T) + noise - np.dot(G, moved.T)
        rows[count], gains[count] = k, G
        count, k = count + 1, k + 1
        active = not np.sqrt((P * P).sum()) <= faded * np.sqrt((noise * noise).sum())
    return count, k, active
