"""Fit the matrices of a scheduled model to an estimated state sequence: eq. (1) and (2) of paper 001."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import LpvData, feedthrough_columns, spread
from aeolid.identify.lpv.structure import Structure

Array = NDArray[np.float64]
EXACT = 1e-20  # innovation power below this fraction of an output's power is rounding: no gain can be found from it


@dataclass(frozen=True, eq=False)
class ScaledLpv:
    """Hold A (m, n, n), B (m, n, r), C (m, l, n), D (m, l, r), K (m, n, l), b (m, n) and c (l,) in scaled units.

    Entries after the first are zero for a matrix that does not depend on the scheduling.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    K: Array
    b: Array
    c: Array


def fit_matrices(data: LpvData, X: Array, structure: Structure) -> ScaledLpv:
    """Solve the regressions of eq. (2) for C, D and e, and of eq. (1) for A, B, K with e as a regressor.

    X (N, n): states of the windows. With e_k in the regression A and B stay consistent when the inputs come from a
    feedback of y. Least squares with columns scaled first; e at rounding level gives K = 0.
    """
    at, varies = data.targets, structure.varying
    n, r, outputs, m = X.shape[1], structure.inputs, structure.outputs, structure.parameters
    y, mu = data.y[at], data.mu[at]
    output_blocks = [_block(mu, X, "C" in varies), feedthrough_columns(data, structure, at)]
    if structure.constant:
        output_blocks.append(np.ones((len(at), 1)))
    rows = np.hstack(output_blocks)
    solution = _least_squares(rows, y)
    e = y - rows @ solution.T
    width = output_blocks[0].shape[1]
    C = _stack(solution[:, :width], m, n)
    D = _feedthrough_matrices(solution[:, width : width + structure.feedthrough_width], structure)
    c = solution[:, -1] if structure.constant else np.zeros(outputs)
    now = np.flatnonzero(data.following)
    if (e**2).sum() <= EXACT * (y**2).sum():
        e = np.zeros_like(e)
    parts = [(X, "A" in varies), (data.u[at], "B" in varies), (e, "K" in varies)]
    blocks = [_block(mu[now], values[now], flag) for values, flag in parts]
    if structure.constant:
        blocks.append(mu[now])
    second = _least_squares(np.hstack(blocks), X[now + 1])
    edges = np.cumsum([0, *(b.shape[1] for b in blocks)])
    A, B, K = (_stack(second[:, edges[i] : edges[i + 1]], m, w) for i, w in enumerate((n, r, outputs)))
    b = second[:, edges[3] :].T if structure.constant else np.zeros((m, n))
    return ScaledLpv(A, B, C, D, K, b, c)


def require_distinct(data: LpvData, X: Array, structure: Structure, source: str) -> None:
    """Refuse states and inputs that, times the scheduling, do not span what the matrices act on."""
    now, mu = np.flatnonzero(data.following), data.mu[data.targets]
    u, varies = data.u[data.targets], structure.varying
    rows = np.hstack([_block(mu[now], X[now], "A" in varies), _block(mu[now], u[now], "B" in varies)])
    needed = rows.shape[1]
    if len(rows) > needed:
        s = np.linalg.svd(rows / np.maximum(np.sqrt((rows**2).sum(axis=0)), 1e-300), compute_uv=False)
        rank = int(np.count_nonzero(s > 1e-9 * s[0]))
    else:
        rank = len(rows)
    if rank < needed:
        raise NotIdentifiable(
            f"{source}: not persistently exciting: states and inputs times the scheduling span {rank} of {needed} "
            f"directions over {len(rows)} transitions; vary scheduling and inputs independently, record longer, or "
            "lower the order"
        )


def run_predictor(model: ScaledLpv, u: Array, y: Array, mu: Array, x0: Array) -> Array:
    """Return the innovations (N, l) of the predictor started at x0, all scaled."""
    A, B, C, D, K = (at_each(matrix, mu) for matrix in (model.A, model.B, model.C, model.D, model.K))
    forced = np.einsum("kij,kj->ki", B, u) + mu @ model.b
    direct = y - np.einsum("kij,kj->ki", D, u) - model.c
    e, x = np.empty_like(y), x0
    for k in range(len(y)):
        e[k] = direct[k] - C[k] @ x
        x = A[k] @ x + forced[k] + K[k] @ e[k]
    return e


def at_each(matrices: Array, mu: Array) -> Array:
    """Return Σ_i μ_k⁽ⁱ⁾ M⁽ⁱ⁾ for each sample: (m, a, b) and (N, m) to (N, a, b)."""
    out: Array = np.tensordot(mu, matrices, axes=1)
    return out


def _block(mu: Array, values: Array, varies: bool) -> Array:
    return spread(mu, values) if varies else values


def _stack(flat: Array, m: int, width: int) -> Array:
    """Return a solution (a, m w) or (a, w) as (m, a, w), zero after the first where it does not depend on μ."""
    rows = flat.shape[0]
    out = np.zeros((m, rows, width))
    count = flat.shape[1] // width if width else 0
    for i in range(count):
        out[i] = flat[:, i * width : (i + 1) * width]
    return out


def _feedthrough_matrices(flat: Array, structure: Structure) -> Array:
    through = np.flatnonzero(structure.feedthrough)
    out = np.zeros((structure.parameters, structure.outputs, structure.inputs))
    out[:, :, through] = _stack(flat, structure.parameters, len(through))
    return out


def _least_squares(regressors: Array, targets: Array) -> Array:
    """Return X with targets ≈ regressors Xᵀ; columns are scaled first, so that rcond means rank, not units."""
    norm = np.sqrt((regressors**2).sum(axis=0))
    norm = np.where(norm > 0, norm, 1.0)
    solution = np.linalg.lstsq(regressors / norm, targets, rcond=1e-11)[0]
    X: Array = solution.T / norm
    return X
