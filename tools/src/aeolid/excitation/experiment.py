"""Describe an experiment on a known plant: what a signal and the plant's own noise do to its channels.

The plant is x⁺ = A x + B u + K e, y = C x + D u + e, cov e = Λ (Ljung, System Identification, 1999, eq. (4.91)); in
open loop u = r, the signal; in closed loop u = r + c, where c is the answer of a linear controller to y,
    c = Cc xc + Dc y, xc⁺ = Ac xc + Bc y.
Both are one system ξ⁺ = F ξ + G r + L e, [x; u; y] = H ξ + J r + M e. All signals are deviations from rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, schur, solve_discrete_lyapunov

from aeolid.decompositions import condition
from aeolid.identify.subspace import ScaledModel, spectral_radius
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Experiment:
    """Hold ξ⁺ = F ξ + G r + L e, [x; u; y] = H ξ + J r + M e, and Λ (l, l); n, r, l count x, u and y."""

    F: Array
    G: Array
    L: Array
    H: Array
    J: Array
    M: Array
    covariance: Array
    states: int
    inputs: int

    @property
    def outputs(self) -> int:
        """Return the number l of outputs."""
        return len(self.covariance)

    @property
    def radius(self) -> float:
        """Return the largest magnitude of the poles of the whole, below 1 where signals stay bounded."""
        return spectral_radius(self.F)

    def answer(self, r: Array) -> Array:
        """Return [x, u, y] (N, n + r + l) that the signal r (N, r) alone causes, from rest."""
        states = run_states(self.F, r @ self.G.T, np.zeros(len(self.F)))[:-1]
        out: Array = states @ self.H.T + r @ self.J.T
        return out

    def noise_covariances(self, lags: int) -> Array:
        """Return E z_{k+τ} z_kᵀ (lags + 1, m, m), z = [u; y], of the noise alone: τ = 0 … lags.

        P = F P Fᵀ + L Λ Lᵀ; R_0 = H P Hᵀ + M Λ Mᵀ; R_τ = H F^{τ−1} (F P Hᵀ + L Λ Mᵀ). Raises ValueError where a pole
        lies on the unit circle.
        """
        H, M, S = self.H[self.states :], self.M[self.states :], self.covariance
        P = solve_discrete_lyapunov(self.F, self.L @ S @ self.L.T)
        out = np.empty((lags + 1, len(H), len(H)))
        out[0] = H @ P @ H.T + M @ S @ M.T
        state = self.F @ P @ H.T + self.L @ S @ M.T
        for lag in range(1, lags + 1):
            out[lag] = H @ state
            state = self.F @ state
        return out


def experiment_on(plant: StateSpace, controller: StateSpace | None = None) -> Experiment:
    """Return the experiment on a plant with K and Λ, in open loop or under a controller from its y to its u.

    Raises ValueError where the loop through D and Dc has no solution within the sample.
    """
    assert plant.K is not None and plant.innovation_covariance is not None
    n, (outputs, r) = plant.order, plant.D.shape
    A, B, C, D = plant.A, plant.B, plant.C, plant.D
    if controller is None:
        Ac, Bc, Cc, Dc = np.zeros((0, 0)), np.zeros((0, outputs)), np.zeros((r, 0)), np.zeros((r, outputs))
    else:
        Ac, Bc, Cc, Dc = controller.A, controller.B, controller.C, controller.D
    within = np.eye(outputs) - D @ Dc
    if condition(within) > 1e10:
        raise ValueError("the loop within the sample has no solution")
    W = np.linalg.inv(within)
    y = np.hstack([W @ C, W @ D @ Cc])  # of [x; xc]
    u = np.hstack([Dc @ y[:, :n], Cc + Dc @ y[:, n:]])
    y_r, y_e = W @ D, W
    u_r, u_e = np.eye(r) + Dc @ y_r, Dc @ y_e
    F = np.block([[A + B @ u[:, :n], B @ u[:, n:]], [Bc @ y[:, :n], Ac + Bc @ y[:, n:]]])
    G, L = np.vstack([B @ u_r, Bc @ y_r]), np.vstack([B @ u_e + plant.K, Bc @ y_e])
    H = np.vstack([np.eye(n, len(F)), u, y])
    J, M = np.vstack([np.zeros((n, r)), u_r, y_r]), np.vstack([np.zeros((n, outputs)), u_e, y_e])
    F, T = matrix_balance(F, permute=False)
    F, Z = schur(F, output="real")  # powers of a triangular matrix keep its poles; of a controller's own form they grow
    back = T @ Z
    G, L, H = np.linalg.solve(back, G), np.linalg.solve(back, L), H @ back
    return Experiment(F, G, L, H, J, M, plant.innovation_covariance, n, r)


def scaled_plant(plant: StateSpace, scale: Array) -> ScaledModel:
    """Return the plant's matrices with [u; y] in units of scale (r + l,)."""
    assert plant.K is not None and plant.innovation_covariance is not None
    su, sy = scale[: plant.B.shape[1]], scale[plant.B.shape[1] :]
    covariance = plant.innovation_covariance / sy[:, None] / sy
    C, D = plant.C / sy[:, None], plant.D * su / sy[:, None]
    return ScaledModel(plant.A, plant.B * su, C, D, plant.K * sy, covariance, "known")
