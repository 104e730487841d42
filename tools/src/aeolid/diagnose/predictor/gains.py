"""Turn noise amplitudes into the predictor's gain: the Kalman filter of the linearised model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.compiled import njit
from aeolid.diagnose.predictor.riccati import FLOORS, double, exponential, product, transposed
from aeolid.models.integrate import Compiled, addresses, contiguous, numeric_jacobian, output_jacobian
from aeolid.models.march import reading_jacobian, settle, state_jacobian

Array = NDArray[np.float64]
_EXACT = 1e-4  # a sensor's error is at least a hundredth of what the process noise of one sample moves it


def kalman_gain(
    compiled: Compiled, sizes: tuple[Array, ...], theta: Array, amplitude: Array, u: Array, step: float
) -> Array:
    """Return the steady Kalman gain (n, l) of the model linearised a typical excursion away from its start.

    Process noise of standard deviation amplitude[i] · size_i a sample on each state, sensor noise
    amplitude[n + j] · spread_j, and no less than a hundredth of what it sees of a sample's process noise: towards a
    faultless sensor the likelihood is flat and the gain without end. Sizes are those of the states (n,) and outputs
    (l,), and last how far from its start the model is linearised (n,); u (r,) the typical input, step the time between
    rows in s. Zero where the Riccati equation has no finite solution.
    """
    x_size, spread, excursion = sizes
    n, x = len(x_size), compiled.start.copy()
    x[:n] += excursion
    units = np.where(x_size > 0, x_size, 1.0)
    process, sensor = (amplitude[:n] * x_size / units) ** 2, (amplitude[n:] * spread) ** 2
    gain = np.zeros((n, len(spread)))
    for floor in FLOORS:
        if _solve_at(
            addresses(compiled.code), compiled.model.sample_time_s > 0, x, contiguous(u), contiguous(theta), units,
            process, sensor, step, floor, gain,
        ):  # fmt: skip
            break
    return gain


@njit(cache=True, error_model="numpy", nogil=True)
def _solve_at(
    code: tuple[int, int, int, int], discrete: bool, x: Array, u: Array, th: Array, units: Array, process: Array,
    sensor: Array, step: float, floor: float, gain: Array,
) -> bool:  # fmt: skip
    """Linearise at x (n + memories,) in units (n,) of each state and write the gain; variances (n,) and (l,)."""
    n, m = gain.shape
    still, seen = x.copy(), x.copy()
    settle(code[2], still, u, th, 1.0)
    settle(code[2], seen, u, th, step)
    A = state_jacobian(code[0], n, still, u, th)
    C = reading_jacobian(code[1], code[2], (n, m), seen, u, th, step)
    Q, R = np.zeros((n, n)), np.zeros((m, m))
    for j in range(n):
        Q[j, j] = process[j]
        for i in range(n):
            A[i, j] *= units[j] / units[i] * (1.0 if discrete else step)
        for i in range(m):
            C[i, j] *= units[j]
            R[i, i] += (_EXACT + floor) * process[j] * C[i, j] ** 2
    for i in range(m):
        R[i, i] += sensor[i]
    if not discrete:  # a discrete model runs at the rate of its outputs
        A = exponential(A)
        spread = product(product(A, Q), transposed(A))
        for i in range(n):
            for j in range(n):
                Q[i, j] = 0.5 * (Q[i, j] + spread[i, j])
    found = double(A, C, Q, R, gain)
    for i in range(n):
        for j in range(m):
            gain[i, j] *= units[i]
    return found


def forgets(compiled: Compiled, middle: tuple[Array, Array], theta: Array, K: Array, step: float) -> bool:
    """Tell whether the predictor forgets its start: all |eigenvalues| of A − K C below 1, linearised at (x, u)."""
    closed, _ = closed_loop(compiled, middle, theta, K, step)
    return bool(np.all(np.isfinite(closed)) and np.max(np.abs(np.linalg.eigvals(closed)), initial=0.0) < 1.0)


def closed_loop(
    compiled: Compiled, middle: tuple[Array, Array], theta: Array, K: Array, step: float
) -> tuple[Array, Array]:
    """Return A − K C (n, n) of one row and C (l, n), linearised at middle = (x, u); NaN where they are not finite."""
    A = row_matrix(compiled, middle, theta, step)
    if not np.all(np.isfinite(A)):
        return A, np.full(K.T.shape, np.nan)
    C = output_jacobian(compiled, *middle, theta, step)
    return A - K @ C, C


def row_matrix(compiled: Compiled, middle: tuple[Array, Array], theta: Array, step: float) -> Array:
    """Return A (n, n), which takes small deviations from middle = (x, u) on by one row; NaN where it is not finite."""
    A = numeric_jacobian(compiled, *middle, theta)
    if not np.all(np.isfinite(A)):
        return np.full_like(A, np.nan)
    return A if compiled.model.sample_time_s else np.asarray(expm(A * step))
