"""Choose the order of a scheduled model on the part of the recordings that was not used to fit it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import LpvData
from aeolid.identify.lpv.matrices import ScaledLpv, fit_matrices, run_predictor
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.order import FIT_PART, TOLERANCE, OrderChoice, largest_gap

Array = NDArray[np.float64]
MOST_ORDERS = 20  # tried one after the other
EXACT = 1e-10  # of an output's power; below it a prediction is exact to what a kernel can resolve
HELD_OUT_LEAST = 20  # windows per channel that must be held out


def choose_lpv_order(
    data: LpvData, structure: Structure, solve: Callable[[LpvData], Estimate], whole: Estimate
) -> OrderChoice:
    """Choose the smallest order whose held-out one-step error is within 2 % per output of the best.

    The first 70 % of the windows are solved alone. For each order its model predicts the held-out samples, started
    from a state estimated on the first of them. Without enough windows the largest gap of the singular values decides.
    """
    values = whole.states.singular_values
    most = min(whole.states.X.shape[1], MOST_ORDERS)
    gap = largest_gap(values, most)
    ratio = values[gap - 1] / max(values[min(gap, len(values) - 1)], 1e-300)
    gap_text = f"the singular values fall most after {gap} (factor {ratio:.1f})"
    cut = round(FIT_PART * data.windows)
    head, tail = np.arange(data.windows) < cut, np.arange(data.windows) >= cut
    if tail.sum() < HELD_OUT_LEAST * (structure.inputs + structure.outputs):
        return OrderChoice(gap, f"order {gap}: {gap_text}; too few samples to hold some out", ())
    fitted, held_out = data.take(head), data.take(tail)
    try:
        part = solve(fitted)
    except NotIdentifiable:
        return OrderChoice(gap, f"order {gap}: {gap_text}; too few samples to hold some out", ())
    most = min(most, part.states.X.shape[1])
    losses = [
        held_out_loss(fit_matrices(fitted, part.states.X[:, :n], structure), held_out) for n in range(1, most + 1)
    ]
    best = int(np.argmin(losses))
    order = next(i for i, loss in enumerate(losses) if loss <= losses[best] + TOLERANCE) + 1
    reason = (
        f"order {order}: the smallest whose one-step error on the held-out last {1 - FIT_PART:.0%} "
        f"is within {TOLERANCE:.0%} per output of the best (order {best + 1} of 1 to {most}); {gap_text}"
    )
    return OrderChoice(order, reason, tuple(losses))


def held_out_loss(model: ScaledLpv, data: LpvData) -> float:
    """Return the mean log error power per output of the predictor over the stretches of the windows."""
    power, samples = np.zeros(model.C.shape[1]), 0
    edges = np.concatenate([[0], np.flatnonzero(~data.following) + 1, [data.windows]])
    for a, b in pairwise(edges):
        at = data.targets[a:b]
        with np.errstate(all="ignore"):  # a predictor that diverges loses by an infinite loss
            e = run_predictor(model, data.u[at], data.y[at], data.mu[at], np.zeros(model.A.shape[1]))
            settled = e[min(data.past, len(e) // 2) :]  # the start from zero is not at stake
            power += (settled**2).sum(axis=0)
        samples += len(settled)
    mean = np.where(np.isfinite(power), power / max(samples, 1), np.inf)
    return float(np.mean(np.log(np.maximum(mean, EXACT))))
