"""Predict and simulate with a state-space model, and measure how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.models.gap_gains import GapGains
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
BRIDGED = 10  # samples in a row that an output may be missing before the predictor starts anew


def gain(model: StateSpace) -> Array:
    """Return K (n, l), zero where the model has no noise model."""
    return np.zeros((model.order, len(model.outputs))) if model.K is None else model.K


def predictor_states(model: StateSpace, u: Array, y: Array, x0: Array) -> Array:
    """Return the states x_0 … x_N of the predictor x⁺ = (A − K C) x + (B − K D) u + K y, paper 000 eq. (6).

    u (N, r), y (N, l) deviations from the operating point; returns (N + 1, n). Around missing y the gain is that of
    `gap_gains`.
    """
    A, C, K = model.A, model.C, gain(model)
    known: Flags = np.isfinite(y)
    driven, direct = u @ model.B.T, np.where(known, y, 0.0) - u @ model.D.T
    closed, forced = A - K @ C, driven + direct @ K.T
    states, start = np.empty((len(u) + 1, model.order)), 0
    states[0] = x0
    for rows, gains in GapGains(model.innovation_covariance, model.order).of(A, C, K, known):
        for k, G in zip(rows, gains, strict=True):
            if k > start:
                states[start : k + 1] = run_states(closed, forced[start:k], states[start])
            states[k + 1] = A @ states[k] + driven[k] + G @ (direct[k] - C @ states[k])
            start = k + 1
    states[start:] = run_states(closed, forced[start:], states[start])
    return states


def estimate_initial_state(model: StateSpace, u: Array, y: Array) -> Array:
    """Estimate x_0 (n,) from the start of a recording by least squares on the innovations.

    e_k(x_0) = e_k(0) − C (A − K C)^k x_0 over k < max(20 n, 200): the maximum-likelihood start under the model's own
    noise model (output error where it has none). u (N, r), y (N, l): deviations; missing y are left out.
    """
    horizon, weight = min(len(u), max(20 * model.order, 200)), channel_weights(y)
    u, y = u[:horizon], y[:horizon]
    known: Flags = np.isfinite(y)
    with np.errstate(all="ignore"):  # an unstable predictor overflows: those samples are left out
        states = predictor_states(model, u, y, np.zeros(model.order))[:-1]
        innovation = np.where(known, y, 0.0) - states @ model.C.T - u @ model.D.T  # (N, l)
    gains = GapGains(model.innovation_covariance, model.order).around(model.A, model.C, gain(model), known)
    rows = np.empty((horizon, len(model.outputs), model.order))
    block, power = model.C * weight[:, None], np.eye(model.order)
    with np.errstate(all="ignore"):
        for k in range(horizon):
            rows[k] = block @ power
            power = (model.A - gains[k] @ model.C) @ power
        good = np.asarray(np.isfinite(rows).all(axis=(1, 2)) & np.isfinite(innovation).all(axis=1))
    if not good.all() and model.K is not None:  # of an unstable predictor: the rows left say nothing of the start
        return estimate_initial_state(replace(model, K=None), u, y)
    used = known & good[:, None]
    x0 = lstsq(rows[used], (innovation * weight)[used], rcond=1e-10)
    return np.asarray(x0, dtype=np.float64)


def channel_weights(y: Array) -> Array:
    """Return one over the standard deviation of each channel of y (N, l), (l,): 0 where it stands still.

    Each channel is held against its own size: the weights of all units are alike. Missing samples are left out.
    """
    known: Flags = np.isfinite(y)
    spread = np.array([y[k, j].std() if k.any() else 0.0 for j, k in enumerate(known.T)])
    moves = spread > 1e-12 * np.where(known, abs(y), 0.0).max(axis=0, initial=0.0)
    out: Array = np.where(moves, 1.0 / np.where(moves, spread, 1.0), 0.0)
    return out


def predict(model: StateSpace, u: Array, y: Array, steps: int = 1, x0: Array | None = None) -> Array:
    """Predict y_k from data up to sample k − steps (and the inputs in between); returns (N, l).

    u (N, r), y (N, l) in the channels' units, y not a number where missing; steps ≥ 1. The first steps − 1 rows are
    predictions from x_0. x0: state at sample 0, default estimated.
    """
    return predict_ahead(model, u, y, (steps,), x0)[0]


def predict_ahead(
    model: StateSpace, u: Array, y: Array, horizons: Sequence[int], x0: Array | None = None
) -> list[Array]:
    """Return what `predict` returns for each of the horizons; the predictor runs once for all."""
    du, dy = u - model.u_offset, y - model.y_offset
    start = estimate_initial_state(model, du, dy) if x0 is None else x0
    states = predictor_states(model, du, dy, start)[:-1]  # row k: x given data up to k − 1
    direct, found = du @ model.D.T + model.y_offset, {1: states}
    for steps in range(2, min(max(horizons), len(u)) + 1):
        later = states[:-1] @ model.A.T + du[:-1] @ model.B.T
        states = np.vstack([states[:1], later])  # the first row has no older start: rows younger than that run free
        if steps in horizons:
            found[steps] = states
    return [found.get(steps, states) @ model.C.T + direct for steps in horizons]


def free_run(model: StateSpace, u: Array, x0: Array) -> Array:
    """Simulate from x_0 on the inputs alone; u (N, r) in the channels' units, returns (N, l) in theirs."""
    du = u - model.u_offset
    states = run_states(model.A, du @ model.B.T, x0)[:-1]
    out: Array = states @ model.C.T + du @ model.D.T + model.y_offset
    return out


