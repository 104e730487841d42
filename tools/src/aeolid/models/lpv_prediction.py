"""Predict with a scheduled state-space model, estimate its first state, and run it on recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.errors import DataError
from aeolid.models.gap_gains import GapGains
from aeolid.models.load import matched, require_sample_time
from aeolid.models.lpv import LpvStateSpace, apply_at, run_scheduled, with_one
from aeolid.models.model_file import Signal
from aeolid.models.prediction import bridged_stretches, channel_weights, complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
LARGEST = 1e100  # of an unstable predictor; beyond it least squares lose their footing


def predictor_states(model: LpvStateSpace, u: Array, y: Array, mu: Array, x0: Array) -> Array:
    """Return the states x_0 … x_N of the predictor, eq. (3): (N + 1, n).

    u (N, r), y (N, l) deviations from the operating point; mu (N, m) with the leading one. Around missing y the gain is
    that of `gap_gains`, with the matrices of each sample; K of those that are there where the model has no covariance.
    """
    forced = apply_at(model.B, mu, u) + mu @ model.b
    if model.K is None:
        return run_scheduled(model.A, mu, forced, x0)
    known: Flags = np.isfinite(y)
    direct = np.where(known, y, 0.0) - apply_at(model.D, mu, u)
    states = np.empty((len(u) + 1, model.order))
    states[0] = x0
    step, gaps = 1 << 14, GapGains(model.innovation_covariance, model.order)
    for start in range(0, len(u), step):
        part = slice(start, start + step)
        A, C, K = (np.tensordot(mu[part], matrix, axes=1) for matrix in (model.A, model.C, model.K))
        K = gaps.around(A, C, K, known[part])
        transition = A - K @ C
        pushed = forced[part] + np.einsum("kij,kj->ki", K, direct[part])
        for k, matrix in enumerate(transition):
            states[start + k + 1] = matrix @ states[start + k] + pushed[k]
    return states


def estimate_initial_state(model: LpvStateSpace, u: Array, y: Array, mu: Array) -> Array:
    """Estimate x_0 (n,) from the start of a recording by least squares on the innovations.

    e_k(x_0) = e_k(0) − C φ_k x_0 over k < max(20 n, 200), φ_k the product of the predictor's transitions. u, y:
    deviations; missing y are left out.
    """
    horizon, weight = min(len(u), max(20 * model.order, 200)), channel_weights(y)
    u, y, mu = u[:horizon], y[:horizon], mu[:horizon]
    states = predictor_states(model, u, y, mu, np.zeros(model.order))[:-1]
    known: Flags = np.isfinite(y)
    innovation = np.where(known, y, 0.0) - apply_at(model.C, mu, states) - apply_at(model.D, mu, u)  # (N, l)
    A, C = (np.tensordot(mu, matrix, axes=1) for matrix in (model.A, model.C))
    transition = A
    if model.K is not None:
        gaps = GapGains(model.innovation_covariance, model.order)
        transition = A - gaps.around(A, C, np.tensordot(mu, model.K, axes=1), known) @ C
    rows, product = np.empty((horizon, y.shape[1], model.order)), np.eye(model.order)
    for k in range(horizon):
        rows[k] = C[k] @ product * weight[:, None]
        product = transition[k] @ product
    good = np.asarray((abs(rows) < LARGEST).all(axis=(1, 2)) & (abs(innovation) < LARGEST).all(axis=1))
    used = known & good[:, None]
    x0 = lstsq(rows[used], (innovation * weight)[used], rcond=1e-10)
    return np.asarray(x0, dtype=np.float64)


def predict(model: LpvStateSpace, u: Array, y: Array, scheduling: Array, steps: int, x0: Array) -> Array:
    """Predict y_k from data up to sample k − steps, and the inputs and scheduling in between; returns (N, l).

    u, y, scheduling in the channels' units; steps ≥ 1. The first steps − 1 rows run free from x_0.
    """
    du, dy, mu = u - model.u_offset, y - model.y_offset, with_one(scheduling)
    states = predictor_states(model, du, dy, mu, x0)[:-1]  # row k: x given data up to k − 1
    forced = apply_at(model.B, mu, du) + mu @ model.b
    for _ in range(min(steps - 1, len(u) - 1)):  # the first row has no older start: rows younger than that run free
        states = np.vstack([states[:1], apply_at(model.A, mu[:-1], states[:-1]) + forced[:-1]])
    out: Array = apply_at(model.C, mu, states) + apply_at(model.D, mu, du) + model.y_offset
    return out


def lpv_stretches(model: LpvStateSpace, record: Record, shortest: int) -> Iterator[tuple[Array, Array, Array]]:
    """Yield u (N, r), y (N, l), scheduling (N, m − 1) of each stretch, in the channels' units.

    Gaps of outputs are bridged as in `bridged_stretches`; y is not a number there. Raises DataError on another sample
    time, a missing channel or another unit.
    """
    u, y, s = (matched(record, signals) for signals in (model.inputs, model.outputs, model.scheduling))
    require_sample_time(model, record)
    for start, stop in bridged_stretches(np.hstack([u, s]), y, shortest):
        yield u[start:stop], y[start:stop], s[start:stop]


@dataclass(frozen=True, eq=False)
class LpvModel:
    """Run a scheduled model on recordings; initial is "estimate", "model" (x0 of the file) or "zero"."""

    state_space: LpvStateSpace
    initial: str = "estimate"

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Return the inputs."""
        return self.state_space.inputs

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Return the outputs."""
        return self.state_space.outputs

    def simulate(self, record: Record) -> Array:
        """Run free on the recorded inputs and scheduling; where the outputs are recorded, x_0 is estimated."""
        model = self.state_space
        require_sample_time(model, record)
        known = matched(record, (*model.inputs, *model.scheduling))
        bad = np.argwhere(~np.isfinite(known))
        if len(bad):
            sample, column = bad[0]
            name = (*model.inputs, *model.scheduling)[column].name
            raise DataError(
                f"{record.source}: {name!r} is missing at sample {sample + 1}; a free run needs every sample of the "
                "inputs and the scheduling, cut the recording or fill it"
            )
        u, s = known[:, : len(model.inputs)], known[:, len(model.inputs) :]
        with np.errstate(all="ignore"):  # an unstable model may overflow; the caller sees what is not finite
            return model.simulate(u, s, self._start(record, u, s))

    def _start(self, record: Record, u: Array, s: Array) -> Array:
        model, names = self.state_space, {c.name for c in record.channels}
        if self.initial == "zero":
            return np.zeros(model.order)
        if self.initial == "model" or not all(o.name in names for o in model.outputs):
            return model.x0
        y = matched(record, model.outputs)
        runs = complete_stretches(y, max(2 * model.order, 10))
        if not runs or runs[0][0] != 0:
            return model.x0  # nothing recorded at the start to estimate from
        stop = runs[0][1]
        return estimate_initial_state(model, u[:stop] - model.u_offset, y[:stop] - model.y_offset, with_one(s[:stop]))
