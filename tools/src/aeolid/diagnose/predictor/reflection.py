"""Bring a gain whose predictor does not forget back: the gain that forgets, of the same spectrum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from aeolid.diagnose.predictor.gains import closed_loop
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.models.integrate import Compiled

Array = NDArray[np.float64]


def reflected(
    compiled: Compiled, middle: tuple[Array, Array], point: Point, free: Free, covariance: Array, step: float
) -> Point:
    """Return the point with its gain reflected at the unit circle.

    Itself where nothing lies outside, where that cannot be, or where entries of the gain would move that are not free.
    covariance (l, l): that of the innovations. Cost: a few decompositions of n × n matrices.
    """
    assert point.K is not None
    closed, C = closed_loop(compiled, middle, point.theta, point.K, step)
    if not np.all(np.isfinite(closed)) or not np.all(np.isfinite(C)):
        return point
    K = reflect(closed, C, point.K, covariance)
    if K is None:
        return point
    held = np.ones(K.shape, dtype=bool)
    if free.gain:
        held[tuple(np.array(free.gain).T)] = False
    return replace(point, K=K) if np.array_equal(K[held], point.K[held]) else point


def reflect(closed: Array, C: Array, K: Array, covariance: Array) -> Array | None:
    """Return the gain (n, l) of the same output spectrum whose A − K C has each outer eigenvalue λ at 1/λ̄.

    closed (n, n): F = A − K C; C (l, n); covariance R (l, l). x⁺ = A x + K e, y = C x + e has one spectrum and many
    gains; the Kalman filter's is the one that forgets: K + F P Cᵀ (R + C P Cᵀ)⁻¹ with P = F (P⁻¹ + Cᵀ R⁻¹ C)⁻¹ Fᵀ on
    the outer eigenspace (Anderson & Moore 1979, section 9.3), there a Stein equation for P⁻¹, which stays solvable next
    to the circle. None where nothing is outside or there is no solution: a mode outside that no output shows, a
    singular R.
    """
    try:
        with np.errstate(all="ignore"):
            P = _excess(closed, C, covariance)
            if P is None:
                return None
            change = np.linalg.solve(covariance + C @ P @ C.T, C @ P @ closed.T).T
    except (np.linalg.LinAlgError, ValueError):
        return None
    return K + change if np.all(np.isfinite(change)) else None


def _excess(closed: Array, C: Array, covariance: Array) -> Array | None:
    """Return P (n, n), what the state's error is on top of none; None where nothing is outside or nothing shows it."""
    T, Z, outer = schur(closed, output="real", sort="ouc")
    if not outer:
        return None
    V, back = Z[:, :outer], np.linalg.inv(T[:outer, :outer])
    seen = C @ V
    X = _stein(back.T, back.T @ seen.T @ np.linalg.solve(covariance, seen) @ back)
    if not np.all(np.isfinite(X)) or np.linalg.eigvalsh(0.5 * (X + X.T))[0] <= 0:
        return None
    return np.asarray(V @ np.linalg.solve(X, V.T), dtype=np.float64)


def _stein(F: Array, Q: Array) -> Array:
    """Return X (k, k) = F X Fᵀ + Q from its k² equations, k few; raises LinAlgError where they have no solution.

    How well it solves them is not asked: what the gain is worth is. (scipy's solver warns the user of each.)
    """
    k = len(F)
    X = np.linalg.solve(np.eye(k * k) - np.kron(F, F), Q.ravel())
    return np.asarray(X, dtype=np.float64).reshape(k, k)
