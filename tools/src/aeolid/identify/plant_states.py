"""Ask what few states need: of feedthrough that the correlation within the sample does not decide.

A plant has few states. Where D u_k is left out of y_k = C x_k + D u_k + e_k, the innovation is D v_k + e_k with
v_k = u_k − E[u_k | past], and y_k needs D E[u_k | past] from the past: what the controller remembers becomes part of
the plant. Two questions follow, for inputs in a loop:

`ask_states`: do few states with D lose less to the whole window than few states without? Both masks describe the same
recording; the one that needs fewer states is taken, each paid for. White inputs are told by nothing of the past, and
both do alike: the answer is yes or nothing.

`ask_predicted`: does E[u_k | past] tell of y_k what the states of the plant do not? It is a function of the past, so
that no innovation of y is in it, whatever the controller computes from y_k (F): the instrument of two-stage least
squares. The answer counts only where u and y hang together weakly within the sample. F then biases D by little, and
leaving D out costs more; where they hang together strongly with small excitation, the inverse of a controller passes
for a plant of few states.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.decompositions import lstsq, pinv
from aeolid.identify.markov import estimate_markov
from aeolid.identify.subspace import StateBasis, find_states, largest_useful_order
from aeolid.identify.truncation import LARGEST_ORDER, held_out_power, order_loss
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
Halves = tuple[WindowFactor, WindowFactor]
WEAK_WITHIN = 0.2  # correlation within the sample: what `validate` lets pass, since static feedback makes as much


def ask_states(halves: Halves, through: tuple[bool, ...], i: int, level: float) -> bool:
    """Say whether the plant needs feedthrough of input i, with that of the others as in `through`.

    halves: factors of the part that is fitted and of the held-out part, of a window that predicts the outputs; level:
    the likelihood of the better mask is to exceed the other's by 1/level, states and D paid for.
    """
    without, having = (cost_of_mask(halves, (*through[:i], on, *through[i + 1 :])) for on in (False, True))
    return bool(without - having > -2 * np.log(level))


def cost_of_mask(halves: Halves, through: tuple[bool, ...]) -> float:
    """Return what few states lose to the whole window on the held-out part, in −2 log likelihood, at the best order.

    Each output counts by itself, so that exact combinations of outputs weigh no more than their powers. Each state
    costs 2 l + r parameters and each column of D l, at log N (BIC), N the held-out windows.
    """
    fitted, held_out = halves
    _, losses = _losses(halves, through)
    lost = held_out.windows * fitted.outputs * (losses - held_out_power(halves, through, "gcv"))
    parameters = np.arange(1, len(losses) + 1) * (2 * fitted.outputs + fitted.inputs) + sum(through) * fitted.outputs
    return float(np.min(lost + parameters * np.log(max(held_out.windows, 2))))


def ask_predicted(halves: Halves, through: tuple[bool, ...], i: int, level: float) -> bool:
    """Say whether what the past tells of input i shows in the outputs beyond the states, and F can spoil little.

    halves, through: as in `ask_states`; level: of the χ² test of D by two-stage least squares on the held-out part,
    with what the fitted part says of states and input; as many states as predict best, for one left out shows as D.
    Yes asks more: the estimate by least squares is nearer to that of two stages than zero is, and leaving D out costs
    more of the error than all of the correlation within the sample.
    """
    fitted, held_out = halves
    through = (*through[:i], True, *through[i + 1 :])
    basis, losses = _losses(halves, through)
    T, width = basis.state_map(int(np.argmin(losses)) + 1), fitted.past * fitted.channels
    others = [j for j in range(fitted.inputs) if through[j] and j != i]
    known = np.hstack([held_out.R[:, :width] @ T.T, held_out.u_now[:, others]])
    told = lstsq(fitted.R[:, :width], fitted.u_now[:, i], rcond=1e-9)
    u, instrument, y = (
        a - known @ lstsq(known, a, rcond=1e-12)
        for a in (held_out.u_now[:, i], held_out.R[:, :width] @ told, held_out.y_now)
    )
    moved = float(instrument @ u)
    if not moved > 0:
        return False
    two_stage, plain = instrument @ y / moved, u @ y / (u @ u)
    e = (y - np.outer(u, two_stage)) / np.sqrt(max(held_out.windows - known.shape[1] - 1, 1))
    size = np.sqrt((e**2).sum(axis=0))
    z = two_stage / np.maximum(size, 1e-300) * moved / np.sqrt(instrument @ instrument)
    shape = (e / np.maximum(size, 1e-300)).T @ (e / np.maximum(size, 1e-300))
    wald = float(z @ pinv(shape, rcond=1e-6, hermitian=True) @ z)
    leaving_out, biased = (float(np.sum((d / size) ** 2)) for d in (two_stage, plain - two_stage))
    within = _within(held_out, i)
    cost = leaving_out * float(u @ u) / max(held_out.windows, 1)
    weak = bool(within.max() < WEAK_WITHIN) and cost > float(np.sum(within**2 / (1 - within**2)))
    return bool(weak and biased < leaving_out and chdtrc(len(z), wald) < level)


def _losses(halves: Halves, through: tuple[bool, ...]) -> tuple[StateBasis, Array]:
    """Return the states by the fitted part and their held-out losses, from one state on."""
    fitted, held_out = halves
    basis = find_states(fitted, estimate_markov(fitted, through, "gcv").theta, fitted.past)
    most = min(LARGEST_ORDER, largest_useful_order(basis), held_out.windows // (4 * held_out.channels))
    orders = range(1, max(most, 1) + 1)
    return basis, np.array([order_loss(fitted, held_out, basis, n, through) for n in orders])


def _within(factor: WindowFactor, i: int) -> Array:
    """Return |correlations| (l,) of what the past and the other inputs leave of input i and of each output."""
    width = factor.past * factor.channels
    known = np.hstack([factor.R[:, :width], np.delete(factor.u_now, i, axis=1)])
    u, y = (a - known @ lstsq(known, a, rcond=1e-9) for a in (factor.u_now[:, i], factor.y_now))
    scale = np.sqrt((u @ u) * (y**2).sum(axis=0))
    out: Array = np.minimum(abs(y.T @ u) / np.maximum(scale, 1e-300), 1 - 1e-9)
    return out
