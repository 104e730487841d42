"""Recover the state and the system matrices from Markov parameters: PBSIDopt, paper 000 eq. (20)–(27).

Everything is computed from the window factor R: with ΓK Z = ΓK R_zᵀ Qᵀ the singular values and left singular vectors
of (26) are those of the small matrix ΓK R_zᵀ (f l × p m), and since the state x_k = T z̄_k, the inputs and the outputs
are linear in a window v_k, the regressions of (1) need R alone. No array of the length of the recording is formed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur, solve_discrete_are

from aeolid.decompositions import lstsq, svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.windows import WindowFactor
from aeolid.wording import counted

Array = NDArray[np.float64]
INSIDE = 0.9999  # where poles on or outside the unit circle are moved
LONGEST_REST = 3.0  # over the number of windows: a mode with less of I − A shows no rest


@dataclass(frozen=True, eq=False)
class StateBasis:
    """Hold the singular value decomposition (26) and what turns windows into states.

    singular_values (f l,), those of ΓK Z/√N; left (f l, k) singular vectors; gamma_k (f l, p m) of eq. (22).
    """

    singular_values: Array
    left: Array
    gamma_k: Array
    windows: int

    def selector(self, order: int) -> Array:
        """Return S (n, f l) with x = S ΓK z̄, eq. (27), states scaled to the square root of their singular value.

        Raises NotIdentifiable where the singular values of so many states are not above zero.
        """
        values = self.singular_values[:order] * np.sqrt(self.windows)
        known = int(np.count_nonzero(values > 0))
        if known < order:
            raise NotIdentifiable(
                f"{counted(known, 'singular value')} above zero, {counted(order, 'state')} need as many: too little of "
                "the outputs follows from the past; record longer, lower the order or look at the roles"
            )
        scaled: Array = self.left[:, :order].T / np.sqrt(values)[:, None]
        return scaled

    def state_map(self, order: int) -> Array:
        """Return T (n, p m) with x_k = T [z_{k-p} … z_{k-1}]; raises NotIdentifiable as `selector`."""
        mapped: Array = self.selector(order) @ self.gamma_k
        return mapped


@dataclass(frozen=True, eq=False)
class ScaledModel:
    """Hold A, B, C, D, K of eq. (1) in scaled units, the innovation covariance and how K was found."""

    A: Array
    B: Array
    C: Array
    D: Array
    K: Array
    covariance: Array
    gain_method: str


def gamma_k(theta: Array, past: int, future: int, channels: int) -> Array:
    """Return ΓK (f l, p m) of eq. (22) from Ξ (l, ≥ p m).

    [ Ξ_1 Ξ_2 … Ξ_p     ]
    [  0  Ξ_1 … Ξ_{p−1} ]      Ξ_j (l, m): the j-th block of Ξ, oldest first
    [  0   0  … Ξ_{p−f+1} ]
    """
    outputs, width = theta.shape[0], past * channels
    stacked = np.zeros((future * outputs, width))
    for i in range(future):
        stacked[i * outputs : (i + 1) * outputs, i * channels :] = theta[:, : width - i * channels]
    return stacked


def find_states(factor: WindowFactor, theta: Array, future: int) -> StateBasis:
    """Decompose ΓK Z, eq. (26), through the triangular factor of Z."""
    width = factor.past * factor.channels
    stacked = gamma_k(theta, factor.past, future, factor.channels)
    left, values, _ = svd(stacked @ factor.R[:width, :width].T)
    return StateBasis(values / np.sqrt(max(factor.windows, 1)), left, stacked, factor.windows)


def largest_useful_order(basis: StateBasis) -> int:
    """Return the number of singular values above rounding."""
    values = basis.singular_values
    return int(np.count_nonzero(values > values[0] * len(values) * 1e-13)) if values[0] > 0 else 0


def system_matrices(factor: WindowFactor, T: Array, feedthrough: tuple[bool, ...]) -> ScaledModel:
    """Solve the two regressions of eq. (1) for the state map T (n, p m) and stabilise K by the Riccati equation.

    C, D: y_k on [x_k; u_k of the inputs with feedthrough]; A, B: x_{k+1} on [x_k; u_k; e_k], e_k the residual of the
    first: with e_k in the regression A and B stay consistent when the inputs come from a feedback of y.
    """
    fitted, w, e = _regress(factor, T, feedthrough)
    N = max(factor.windows - len(T) - factor.channels, 1)
    K, covariance, method = kalman_gain(fitted.A, fitted.C, w.T @ w / N, w.T @ e / N, e.T @ e / N, fitted.K)
    return replace(fitted, K=K, covariance=covariance, gain_method=method)


def regressed_matrices(factor: WindowFactor, T: Array, feedthrough: tuple[bool, ...]) -> ScaledModel:
    """Return what the two regressions alone give: A, B, C, D as `system_matrices`, K of least squares."""
    return _regress(factor, T, feedthrough)[0]


def _regress(factor: WindowFactor, T: Array, feedthrough: tuple[bool, ...]) -> tuple[ScaledModel, Array, Array]:
    """Return the model with the gain of least squares, and the residuals w (q, n) of states, e (q, l) of outputs."""
    R, m, r, n = factor.R, factor.channels, factor.inputs, T.shape[0]
    width = factor.past * m
    now = R[:, :width] @ T.T  # (q, n): states in the coordinates of R
    following = R[:, m : width + m] @ T.T  # the window moved on by one sample
    u, y = factor.u_now, factor.y_now
    through = np.flatnonzero(feedthrough)
    first = least_squares(np.hstack([now, u[:, through]]), y)
    C, D = first[:, :n], np.zeros((y.shape[1], r))
    D[:, through] = first[:, n:]
    e = y - now @ C.T - u @ D.T
    second = least_squares(np.hstack([now, u, e]), following)
    A, B, direct = second[:, :n], second[:, n : n + r], second[:, n + r :]
    w = following - now @ A.T - u @ B.T
    V = e.T @ e / max(factor.windows - n - m, 1)
    return ScaledModel(A, B, C, D, direct, V, "least squares"), w, e


def kalman_gain(A: Array, C: Array, Q: Array, S: Array, V: Array, direct: Array) -> tuple[Array, Array, str]:
    """Return K (n, l), the innovation covariance (l, l) and the way they were found.

    Q (n, n), S (n, l), V (l, l): covariances of the state and output residuals. K solves the Riccati equation
    P = A P Aᵀ + Q − K (C P Aᵀ + Sᵀ), K = (A P Cᵀ + S)(C P Cᵀ + V)⁻¹, and makes A − K C stable; `direct` (n, l), the
    least-squares gain, is the fallback. V may be singular (fewer noise sources than outputs): a floor of 1e-9 of its
    largest eigenvalue keeps the equation solvable.
    """
    floor = 1e-9 * float(np.linalg.eigvalsh(V)[-1]) * np.eye(len(V))
    V = V + floor
    joint = np.block([[Q, S], [S.T, V]])
    joint = (joint + joint.T) / 2
    n = len(A)
    try:
        P = solve_discrete_are(A.T, C.T, joint[:n, :n], joint[n:, n:], s=joint[:n, n:])
        covariance = C @ P @ C.T + joint[n:, n:]
        K = np.linalg.solve(covariance, (A @ P @ C.T + joint[:n, n:]).T).T
        if spectral_radius(A - K @ C) < 1:
            return K, covariance, "riccati"
    except (np.linalg.LinAlgError, ValueError):
        pass
    if spectral_radius(A - direct @ C) < 1:
        return direct, V, "least squares"
    return (*_iterate_riccati(A, C, joint), "riccati iteration")


def _iterate_riccati(A: Array, C: Array, joint: Array, steps: int = 2000) -> tuple[Array, Array]:
    """Run the Riccati recursion from a large P: it ends at the stabilising solution where one exists."""
    n = len(A)
    Q, S, V = joint[:n, :n], joint[:n, n:], joint[n:, n:]
    P: Array = np.eye(n) * max(float(np.trace(Q)) / n, 1e-12) * 1e3
    K = np.asarray(S, dtype=np.float64)
    covariance: Array = V
    for _ in range(steps):
        covariance = C @ P @ C.T + V
        K = np.asarray(np.linalg.solve(covariance, (A @ P @ C.T + S).T).T, dtype=np.float64)
        closed = A - K @ C
        noise = np.hstack([np.eye(n), -K])
        P = closed @ P @ closed.T + noise @ joint @ noise.T  # the Joseph form keeps P positive
        P = (P + P.T) / 2
    return K, covariance


def equilibrium(factor: WindowFactor, T: Array, model: ScaledModel) -> Array:
    """Return the outputs at rest (l,) under the mean input, scaled units: what the constants of the regressions say.

    The regressions are about the mean window, x⁺ = A x + B u + b, y = C x + D u + c; the rest is x* = (I − A)⁻¹ b,
    y* = C x* + c. Directions in which I − A is below 3/N of its largest singular value, 1 % at the most, stay at zero:
    an integrator has no rest, and a mode that is slow for the recording shows none.
    """
    m, r = factor.channels, factor.inputs
    width, mean = factor.past * m, factor.mean
    x, following, u = T @ mean[:width], T @ mean[m : width + m], mean[width : width + r]
    y = mean[width + r : width + r + factor.outputs]
    b = following - model.A @ x - model.B @ u
    c = y - model.C @ x - model.D @ u
    out: Array = model.C @ rest_of(model.A, b, factor.windows) + c
    return out


def rest_of(A: Array, b: Array, samples: int) -> Array:
    """Return the rest (n,) of x⁺ = A x + b as N samples show it, see `equilibrium`."""
    known = min(1e-2, LONGEST_REST / max(samples, 1))
    return np.asarray(lstsq(np.eye(len(A)) - A, b, rcond=known), dtype=np.float64)


def spectral_radius(A: Array) -> float:
    """Return the largest eigenvalue magnitude of A (n, n)."""
    return float(abs(np.linalg.eigvals(A)).max()) if len(A) else 0.0


def move_inside(A: Array, radius: float = INSIDE) -> Array:
    """Return A (n, n) with the eigenvalues beyond `radius` moved there along theirs, A itself where there is none.

    On the diagonal of the real Schur form: what couples the modes stays, so that A changes by no more than the poles
    move. Along eigenvectors two poles of a double integrator, 1.002 and 0.998 by noise, would be torn apart: moved by
    0.002, A was off by 0.1, and the gain halved.
    """
    if spectral_radius(A) <= radius:
        return A
    T, Q = schur(A, output="real")
    first = 0
    while first < len(T):
        size = 2 if first + 1 < len(T) and T[first + 1, first] != 0 else 1  # a complex pair has a block
        block = T[first : first + size, first : first + size]
        block *= radius / max(spectral_radius(block), radius)
        first += size
    out: Array = Q @ T @ Q.T
    return out


def stabilise(factor: WindowFactor, model: ScaledModel, T: Array, radius: float = INSIDE) -> ScaledModel:
    """Return the model with every pole inside `radius`: growing poles are moved radially, then B and K fitted again.

    The states stay those of T (n, p m). Poles on or outside the circle come from an integrator or from noise; a user
    who needs a model that does not drift asks for this.
    """
    if spectral_radius(model.A) <= radius:
        return model
    A = move_inside(model.A, radius)
    R, m, r, n = factor.R, factor.channels, factor.inputs, len(A)
    width = factor.past * m
    now, following = R[:, :width] @ T.T, R[:, m : width + m] @ T.T
    u, y = factor.u_now, factor.y_now
    e = y - now @ model.C.T - u @ model.D.T
    rest = following - now @ A.T
    fitted = least_squares(np.hstack([u, e]), rest)
    B = fitted[:, :r]
    w = rest - u @ B.T
    N = max(factor.windows - n - m, 1)
    K, covariance, method = kalman_gain(A, model.C, w.T @ w / N, w.T @ e / N, e.T @ e / N, fitted[:, r:])
    return ScaledModel(A, B, model.C, model.D, K, covariance, method)


def least_squares(regressors: Array, targets: Array) -> Array:
    """Return X with targets ≈ regressors Xᵀ; columns are scaled first, so that rcond means rank, not units."""
    norm = np.sqrt((regressors**2).sum(axis=0))
    norm = np.where(norm > 0, norm, 1.0)
    solution = lstsq(regressors / norm, targets, rcond=1e-11)
    X: Array = solution.T / norm
    return X
