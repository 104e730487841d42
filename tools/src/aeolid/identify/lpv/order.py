"""Choose the order of a scheduled model on the part of the recordings that was not used to fit it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import LpvData
from aeolid.identify.lpv.matrices import choose_gain, prediction_loss
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.order import FIT_PART, OrderChoice, largest_gap

Array = NDArray[np.float64]
TOLERANCE = 0.05  # a larger order must lower the held-out error power by more, per output: it costs m matrices
MOST_ORDERS = 20  # tried one after the other
HELD_OUT_LEAST = 20  # windows per channel that must be held out


def choose_lpv_order(
    data: LpvData, structure: Structure, solve: Callable[[LpvData], Estimate], whole: Estimate
) -> OrderChoice:
    """Choose the smallest order whose held-out one-step error is within 5 % per output of the best.

    The windows in the first 70 % of each recording are solved alone; for each order the predictor then runs over whole
    recordings and its errors in the rest are compared. Without enough windows the largest gap of the singular values
    decides.
    """
    values = whole.states.singular_values
    most = min(whole.states.X.shape[1], MOST_ORDERS)
    gap = largest_gap(values, most)
    ratio = values[gap - 1] / max(values[min(gap, len(values) - 1)], 1e-300)
    gap_text = f"the singular values fall most after {gap} (factor {ratio:.1f})"
    head = data.place < FIT_PART
    if (~head).sum() < HELD_OUT_LEAST * (structure.inputs + structure.outputs):
        return OrderChoice(gap, f"order {gap}: {gap_text}; too few samples to hold some out", ())
    fitted = data.take(head)
    try:
        part = solve(fitted)
    except NotIdentifiable:
        return OrderChoice(gap, f"order {gap}: {gap_text}; too few samples to hold some out", ())
    most = min(most, part.states.X.shape[1])
    losses = [
        prediction_loss(choose_gain(fitted, part.states.X[:, :n], structure)[0], data, ~head)
        for n in range(1, most + 1)
    ]
    best = int(np.argmin(losses))
    order = next(i for i, loss in enumerate(losses) if loss <= losses[best] + TOLERANCE) + 1
    reason = (
        f"order {order}: the smallest whose one-step error on the held-out last {1 - FIT_PART:.0%} "
        f"is within {TOLERANCE:.0%} per output of the best (order {best + 1} of 1 to {most}); {gap_text}"
    )
    return OrderChoice(order, reason, tuple(losses))
