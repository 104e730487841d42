"""Guard an automatic order whose model is unstable: a smaller stable one, where held-out data cannot tell them apart.

The smallest order within 2 % of the best one-step error is right where the error has a least. Where noise is coloured
by more than the window shows, it falls up to the limit: order after order that describes the noise of this recording,
with poles outside the unit circle too. A smaller order takes its place that is stable, whose free run on the held-out
part is not lost, and whose one-step error there is the best one's but for chance. Orders that are told apart stay as
they are: in a loop, noise that a smaller order leaves out biases the modes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.order import (
    RESOLVED,
    TOLERANCE,
    OrderChoice,
    about_mean,
    errors_of,
    known_of,
    parts_of,
    predictor_errors,
)
from aeolid.identify.subspace import StateBasis, regressed_matrices
from aeolid.identify.windows import WindowFactor
from aeolid.models.divergence import growing
from aeolid.models.recursion import run_states

Array = NDArray[np.float64]
NEAR_LIMIT = 0.8  # of the orders tried; a plant of so many states needs more windows to be told apart from noise
MANY = 20  # orders tried; of fewer, so many states may be the plant's
FAR_OFF = 1.0  # of mean log power: no chance of 20 blocks makes an error 2.7 times as large
BLOCKS = 20  # of the held-out samples; differences of blocks are independent where a block outlasts the dynamics
LOST = 100.0  # of an output's power: an error of ten standard deviations, as in `fit.DIVERGES`
DEVIATIONS = 2.0  # of the mean difference: what chance makes in one of twenty


def guard_order(
    choice: OrderChoice, fitted: WindowFactor, head: StateBasis, whole: WindowFactor, basis: StateBasis,
    held_out: Sequence[Array], feedthrough: tuple[bool, ...],
) -> OrderChoice:  # fmt: skip
    """Return the choice, or a smaller order where its model is unstable over the recording.

    choice: by the held-out error; fitted, head: factor and states that were fitted for it, whole, basis: of everything.
    Errors are compared in blocks of the held-out samples, pairwise. Stable is what has no mode that grows tenfold
    within the recording. Where none is alike the choice stays, for `sound` to judge: a plant that grows, or
    integrates, is not mended by a smaller order.
    """
    losses = choice.losses
    if not losses or not _grows(whole, basis, choice.order, feedthrough):
        return _warned(choice)
    best = int(np.argmin(losses)) + 1
    reference = _block_powers(predictor_errors(fitted, head, best, held_out, feedthrough))
    for n in range(1, choice.order):
        alike = losses[n - 1] < losses[best - 1] + FAR_OFF and _alike(
            _block_powers(predictor_errors(fitted, head, n, held_out, feedthrough)), reference
        )
        if not alike or _grows(whole, basis, n, feedthrough):
            continue
        if _stays(_block_powers(free_errors(fitted, head, n, held_out, feedthrough))):
            reason = (
                f"order {n}: in place of {choice.order}, whose model is unstable; its one-step error on held-out "
                f"samples differs from that of order {best} by no more than chance. Unguarded: {choice.reason}"
            )
            return replace(choice, order=n, reason=reason, answers=choice.answers | {"held-out": n})
    return _warned(choice)


def _warned(choice: OrderChoice) -> OrderChoice:
    """Return a choice at the limit of many orders with that in its reason."""
    most = len(choice.losses)
    if most < MANY or choice.order < NEAR_LIMIT * most:
        return choice
    text = (
        f"{choice.reason}; WARNING: that is at the limit of the orders tried, the error still falls there, and states "
        "describe noise: name the order, lengthen the past window, or lower the rate (--decimate)"
    )
    return replace(choice, reason=text)


def _stays(powers: Array) -> bool:
    """Say whether a free run keeps within ten standard deviations of every output."""
    return bool(np.isfinite(powers).all() and np.all(powers.mean(axis=0) < LOST))


def _grows(whole: WindowFactor, basis: StateBasis, order: int, feedthrough: tuple[bool, ...]) -> bool:
    """Say whether the model of an order has a mode that grows tenfold within the recording."""
    A = regressed_matrices(whole, basis.state_map(order), feedthrough).A
    return growing(A, whole.windows)[0] is not None


def free_errors(
    fitted: WindowFactor, head: StateBasis, order: int, held_out: Sequence[Array], feedthrough: tuple[bool, ...]
) -> Iterator[Array]:
    """Yield the errors (N, l) of a free run on each held-out stretch, from the window before its first sample on."""
    T = head.state_map(order)
    model = regressed_matrices(fitted, T, feedthrough)
    for z in held_out:
        before, u, _, measured = parts_of(z, fitted)
        with np.errstate(all="ignore"):
            states = run_states(model.A, u @ model.B.T, T @ before)[:-1]
            yield errors_of(measured, states @ model.C.T + u @ model.D.T)


def _block_powers(errors: Iterator[Array]) -> Array:
    """Return the mean power of each output's error about its mean in each of the blocks of samples, (BLOCKS, l)."""
    with np.errstate(all="ignore"):
        e = np.concatenate(list(errors))
        blocks = zip(np.array_split(about_mean(e), BLOCKS), np.array_split(e, BLOCKS), strict=True)
        return np.array([(part**2).sum(axis=0) / np.maximum(known_of(own), 1) for part, own in blocks])


def _alike(powers: Array, reference: Array) -> bool:
    """Say whether the mean log error power per output is above the reference's by no more than chance or 2 %.

    Of the logarithm of a mean, the blocks' parts are those of the power over the mean (first order).
    """
    if not np.isfinite(powers).all():
        return False
    size, least = (np.maximum(p.mean(axis=0), RESOLVED) for p in (powers, reference))
    rise = float(np.mean(np.log(size / least)))
    parts = (powers / size - reference / least).mean(axis=1)
    deviation = float(parts.std(ddof=1)) / np.sqrt(len(parts))
    return bool(rise <= max(TOLERANCE, DEVIATIONS * deviation))
