"""Choose the order of a scheduled model on the part of the recordings that was not used to fit it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.lpv.data import LpvData
from aeolid.identify.lpv.matrices import choose_gain, prediction_loss
from aeolid.identify.lpv.refine import Trial, shortened, try_steps
from aeolid.identify.lpv.states import Estimate
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.order import OrderChoice, by_gap_alone, say_gap, smallest_sufficient
from aeolid.identify.split import FIT_PART

Array = NDArray[np.float64]
TOLERANCE = 0.05  # a larger order must lower the held-out error power by more, per output: it costs m matrices
MOST_ORDERS = 20  # tried one after the other
HELD_OUT_LEAST = 20  # windows per channel that must be held out


@dataclass(frozen=True, eq=False)
class Head:
    """Hold the windows in the first 70 % of each recording and what they alone were solved to."""

    data: LpvData
    estimate: Estimate


def solve_head(data: LpvData, structure: Structure, solve: Callable[[LpvData], Estimate]) -> Head | None:
    """Solve the first 70 % of each recording alone; None where too little is left on either side."""
    head = data.place < FIT_PART
    if (~head).sum() < HELD_OUT_LEAST * (structure.inputs + structure.outputs):
        return None
    try:
        return Head(data.take(head), solve(data.take(head)))
    except NotIdentifiable:
        return None


def unseen_loss(data: LpvData, structure: Structure, fitted: Head, order: int | None) -> float:
    """Return the log error power, on windows it has not seen, of a fitted model of an order, of the best where None.

    A model fitted to all windows is judged on all of them. Infinite where it shows fewer states than asked for.
    """
    X, whole = fitted.estimate.states.X, fitted.data.windows == data.windows
    held_out = None if whole else data.place >= FIT_PART
    orders = range(1, min(X.shape[1], MOST_ORDERS) + 1) if order is None else [order]
    losses = [
        prediction_loss(choose_gain(fitted.data, X[:, :n], structure)[0], data, held_out)
        for n in orders
        if n <= X.shape[1]
    ]
    return min(losses, default=float(np.inf))


def choose_lpv_order(data: LpvData, structure: Structure, head: Head | None, whole: Estimate) -> OrderChoice:
    """Choose the smallest order whose held-out one-step error is within 5 % per output of the best.

    For each order the model of the head alone predicts whole recordings, and its errors in the rest are compared.
    Without a head the largest gap of the singular values decides.
    """
    values = whole.states.singular_values
    most = min(whole.states.X.shape[1], MOST_ORDERS)
    gap, gap_text = say_gap(values, most)
    if head is None or not head.estimate.states.X.shape[1]:
        return by_gap_alone(gap, gap_text)
    X, held_out = head.estimate.states.X, data.place >= FIT_PART
    most = min(most, X.shape[1])
    losses = [
        prediction_loss(choose_gain(head.data, X[:, :n], structure)[0], data, held_out) for n in range(1, most + 1)
    ]
    return smallest_sufficient(losses, tolerance=TOLERANCE, tail=f"; {gap_text}")


def head_trial(data: LpvData, structure: Structure, head: Head | None, order: int) -> Trial | None:
    """Take the prediction-error steps from the head's model of an order; None where it shows fewer states."""
    if head is None or head.estimate.states.X.shape[1] < order:
        return None
    model = choose_gain(head.data, head.estimate.states.X[:, :order], structure)[0]
    return try_steps(data.take(shortened(data)), structure, model)


def step_down(
    data: LpvData, structure: Structure, head: Head | None, choice: OrderChoice
) -> tuple[OrderChoice, Trial | None]:
    """Lower an order that the head alone chose, one by one, while steps predict the rest within 5 % per output.

    What a short window leaves out of the state looks like further states to the head's model, and goes with the steps.
    Returns the choice and the steps from the head's model of its order. Cost: the steps for each order down to the
    first that is worse.
    """
    trial = head_trial(data, structure, head, choice.order)
    if trial is None:
        return choice, None
    order, least = choice.order, trial.loss
    while order > 1:
        lower = head_trial(data, structure, head, order - 1)
        if lower is None or not lower.loss <= least + TOLERANCE:
            break
        order, trial, least = order - 1, lower, min(least, lower.loss)
    if order < choice.order:
        reason = (
            f"order {order}: the smallest from {choice.order} down that is within {100 * TOLERANCE:.2g}% per output "
            f"of the best after prediction-error steps. Before them: {choice.reason}"
        )
        choice = replace(choice, order=order, reason=reason)
    return choice, trial
