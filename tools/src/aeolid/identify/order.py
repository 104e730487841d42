"""Choose the order of a model: on data that were not used to fit it, by information criteria or by a gap.

The information criteria take the error powers of the predictor over everything it was fitted to, each output's by
itself: N Σ log P + 2 k (AIC) or k log N (BIC), k = n (2 l + r) and what D and the constants have free. log det of the
errors' covariance, the likelihood proper, is minus infinity where there are fewer noise sources than outputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.identify.split import FIT_PART, border_of
from aeolid.identify.subspace import ScaledModel, StateBasis, largest_useful_order, system_matrices
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.models.prediction import complete_stretches
from aeolid.models.recursion import run_states
from aeolid.record import Record

Array = NDArray[np.float64]
TOLERANCE = 0.02  # a larger order must lower the held-out error power by more than this, per output
LONGEST = 20_000  # samples of each recording that are predicted; more change nothing
RESOLVED = 1e-10  # of an output's power; errors below are digits of the recording (binary32), not worth a state
HELD_OUT_LEAST = 20  # samples per channel that must be predicted
CRITERIA = ("held-out", "aic", "bic", "gap")


@dataclass(frozen=True, eq=False)
class OrderChoice:
    """Hold the chosen order, one sentence that says why, and the held-out losses (candidates,) behind it.

    losses[i]: mean log error power of order i + 1 per output on the held-out part, NaN where not tried; answers: the
    order that each criterion would take, where there was a choice.
    """

    order: int
    reason: str
    losses: tuple[float, ...]
    answers: dict[str, int] = field(default_factory=dict)


def require_order(order: int, usable: int, source: str) -> None:
    """Refuse an order beyond what the data carry; usable: number of singular values above rounding."""
    if usable == 0:
        raise NotIdentifiable(
            f"{source}: no state: nothing of the outputs follows from the past, 0 singular values above rounding, "
            "1 is needed; look at the roles, or lengthen the past window"
        )
    if order > usable:
        raise NotIdentifiable(
            f"{source}: order {order} asked for, the data carry {usable} singular values above rounding; "
            "lower the order or lengthen the windows"
        )


def worth_a_state(held_out: int) -> float:
    """Return by how much of the error power a larger order must gain on so many held-out samples: 2 %, less of many.

    What a mode of little weight takes of the error falls with nothing, what chance takes falls with the samples: left
    out of 60,000 samples, one that made 0.1 % of the output had the dampings of its neighbours 28 deviations off.
    """
    return float(min(TOLERANCE, 4.0 / max(held_out, 1) ** 0.75))


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
        f"is within {100 * tolerance:.2g}% per {each} of the best ({what} {best + 1} of 1 to {len(losses)}){tail}"
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


def held_out_stretches(
    records: Sequence[Record], scaling: Scaling, past: int, *, everything: bool = False,
    measured: Sequence[Record] = (),
) -> list[Array]:  # fmt: skip
    """Return the scaled complete stretches (N, m) behind the fit part of each recording, p samples of run-in included.

    everything: of whole recordings instead. measured: the recordings before missing cells were filled, if any were:
    their outputs, not a number where missing, then follow behind the channels, (N, m + l).
    """
    outputs = slice(len(scaling.inputs), len(scaling.inputs) + len(scaling.outputs))
    stretches = []
    for record, as_measured in zip_longest(records, measured):
        start = 0 if everything else max(border_of(record, scaling, past) - past, 0)
        z = scaling.apply(record.columns(scaling.names))[start : start + LONGEST]
        spans = complete_stretches(z, past + 10)
        if as_measured is not None:
            y = as_measured.columns(scaling.outputs)[start : start + LONGEST]
            z = np.hstack([z, (y - scaling.offset[outputs]) / scaling.scale[outputs]])
        stretches += [z[a:b] for a, b in spans]
    return stretches


def parts_of(z: Array, factor: WindowFactor) -> tuple[Array, Array, Array, Array]:
    """Return a stretch's run-in (p m,), and behind it u (N, r), y (N, l) and y as measured, y where z has no other."""
    past, inputs, channels = factor.past, factor.inputs, factor.channels
    y = z[past:, inputs : inputs + factor.outputs]
    return z[:past, :channels].ravel(), z[past:, :inputs], y, z[past:, channels:] if z.shape[1] > channels else y


def count_measured(stretches: Sequence[Array], factor: WindowFactor) -> int:
    """Return how many samples behind the run-in of stretches were measured, of the output that has the fewest."""
    known = [np.isfinite(parts_of(z, factor)[3]).sum(axis=0) for z in stretches if len(z) > factor.past]
    return int(np.sum(known, axis=0).min()) if known else 0


def choose_held_out(
    fitted: WindowFactor, basis: StateBasis, held_out: Sequence[Array], feedthrough: tuple[bool, ...], most: int
) -> OrderChoice | None:
    """Choose the smallest order whose held-out one-step error is within 2 % per output of the best.

    fitted, basis: of the fit part only; held_out: from `held_out_stretches`. Every order 1 … most is fitted and its
    stabilised predictor run over the held-out samples; the log of each output's error power is averaged over outputs,
    so that outputs of any size count alike. None without held-out samples.
    """
    most = min(most, largest_useful_order(basis))
    predicted = count_measured(held_out, fitted)  # the first p samples of a stretch are its run-in
    if most == 0 or predicted < HELD_OUT_LEAST * fitted.channels:
        return None
    losses = [_log_powers(fitted, basis, n, held_out, feedthrough)[0] for n in range(1, most + 1)]
    return smallest_sufficient(losses, tolerance=worth_a_state(predicted))


