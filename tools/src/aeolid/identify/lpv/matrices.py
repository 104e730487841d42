"""Fit the matrices of a scheduled model to an estimated state sequence: eq. (1) and (2) of paper 001."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import singular_values
from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import LpvData, feedthrough_columns, spread
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.subspace import least_squares
from aeolid.models.lpv import LpvStateSpace, apply_at
from aeolid.models.lpv_prediction import estimate_initial_state, predictor_states
from aeolid.models.model_file import Signal

Array = NDArray[np.float64]
RESOLVED = 1e-10  # of an output's power; below it a prediction is exact to what a kernel can resolve
CENTRED = 0.3  # standard deviations from zero up to which the scheduling of some windows counts as about its mean
LONGEST = 5000  # windows that choose between gains


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

    def unscaled(self) -> LpvStateSpace:
        """Return the same matrices as a model of signals without names, for the functions that predict."""
        m, n, r = self.B.shape
        signals = tuple(tuple(Signal("") for _ in range(count)) for count in (r, self.C.shape[1], n, m - 1))
        inputs, outputs, states, scheduling = signals
        return LpvStateSpace(
            self.A, self.B, self.C, self.D, self.K, self.b, np.zeros(n), None, 1.0, inputs, outputs, states, scheduling
        )


def fit_matrices(data: LpvData, X: Array, structure: Structure) -> ScaledLpv:
    """Solve the regressions of eq. (2) for C, D and e, and of eq. (1) for A, B, K with e as a regressor.

    X (N, n): states of the windows. With e_k in the regression A and B stay consistent when the inputs come from a
    feedback of y. Least squares with columns scaled first.
    """
    at, varies = data.targets, structure.varying
    n, r, outputs, m = X.shape[1], structure.inputs, structure.outputs, structure.parameters
    y, mu = data.y[at], data.mu[at]
    output_blocks = [_block(mu, X, "C" in varies), feedthrough_columns(data, structure, at)]
    if structure.constant:
        output_blocks.append(np.ones((len(at), 1)))
    rows = np.hstack(output_blocks)
    solution = least_squares(rows, y)
    e = y - rows @ solution.T
    width = output_blocks[0].shape[1]
    C = _stack(solution[:, :width], m, n)
    D = _feedthrough_matrices(solution[:, width : width + structure.feedthrough_width], structure)
    c = solution[:, -1] if structure.constant else np.zeros(outputs)
    now = np.flatnonzero(data.following)
    parts = [(X, "A" in varies), (data.u[at], "B" in varies), (e, "K" in varies)]
    blocks = [_block(mu[now], values[now], flag) for values, flag in parts]
    if structure.constant:
        blocks.append(mu[now])
    second = least_squares(np.hstack(blocks), X[now + 1])
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
        s = singular_values(rows / np.maximum(np.sqrt((rows**2).sum(axis=0)), 1e-300))
        rank = int(np.count_nonzero(s > 1e-9 * s[0]))
    else:
        rank = len(rows)
    if rank < needed:
        raise NotIdentifiable(
            f"{source}: not persistently exciting: states and inputs times the scheduling span {rank} of {needed} "
            f"directions over {len(rows)} transitions; vary scheduling and inputs independently, record longer, or "
            "lower the order"
        )


def choose_gain(data: LpvData, X: Array, structure: Structure) -> tuple[ScaledLpv, str]:
    """Return the matrices with the innovation gain that pays, and how it was found.

    K depends on the scheduling as the structure says, keeps its mean value, or is zero: what predicts best one step
    ahead, each of its numbers costing log N/2 in log-likelihood. A gain whose predictor is unstable along the
    recordings loses. A and B are those of the regression with e in any case.
    """
    fitted = fit_matrices(data, X, structure)
    mean = np.zeros_like(fitted.K)
    mean[0] = np.tensordot(mean_of(data), fitted.K, axes=1)
    none = (replace(fitted, K=np.zeros_like(mean)), "none: no gain predicts better", 0)
    candidates = [(fitted, "least squares", int(np.count_nonzero(fitted.K)))]
    if "K" in structure.varying:
        candidates.append((replace(fitted, K=mean), "least squares, its mean", mean[0].size))
    candidates.append(none)
    part = data.take(np.arange(data.windows) < LONGEST)
    costs = []
    for model, _, count in candidates:
        loss = prediction_loss(model, part)
        costs.append(part.windows * structure.outputs * loss + count * np.log(part.windows))
    model, method, _ = candidates[int(np.argmin(costs))]
    return model, method


def mean_of(data: LpvData) -> Array:
    """Return μ (m,) at the mean of the windows, exactly 0 beside the leading one where μ is taken about its mean."""
    mu = data.mu[data.targets]
    mean, spread = mu.mean(axis=0), mu.std(axis=0)
    return np.asarray(np.where(abs(mean) > CENTRED * spread, mean, 0.0))


def prediction_loss(
    model: ScaledLpv, data: LpvData, counted: NDArray[np.bool_] | None = None, *, joint: bool = False
) -> float:
    """Return the mean log error power per output of the predictor over the windows.

    The predictor runs over each stretch from its own estimated state; counted (N,): windows whose error counts, default
    all. joint: log det of the errors' covariance over l in place of the outputs' own powers, the likelihood of white
    Gaussian innovations. Powers below what a kernel resolves count alike; a predictor that diverges loses infinitely.
    """
    total, samples = np.zeros((model.C.shape[1], model.C.shape[1])), 0
    with np.errstate(all="ignore"):
        for place, *_, e in run_stretches(model, data):
            e = e if counted is None else e[counted[place]]
            total += e.T @ e
            samples += len(e)
    total /= max(samples, 1)
    if not np.isfinite(total).all():
        return float(np.inf)
    power = np.linalg.eigvalsh(total) if joint else total.diagonal()
    return float(np.mean(np.log(np.maximum(power, RESOLVED))))


def run_stretches(model: ScaledLpv, data: LpvData) -> Iterator[tuple[slice, Array, Array, Array, Array]]:
    """Yield place, μ, u, states and innovations of each stretch of the windows, from its estimated first state."""
    predictor = model.unscaled()
    edges = np.concatenate([[0], np.flatnonzero(~data.following) + 1, [data.windows]])
    for a, b in pairwise(edges):
        at = data.targets[a:b]
        mu, u, y = data.mu[at], data.u[at], data.y[at] - model.c
        x0 = estimate_initial_state(predictor, u, y, mu)
        states = predictor_states(predictor, u, y, mu, x0)[:-1]
        yield slice(a, b), mu, u, states, y - apply_at(model.C, mu, states) - apply_at(model.D, mu, u)


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