def vaf(y: Array, estimate: Array) -> Array:
    """Return 100 (1 − var(y − ŷ)/var(y)) in percent, (l,), missing samples of y left out; may be below 0.

    NaN for an estimate that is lost, be it at one sample: what is left of it would look good.
    """
    with np.errstate(all="ignore"):
        ratio = np.nanvar(y - estimate, axis=0) / np.nanvar(y, axis=0)
    out: Array = np.where(_lost(y, estimate), np.nan, 100.0 * (1.0 - ratio))
    return out


def nrmse(y: Array, estimate: Array) -> Array:
    """Return rms(y − ŷ)/std(y), (l,): 0 is exact, 1 as good as the mean; missing samples of y left out.

    NaN for an estimate that is lost, as in `vaf`.
    """
    with np.errstate(all="ignore"):
        ratio = np.sqrt(np.nanmean((y - estimate) ** 2, axis=0)) / np.nanstd(y, axis=0)
    out: Array = np.where(_lost(y, estimate), np.nan, ratio)
    return out


def _lost(y: Array, estimate: Array) -> NDArray[np.bool_]:
    """Tell of which outputs (l,) an estimate is no number at a sample that was recorded."""
    return np.asarray((np.isfinite(y) & ~np.isfinite(estimate)).any(axis=0))


def complete_stretches(values: Array, shortest: int) -> list[tuple[int, int]]:
    """List [start, stop) of the runs of at least `shortest` samples without a missing value; values (N, channels)."""
    good = np.isfinite(values).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    runs = zip(edges[::2], edges[1::2], strict=True)
    return [(int(a), int(b)) for a, b in runs if b - a >= shortest]


def bridged_stretches(driven: Array, y: Array, shortest: int) -> list[tuple[int, int]]:
    """List [start, stop) of the runs that a predictor goes through from one start, over short gaps of the outputs.

    driven (N, ·): what drives the model, never missing in a run; y (N, l): none missing for more than BRIDGED samples
    in a row. A run begins and ends with a complete sample, and has at least `shortest` of them.
    """
    known: Flags = np.isfinite(y)
    broken = ~np.isfinite(driven).all(axis=1)
    for column in known.T:
        broken |= _long_runs(~column, BRIDGED)
    complete = np.asarray(known.all(axis=1) & ~broken)
    out = []
    for start, stop in complete_stretches(np.where(broken, np.nan, 0.0)[:, None], shortest):
        at = start + np.flatnonzero(complete[start:stop])
        if len(at) >= shortest:
            out.append((int(at[0]), int(at[-1]) + 1))
    return out


def _long_runs(bad: Flags, most: int) -> Flags:
    """Mark the runs of more than `most` bad samples in a row; bad (N,)."""
    out = np.zeros_like(bad)
    for start, stop in complete_stretches(np.where(bad, 0.0, np.nan)[:, None], most + 1):
        out[start:stop] = True
    return out