def choose_order(
    fitted: WindowFactor, basis: StateBasis, held_out: Sequence[Array], feedthrough: tuple[bool, ...], most: int
) -> OrderChoice:
    """Choose as `choose_held_out`; without held-out samples by the largest gap of the singular values."""
    found = choose_held_out(fitted, basis, held_out, feedthrough, most)
    return found or by_gap_alone(*say_gap(basis.singular_values, min(most, largest_useful_order(basis))))


def information_costs(
    whole: WindowFactor, basis: StateBasis, stretches: Sequence[Array], feedthrough: tuple[bool, ...], most: int
) -> dict[str, list[float]]:
    """Return AIC and BIC of the orders 1 … most; whole, basis: of everything; stretches: all complete ones, scaled.

    Empty where no stretch is long enough to be predicted.
    """
    if not stretches:
        return {}
    most, outputs = min(most, largest_useful_order(basis)), whole.outputs
    found = [_log_powers(whole, basis, n, stretches, feedthrough) for n in range(1, most + 1)]
    samples = found[0][1]
    fixed = outputs * (1 + sum(feedthrough))
    free = [n * (2 * outputs + whole.inputs) + fixed for n in range(1, most + 1)]
    costs = {"aic": 2.0, "bic": float(np.log(max(samples, 2)))}
    return {
        name: [samples * outputs * loss + cost * k for (loss, _), k in zip(found, free, strict=True)]
        for name, cost in costs.items()
    }


def decide(
    criterion: str, held_out: OrderChoice | None, information: dict[str, list[float]], singular_values: Array, most: int
) -> OrderChoice:
    """Take the order that a criterion says, and say what the others would have taken.

    held_out: from `choose_held_out`, without which its place is taken by BIC, or by the gap where there is none either.
    """
    gap, gap_text = say_gap(singular_values, most)
    least = {name: int(np.argmin(costs)) + 1 for name, costs in information.items()}
    answers = least | {"gap": gap} | ({} if held_out is None else {"held-out": held_out.order})
    wanted = next(name for name in (criterion, "bic", "gap") if name in answers)
    if wanted == "held-out" and held_out is not None:
        reason = held_out.reason
    elif wanted == "gap":
        reason = f"order {gap}: {gap_text}"
    else:
        reason = f"order {answers[wanted]}: of least {wanted.upper()} among 1 to {most}"
    if wanted != criterion:
        reason += "; too few samples to hold some out"
    names = {"held-out": "the held-out error", "aic": "AIC", "bic": "BIC"}
    others = [f"{text} says {answers[name]}" for name, text in names.items() if name in answers and name != wanted]
    texts = others + ([gap_text] if wanted != "gap" else [])
    losses = () if held_out is None else held_out.losses
    return OrderChoice(answers[wanted], "; ".join([reason, *texts]), losses, answers)


def _log_powers(
    factor: WindowFactor, basis: StateBasis, order: int, stretches: Sequence[Array], feedthrough: tuple[bool, ...]
) -> tuple[float, int]:
    """Return the mean log error power per output of the predictor of an order, and the samples it was taken over."""
    power, samples = np.zeros((2, factor.outputs))
    for e in predictor_errors(factor, basis, order, stretches, feedthrough):
        with np.errstate(all="ignore"):  # a predictor that diverges loses by an infinite loss
            power += (about_mean(e) ** 2).sum(axis=0)  # the constants of the regressions are not at stake
        samples += known_of(e)
    mean = np.where(np.isfinite(power), power / np.maximum(samples, 1), np.inf)
    return float(np.mean(np.log(np.maximum(mean, RESOLVED)))), round(float(samples.mean()))


def predictor_errors(
    factor: WindowFactor, basis: StateBasis, order: int, stretches: Sequence[Array], feedthrough: tuple[bool, ...]
) -> Iterator[Array]:
    """Yield the one-step errors (N, l) of the predictor of an order on each stretch, scaled units.

    Each stretch starts from the window before its first sample. An output that was not measured has the error NaN, one
    whose prediction diverges an infinite one.
    """
    T = basis.state_map(order)
    model: ScaledModel = system_matrices(factor, T, feedthrough)
    for z in stretches:
        before, u, y, measured = parts_of(z, factor)
        forced = u @ (model.B - model.K @ model.D).T + y @ model.K.T
        with np.errstate(all="ignore"):
            states = run_states(model.A - model.K @ model.C, forced, T @ before)[:-1]
            yield errors_of(measured, states @ model.C.T + u @ model.D.T)


def errors_of(measured: Array, predicted: Array) -> Array:
    """Return the errors (N, l), NaN where nothing was measured, and infinite where the prediction is not finite."""
    lost = ~np.isfinite(predicted)
    return np.where(np.isfinite(measured), np.where(lost, np.inf, measured - predicted), np.nan)


def known_of(e: Array) -> Array:
    """Return how many errors (N, l) of each output there are, (l,)."""
    out: Array = (~np.isnan(e)).sum(axis=0).astype(np.float64)
    return out


def about_mean(e: Array) -> Array:
    """Return errors (N, l) about the mean of each output, those of outputs that were not measured zero."""
    known = ~np.isnan(e)
    mean = np.where(known, e, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return np.where(known, e - mean, 0.0)
