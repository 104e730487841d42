"""Join the two subsystems to the plant and reduce it: paper 002 section 5, Theorem 5, and what it leaves open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from aeolid.decompositions import lstsq, svd
from aeolid.identify.ort.joint import Layout, Lq
from aeolid.identify.ort.subsystems import Deterministic, Stochastic, solve_toeplitz
from aeolid.identify.subspace import (
    ScaledModel,
    StateBasis,
    largest_useful_order,
    spectral_radius,
    system_matrices,
)
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]


def connect(deterministic: Deterministic, stochastic: Stochastic) -> Array:
    """Return T = Γ_s^† Γ_d (n_s, n_d), which brings the deterministic states to the stochastic ones, Lemma 4."""
    T: Array = np.asarray(lstsq(stochastic.gamma, deterministic.gamma), np.float64)
    return T


def join(deterministic: Deterministic, stochastic: Stochastic, layout: Layout) -> ScaledModel:
    """Return the plant of Theorem 5, eq. (19), with the inputs in the order of a block.

    x⁺ = (A_s − K_s2 C_s2) x + K_s2 u + (T B_d − K_s2 D_d2) r + K_s1 v, y = C_s1 x + D_d1 r + v, x = x_s + T x_d.
    """
    l = len(layout.outputs)  # noqa: E741
    K1, K2 = stochastic.K[:, :l], stochastic.K[:, l:]
    A = stochastic.A - K2 @ stochastic.C[l:]
    B = np.zeros((len(A), len(layout.controls) + len(layout.disturbances)))
    B[:, list(layout.controls)] = K2
    B[:, list(layout.disturbances)] = connect(deterministic, stochastic) @ deterministic.B - K2 @ deterministic.D[l:]
    D = np.zeros((l, B.shape[1]))
    D[:, list(layout.disturbances)] = deterministic.D[:l]
    return ScaledModel(A, B, stochastic.C[:l], D, K1, stochastic.covariance[:l, :l], stochastic.gain_method)


def predictor_map(model: ScaledModel, samples: int) -> Array:
    """Return (n, samples · m) what turns the samples before k, oldest first, into the state x_k of the predictor.

    x_k = Σ_i (A − K C)^{i−1} [B − K D, K] z_{k−i}; what lies further back has faded.
    """
    blocks = [np.hstack([model.B - model.K @ model.D, model.K])]
    closed = model.A - model.K @ model.C
    for _ in range(samples - 1):
        blocks.append(closed @ blocks[-1])
    out: Array = np.hstack(blocks[::-1])
    return out


def reduce(model: ScaledModel, factor: WindowFactor, order: int) -> tuple[ScaledModel, Array]:
    """Reduce the plant to `order` states; also returns the values (n,) that tell how much each state matters.

    The joint process has the states of plant and controller; those of the controller are not seen from y once u is
    given. Truncated is the predictor x⁺ = (A − K C) x + (B − K D)[u; r] + K y in the coordinates in which its
    observability Gramian Q and the covariance P of its states on these very data are equal and diagonal: the values are
    the roots of the eigenvalues of P Q. Since Q solves the Lyapunov equation of A − K C and is diagonal, A − K C stays
    stable, which the truncation of an impulse response does not promise.
    """
    samples = factor.past
    states = factor.R[:, : samples * factor.channels] @ predictor_map(model, samples).T / np.sqrt(factor.windows)
    closed = model.A - model.K @ model.C
    if spectral_radius(closed) < 1:
        Q = solve_discrete_lyapunov(closed.T, model.C.T @ model.C)
    else:
        Q = _finite_gramian(closed, model.C, 4 * samples)
    values, vectors = np.linalg.eigh((Q + Q.T) / 2)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T  # Q = root' root
    # with X the states, X root' = V diag(σ) W': in coordinates σ^{−1/2} W' root x both Gramians are diag(σ)
    V, size, Wt = svd(states @ root.T)
    keep = np.sqrt(np.maximum(size[:order], 1e-15 * size[0]))
    into = (Wt[:order] @ root) / keep[:, None]
    out = (states.T @ V[:, :order]) / keep  # into @ out = I
    K, C = into @ model.K, model.C @ out
    return replace(model, A=into @ closed @ out + K @ C, B=into @ model.B, C=C, K=K), size


def with_better_gain(model: ScaledModel, basis: StateBasis, factor: WindowFactor, layout: Layout) -> ScaledModel:
    """Return the plant with the K of PBSIDopt over the whole window of p + f samples, where that predicts better.

    The stochastic component is what r of the window leaves: what r did before it is still in there, so that K comes out
    too large while the loop remembers more than p samples (the paper's example at k = 21 and without sampling error:
    C K = 0.242 for 0.070). PBSIDopt of the same windows with r as an input has no such remainder; its noise response
    C A^i K, brought to the states of this plant by least squares, gives K alone. Poles and responses stay.

    basis: singular value decomposition of PBSIDopt. K stays where A − K C would not be stable.
    """
    if largest_useful_order(basis) < len(model.A):
        return model
    rival = system_matrices(factor, basis.state_map(len(model.A)), layout.block_through)
    own, other = (observability(m, layout.future) for m in (model, rival))
    K: Array = np.asarray(lstsq(own, other @ rival.K), np.float64)
    better = replace(model, K=K, gain_method="PBSIDopt of past and future window")
    if spectral_radius(model.A - K @ model.C) >= 1 or not np.isfinite(K).all():
        return model
    left = [prediction_error(m, factor) for m in (model, better)]
    return better if np.log(np.diag(left[1])).sum() < np.log(np.diag(left[0])).sum() else model


def prediction_error(model: ScaledModel, factor: WindowFactor) -> Array:
    """Return the covariance (l, l) of the one-step error over the windows, predicted from all but the last sample."""
    width = factor.past * factor.channels
    x = factor.R[:, :width] @ predictor_map(model, factor.past).T
    e = factor.y_now - x @ model.C.T - factor.u_now @ model.D.T
    out: Array = e.T @ e / factor.windows
    return out


def observability(model: ScaledModel, samples: int) -> Array:
    """Return [C; C A; …] of this many samples."""
    rows = [model.C]
    for _ in range(samples - 1):
        rows.append(rows[-1] @ model.A)
    return np.vstack(rows)


def _finite_gramian(A: Array, C: Array, samples: int) -> Array:
    Q = np.zeros_like(A)
    row = C
    for _ in range(samples):
        Q = Q + row.T @ row
        row = row @ A
    return Q


def fit_response(model: ScaledModel, lq: Lq, layout: Layout) -> ScaledModel:
    """Fit B and D of the disturbances again, given A, B of u and C: eq. (7a), y_d = P_u u_d + P_r r.

    The same equation as (26) for the plant alone, Γ' the annihilator of its extended observability matrix:
    Γ'(L41 of y − Ψ(B_u) L41 of u) = Γ' Ψ(B_r, D_r) L11. Noise in y_d that the loop passes on to u_d cancels, and the
    controller's states, feedforward included, drop out.
    """
    f, l = layout.future, len(layout.outputs)  # noqa: E741
    gamma = observability(model, f)
    basis = np.linalg.qr(gamma, mode="complete")[0][:, len(model.A) :]
    rows = lq.L41.reshape(f, len(layout.joint), -1)
    y_rows, u_rows = rows[:, :l], rows[:, l:]
    forced = np.zeros_like(y_rows)
    x = np.zeros((len(model.A), rows.shape[2]))
    for i in range(f):  # the plant run on the rows of u
        forced[i] = model.C @ x
        x = model.A @ x + model.B[:, list(layout.controls)] @ u_rows[i]
    free = np.tile(np.array(layout.through), (l, 1))
    D, B = solve_toeplitz(basis, gamma, (y_rows - forced).reshape(f * l, -1), lq.L11, free)
    new_B, new_D = model.B.copy(), model.D.copy()
    new_B[:, list(layout.disturbances)], new_D[:, list(layout.disturbances)] = B, D
    return replace(model, B=new_B, D=new_D)
