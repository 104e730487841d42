"""Realise the deterministic and the stochastic subsystem of a loop: paper 002 sections 6.1 and 6.2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from aeolid.decompositions import lstsq, svd
from aeolid.identify.ort.joint import Layout, Lq, stochastic_rows
from aeolid.identify.subspace import kalman_gain
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Deterministic:
    """Hold x⁺ = A x + B r, w = C x + D r, eq. (9), and its extended observability matrix Γ (f s, n)."""

    A: Array
    B: Array
    C: Array
    D: Array
    gamma: Array


@dataclass(frozen=True, eq=False)
class Stochastic:
    """Hold x⁺ = A x + K ξ, w = C x + ξ, eq. (10), cov ξ = Ξ, and its extended observability matrix Γ (f s, n)."""

    A: Array
    C: Array
    K: Array
    covariance: Array
    gamma: Array
    gain_method: str


@dataclass(frozen=True, eq=False)
class Spectra:
    """Hold the two singular value decompositions from which subsystems of any order follow.

    deterministic: left vectors (f s, ·) and values of L42/√N; stochastic: left vectors, canonical correlations in 0 … 1
    and right vectors (·, p s) of Σ_ff^{−1/2} Σ_fp Σ_pp^{−T/2}; root (f s, f s) = Σ_ff^{1/2}, lower triangular.
    """

    left_d: Array
    values_d: Array
    left_s: Array
    correlations: Array
    right_s: Array
    root: Array

    @property
    def most(self) -> int:
        """Return the number of directions in both above rounding."""
        small = self.values_d > 1e-13 * max(float(self.values_d[0]), 1e-300) * len(self.values_d)
        return int(min(np.count_nonzero(small), np.count_nonzero(self.correlations > 1e-13)))


def find_spectra(lq: Lq, windows: int) -> Spectra:
    """Decompose L42 and the normalised covariance of future and past."""
    U, s, _ = svd(lq.L42, full_matrices=True)  # all left vectors: those beyond n annihilate Γ
    root = triangularise(np.hstack([lq.L43, lq.L44]).T).T
    Us, correlations, Vt = svd(solve_triangular(root, lq.L43, lower=True))
    scale = np.sqrt(windows)
    return Spectra(U, s / scale, Us, correlations, Vt, root / scale)


def realise_deterministic(spectra: Spectra, lq: Lq, layout: Layout, order: int) -> Deterministic:
    """Return the deterministic subsystem: A, C from Γ = Û Ŝ^{1/2}, B, D from eq. (26).

    D of disturbances that do not act on the outputs within the sample is held at zero in the rows of y.
    """
    joint = len(layout.joint)
    gamma = spectra.left_d[:, :order] * np.sqrt(spectra.values_d[:order])
    A = np.asarray(lstsq(gamma[:-joint], gamma[joint:]), np.float64)
    free = np.ones((joint, len(layout.disturbances)), bool)
    free[: len(layout.outputs)] = layout.through
    D, B = solve_toeplitz(spectra.left_d[:, order:], gamma, lq.L41, lq.L11, free)
    return Deterministic(A, B, gamma[:joint], D, gamma)


def solve_toeplitz(annihilator: Array, gamma: Array, L41: Array, L11: Array, free: Array) -> tuple[Array, Array]:
    """Solve U'L41 = U' Ψ(B, D) L11, eq. (26), for D (c, q) and B (n, q) by least squares.

    annihilator U (f c, ·) with U'Γ = 0, Γ (f c, n), L41 (f c, f q), L11 (f q, f q), free (c, q): entries of D that are
    not zero. Block column j of Ψ is [0; D; C B; C A B; …] = S_j [D; B], S_j the identity in block j and Γ below it.
    """
    rows, order = gamma.shape
    channels, q = free.shape
    left = annihilator.T
    blocks = []
    for j in range(rows // channels):
        S = np.hstack([left[:, j * channels : (j + 1) * channels],
                       left[:, (j + 1) * channels :] @ gamma[: rows - (j + 1) * channels]])  # fmt: skip
        blocks.append(S)  # (a, c + n)
    stacked = np.stack(blocks)  # (f, a, c + n)
    weights = L11.reshape(len(blocks), q, -1)  # (f, q, f q)
    system = np.einsum("jak,jqt->taqk", stacked, weights).reshape(weights.shape[2] * left.shape[0], -1)
    target = (left @ L41).T.ravel()
    keep = np.hstack([free.T, np.ones((q, order), bool)]).ravel()  # unknowns: for each disturbance [D; B]
    solution = np.zeros(len(keep))
    solution[keep] = lstsq(system[:, keep], target)
    both = solution.reshape(q, channels + order).T
    return both[:channels], both[channels:]


def realise_stochastic(spectra: Spectra, factor: WindowFactor, lq: Lq, layout: Layout, order: int) -> Stochastic:
    """Return the stochastic subsystem from the estimated states, eq. (28), with K from the Riccati equation.

    The extended observability matrix is Σ_ff^{+1/2} Û Σ̂^{1/2}: the exponent −1/2 printed in section 6.2 is a slip (the
    future is Γ x + …, and Σ_ff^{−1/2} Γ = Û Σ̂^{1/2}).
    """
    gamma = spectra.root @ (spectra.left_s[:, :order] * np.sqrt(spectra.correlations[:order]))
    x, targets = stochastic_states(spectra, factor, lq, layout, order)
    found = np.asarray(lstsq(x, targets).T, np.float64)
    return with_gain(found[:order], found[order:], gamma, x, targets)


def stochastic_states(
    spectra: Spectra, factor: WindowFactor, lq: Lq, layout: Layout, order: int
) -> tuple[Array, Array]:
    """Return states x_k (rows, n) and [x_{k+1}, w_k] (rows, n + l + m) in the coordinates of the factor, over √N.

    x = Σ̂^{1/2} V' Σ_pp^{−1/2} w past with Σ_pp^{1/2} = L33/√N, of the stochastic component; sums over rows are means
    over windows.
    """
    joint = len(layout.joint)
    half = np.sqrt(spectra.correlations[:order] * factor.windows)
    T = solve_triangular(lq.L33.T, spectra.right_s[:order].T, lower=False).T * half[:, None]
    past = slice(0, layout.past * joint)
    now = slice(layout.past * joint, (layout.past + 1) * joint)
    states, following = (stochastic_rows(factor, layout, lq, past, shift) @ T.T for shift in (0, 1))
    targets = np.hstack([following, stochastic_rows(factor, layout, lq, now, 0)])
    return states / np.sqrt(factor.windows), targets / np.sqrt(factor.windows)


def with_gain(A: Array, C: Array, gamma: Array, x: Array, targets: Array) -> Stochastic:
    """Return the stochastic subsystem of these A, C: K from the covariance of what they leave of the targets."""
    order = len(A)
    residual = targets - x @ np.vstack([A, C]).T
    covariance = residual.T @ residual
    Q, S, R = covariance[:order, :order], covariance[:order, order:], covariance[order:, order:]
    direct = np.asarray(np.linalg.solve(R, S.T).T, np.float64)
    K, innovation, method = kalman_gain(A, C, Q, S, R, direct)
    return Stochastic(A, C, K, innovation, gamma, method)
