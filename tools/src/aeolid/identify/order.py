"""Choose the order of a model on data that were not used to fit it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.subspace import ScaledModel, StateBasis, largest_useful_order, system_matrices
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.models.prediction import complete_stretches
from aeolid.models.recursion import run_states
from aeolid.record import Record

Array = NDArray[np.float64]
FIT_PART = 0.7  # of each recording; the rest chooses the order
TOLERANCE = 0.02  # a larger order must lower the held-out error power by more than this, per output
LONGEST = 20_000  # held-out samples of each recording that are predicted; more change nothing


@dataclass(frozen=True, eq=False)
class OrderChoice:
    """Hold the chosen order, one sentence that says why, and the held-out losses (candidates,) behind it.

    losses[i]: mean log error power of order i + 1 per output on the held-out part, NaN where not tried.
    """

    order: int
    reason: str
    losses: tuple[float, ...]


def largest_gap(singular_values: Array, most: int) -> int:
    """Return the order after which the singular values fall by the largest ratio, at most `most`.

    Only falls that start above 0.5 % of the largest count: those below are noise falling into rounding.
    """
    top = singular_values[: most + 1]
    ratios = np.where(top[:-1] > 5e-3 * top[0], top[:-1] / np.maximum(top[1:], 1e-300), 0.0)
    return int(np.argmax(ratios)) + 1 if len(ratios) else 1


def smallest_sufficient(
    losses: Sequence[float], *, tolerance: float = TOLERANCE, what: str = "order", of: str = "", each: str = "output",
    tail: str = "",
) -> OrderChoice:  # fmt: skip
    """Choose the smallest order whose loss is within `tolerance` of the least, and say so.

    losses[i]: mean log error power of order i + 1 on held-out samples, infinite where not to be taken. what, of, each,
    tail: words of the reason: what is chosen, the error of what, per what, and what else is to be said.
    """
    best = int(np.argmin(losses))
    order = next(i for i, loss in enumerate(losses) if loss <= losses[best] + tolerance) + 1
    reason = (
        f"{what} {order}: the smallest whose one-step error{of} on the held-out last {1 - FIT_PART:.0%} "
        f"is within {tolerance:.0%} per {each} of the best ({what} {best + 1} of 1 to {len(losses)}){tail}"
    )
    return OrderChoice(order, reason, tuple(losses))


def say_gap(singular_values: Array, most: int) -> tuple[int, str]:
    """Return the order of the largest gap and what it is."""
    gap = largest_gap(singular_values, most)
    ratio = singular_values[gap - 1] / max(singular_values[min(gap, len(singular_values) - 1)], 1e-300)
    return gap, f"the singular values fall most after {gap} (factor {ratio:.1f})"


def by_gap_alone(gap: int, text: str) -> OrderChoice:
    """Choose by the largest gap where nothing can be held out."""
    return OrderChoice(gap, f"order {gap}: {text}; too few samples to hold some out", ())


def held_out_stretches(records: Sequence[Record], scaling: Scaling, past: int, part: float = FIT_PART) -> list[Array]:
    """Return the scaled complete stretches (N, m) of the last part of each recording, p samples of run-in included."""
    stretches = []
    for record in records:
        start = max(round(part * len(record)) - past, 0)
        columns = [i for name in scaling.names for i, c in enumerate(record.channels) if c.name == name]
        z = scaling.apply(record.values[start : start + LONGEST, columns])
        stretches += [z[a:b] for a, b in complete_stretches(z, past + 10)]
    return stretches


def choose_order(
    fitted: WindowFactor, basis: StateBasis, held_out: Sequence[Array], feedthrough: tuple[bool, ...], most: int
) -> OrderChoice:
    """Choose the smallest order whose held-out one-step error is within 2 % per output of the best.

    fitted, basis: of the fit part only; held_out: from `held_out_stretches`. Every order 1 … most is fitted and its
    stabilised predictor run over the held-out samples; the log of each output's error power is averaged over outputs,
    so that outputs of any size count alike. Without held-out samples the largest gap decides.
    """
    most = min(most, largest_useful_order(basis))
    gap, gap_text = say_gap(basis.singular_values, most)
    samples = sum(len(z) for z in held_out)
    if samples < 20 * fitted.channels:
        return by_gap_alone(gap, gap_text)
    losses = []
    for order in range(1, most + 1):
        T = basis.state_map(order)
        losses.append(_held_out_loss(system_matrices(fitted, T, feedthrough), T, held_out, fitted.past, fitted.inputs))
    return smallest_sufficient(losses, tail=f"; {gap_text}")


def _held_out_loss(model: ScaledModel, T: Array, held_out: Sequence[Array], past: int, inputs: int) -> float:
    """Return the mean log error power of the predictor, started from the window before each stretch."""
    power, samples = np.zeros(model.C.shape[0]), 0
    for z in held_out:
        x0 = T @ z[:past].ravel()
        u, y = z[past:, :inputs], z[past:, inputs : inputs + len(power)]
        forced = u @ (model.B - model.K @ model.D).T + y @ model.K.T
        with np.errstate(all="ignore"):  # a predictor that diverges loses by an infinite loss
            states = run_states(model.A - model.K @ model.C, forced, x0)[:-1]
            e = y - states @ model.C.T - u @ model.D.T
            power += ((e - e.mean(axis=0)) ** 2).sum(axis=0)  # the constants of the regressions are not at stake
        samples += len(y)
    mean = np.where(np.isfinite(power), power / samples, np.inf)
    return float(np.mean(np.log(np.maximum(mean, 1e-30))))
