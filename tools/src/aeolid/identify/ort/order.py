"""Choose the orders of the joint process and of the plant on data that were not used to fit them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.order import OrderChoice, largest_gap, smallest_sufficient
from aeolid.identify.ort.estimate import Loop
from aeolid.identify.ort.joint import Layout
from aeolid.identify.ort.plant import predictor_map
from aeolid.identify.ort.subsystems import Deterministic, Stochastic
from aeolid.identify.subspace import ScaledModel
from aeolid.models.recursion import run_states

Array = NDArray[np.float64]
LARGEST_JOINT = 30


def choose_joint_order(fitted: Loop, held_out: Sequence[Array], least: int) -> OrderChoice:
    """Choose the smallest order of both subsystems whose held-out one-step error is within 2 % a channel of the best.

    The prediction is that of inputs and outputs together: the deterministic subsystem's answer to the disturbance and
    the stochastic one's prediction of the rest. least: order of the plant where it was asked for; the joint order is at
    least that. Without held-out samples the largest fall of the canonical correlations decides.
    """
    most = min(fitted.most, LARGEST_JOINT)
    least = min(least, most)
    samples = sum(max(len(z) - fitted.layout.past, 0) for z in held_out)
    if samples < 20 * fitted.layout.block:
        gap = max(largest_gap(fitted.spectra.correlations, most), least)
        reason = f"joint order {gap}: the canonical correlations fall most there; too few samples to hold some out"
        return OrderChoice(gap, reason, ())
    losses = [
        joint_loss(*fitted.subsystems(order), held_out, fitted.layout) if order >= least else np.inf
        for order in range(1, most + 1)
    ]
    return smallest_sufficient(losses, what="joint order", of=" of inputs and outputs", each="channel")


def choose_plant_order(fitted: Loop, joint_order: int, held_out: Sequence[Array], response: str) -> OrderChoice:
    """Choose the smallest order of the plant, at most the joint one, by its held-out one-step error of the outputs."""
    joint = fitted.subsystems(joint_order)
    most = min(joint_order, fitted.most_plant)
    if sum(max(len(z) - fitted.factor.past, 0) for z in held_out) < 20 * fitted.layout.block:
        return OrderChoice(most, f"order {most}: that of the joint process; too few samples to hold some out", ())
    losses = [
        plant_loss(fitted.plant(joint, order, response)[0], held_out, fitted.factor.past)
        for order in range(1, most + 1)
    ]
    return smallest_sufficient(losses, of=" of the outputs")


def joint_loss(
    deterministic: Deterministic, stochastic: Stochastic, held_out: Sequence[Array], layout: Layout
) -> float:
    """Return the mean log error power of the joint process (l + m channels), p samples of run-in left out."""
    errors = []
    for z in held_out:
        r, w = z[:, list(layout.disturbances)], z[:, list(layout.joint)]
        with np.errstate(all="ignore"):  # an unstable subsystem loses by an infinite loss
            x = run_states(deterministic.A, r @ deterministic.B.T, np.zeros(len(deterministic.A)))[:-1]
            rest = w - x @ deterministic.C.T - r @ deterministic.D.T
            closed = stochastic.A - stochastic.K @ stochastic.C
            x = run_states(closed, rest @ stochastic.K.T, np.zeros(len(closed)))[:-1]
            errors.append((rest - x @ stochastic.C.T)[layout.past :])
    return log_power(errors)


def plant_loss(model: ScaledModel, held_out: Sequence[Array], samples: int) -> float:
    """Return the mean log error power of the outputs, each stretch started from its first `samples` samples."""
    T, inputs, errors = predictor_map(model, samples), model.B.shape[1], []
    for z in held_out:
        if len(z) <= samples:
            continue
        u, y = z[samples:, :inputs], z[samples:, inputs:]
        forced = u @ (model.B - model.K @ model.D).T + y @ model.K.T
        with np.errstate(all="ignore"):
            x = run_states(model.A - model.K @ model.C, forced, T @ z[:samples].ravel())[:-1]
            errors.append(y - x @ model.C.T - u @ model.D.T)
    return log_power(errors)


def log_power(errors: Sequence[Array]) -> float:
    """Return the mean over channels of the log of the error variance, infinite where an error diverges."""
    with np.errstate(all="ignore"):
        power = np.concatenate([e - e.mean(axis=0) for e in errors if len(e)])
        mean = np.mean(power**2, axis=0)
    mean = np.where(np.isfinite(mean), mean, np.inf)
    return float(np.mean(np.log(np.maximum(mean, 1e-30))))
