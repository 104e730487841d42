"""Turn noise amplitudes into the predictor's gain: the Kalman filter of the linearised model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.models.integrate import Compiled, numeric_jacobian, output_jacobian

Array = NDArray[np.float64]
_EXACT = 1e-4  # a sensor's error is at least a hundredth of what the process noise of one sample moves it


def kalman_gain(
    compiled: Compiled, sizes: tuple[Array, Array], theta: Array, amplitude: Array, u: Array, step: float
) -> Array:
    """Return the steady Kalman gain (n, l) of the model linearised a typical excursion away from its start.

    Process noise of standard deviation amplitude[i] · size_i a sample on each state, sensor noise
    amplitude[n + j] · spread_j, and no less than a hundredth of what it sees of a sample's process noise: towards a
    faultless sensor the likelihood is flat and the gain without end. Sizes are those of the states (n,) and outputs
    (l,), u (r,) the typical input, step the time between rows in s. Zero where the Riccati equation has no finite
    solution.
    """
    x_size, spread = sizes
    n, m = len(x_size), len(spread)
    x = compiled.model.x0[:n] + x_size
    J = numeric_jacobian(compiled, x, u, theta)
    C = output_jacobian(compiled, x, u, theta, step)
    if not np.all(np.isfinite(J)) or not np.all(np.isfinite(C)):
        return np.zeros((n, m))
    Q = np.diag((amplitude[:n] * x_size) ** 2)
    R = np.diag((amplitude[n:] * spread) ** 2 + _EXACT * np.diag(C @ Q @ C.T))
    if compiled.model.sample_time_s:
        return steady_gain(J, C, Q, R)  # a discrete model runs at the rate of its outputs
    A = np.asarray(expm(J * step))
    return steady_gain(A, C, 0.5 * (Q + A @ Q @ A.T), R)


def steady_gain(A: Array, C: Array, Q: Array, R: Array) -> Array:
    """Solve the filter Riccati equation by structure-preserving doubling; returns A P Cᵀ (C P Cᵀ + R)⁻¹.

    Doubling: Chu, Fan, Lin, Wang 2004, Int. J. Control 77(8); quadratic convergence, n³ an iteration. Where a sensor
    noise is so small that R⁻¹ is singular to rounding, it counts as a millionth of what the process noise moves in one
    step. Zero where there is no finite solution.
    """
    for floor in (0.0, 1e-12):
        try:
            return _double(A, C, Q, R + np.diag(floor * np.diag(C @ Q @ C.T)))
        except np.linalg.LinAlgError:
            continue
    return np.zeros((len(A), len(C)))


def _double(A: Array, C: Array, Q: Array, R: Array) -> Array:
    n = len(A)
    eye, F, G, H = np.eye(n), A.T.copy(), C.T @ np.linalg.solve(R, C), Q.copy()
    for _ in range(40):
        W = np.linalg.solve(eye + G @ H, np.hstack([F, G]))
        F_next, change = F @ W[:, :n], F.T @ H @ W[:, :n]
        G, H = G + F @ W[:, n:] @ F.T, H + change
        F = F_next
        if not np.all(np.abs(H) < 1e100):
            return np.zeros((n, len(C)))
        if np.linalg.norm(change) <= 1e-13 * np.linalg.norm(H):
            break
    gain: Array = A @ H @ C.T @ np.linalg.inv(C @ H @ C.T + R)
    return gain


def forgets(compiled: Compiled, middle: tuple[Array, Array], theta: Array, K: Array, step: float) -> bool:
    """Tell whether the predictor forgets its start: all |eigenvalues| of A − K C below 1, linearised at (x, u)."""
    closed, _ = closed_loop(compiled, middle, theta, K, step)
    return bool(np.all(np.isfinite(closed)) and np.max(np.abs(np.linalg.eigvals(closed)), initial=0.0) < 1.0)


def closed_loop(
    compiled: Compiled, middle: tuple[Array, Array], theta: Array, K: Array, step: float
) -> tuple[Array, Array]:
    """Return A − K C (n, n) of one row and C (l, n), linearised at middle = (x, u); NaN where they are not finite."""
    A = numeric_jacobian(compiled, *middle, theta)
    if not np.all(np.isfinite(A)):
        return np.full_like(A, np.nan), np.full(K.T.shape, np.nan)
    if not compiled.model.sample_time_s:
        A = np.asarray(expm(A * step))
    C = output_jacobian(compiled, *middle, theta, step)
    return A - K @ C, C
