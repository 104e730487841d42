"""Choose among the Ξ that predict alike where the data are singular: the smallest, or one on fewest regressors.

With fewer noise sources than outputs, or without measurement noise, some combination of the regressors is (nearly) zero
and Ξ Ψ does not tell Ξ. The smallest Ξ (a pseudo-inverse) spreads each coefficient over all regressors that hang
together; a pivoted one takes as many columns as the rank has, each time the one farthest from those taken, and leaves
the rest zero (a basic solution). ΓK, built from Ξ by shifts, is the same for neither. On the turbine pivoted ones are
nearer in the gains of the rotor speed and farther in those of the tower, so that both are carried to a model of the
first 70 % of the recordings, and pivoted ones are taken only where they predict the rest better in every output, one
step and two windows ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.markov import estimate_markov
from aeolid.identify.order import about_mean, choose_held_out, errors_of, known_of, parts_of
from aeolid.identify.subspace import find_states, largest_useful_order, system_matrices
from aeolid.identify.windows import WindowFactor
from aeolid.models.recursion import run_states

if TYPE_CHECKING:
    from aeolid.identify.compressed import Windows
    from aeolid.identify.result import Settings

Array = NDArray[np.float64]
SOLUTIONS = ("auto", "smallest", "pivoted")
UNEXCITED = ("refuse", "take")
AHEAD = 2  # past windows: as far as the future window reaches beyond the past one


def with_solution(settings: Settings, solution: str, unexcited: str = "refuse") -> Settings:
    """Return the settings with the solution and what becomes of unexcited loops; raises UsageError on others."""
    if solution not in SOLUTIONS:
        raise UsageError(f"solution {solution!r} is none of {', '.join(SOLUTIONS)}")
    if solution == "pivoted" and settings.markov is not None:
        raise UsageError("with a streamed Ξ nothing is solved; leave the solution out")
    if unexcited not in UNEXCITED:
        raise UsageError(f"unexcited {unexcited!r} is none of {', '.join(UNEXCITED)}")
    return replace(settings, solution=solution, unexcited=unexcited)


def choose_solution(
    windows: Windows, through: tuple[bool, ...], settings: Settings, most: int
) -> tuple[Windows, tuple[str, ...], dict[str, Any]]:
    """Return the windows with the solution that is taken, what is to be said of it, and the same as JSON facts.

    most: the largest order to try where the settings have none. Data that tell all regressors apart have one solution,
    and there is nothing to say. Cost, on singular data: twice the choice of the order.
    """
    if settings.solution == "pivoted":
        return replace(windows, solution="pivoted"), (), {"solution": {"value": "pivoted"}}
    whole = estimate_markov(windows.whole, through, settings.regularization)
    if settings.solution == "smallest" or settings.markov is not None or whole.rank == whole.regressors:
        return windows, (), {"solution": {"value": "smallest"}}
    stretches = windows.held_out()
    losses = {s: _loss(windows.fitted, through, settings, s, stretches, most) for s in SOLUTIONS[1:]}
    taken = better(losses["smallest"], losses["pivoted"])
    means = {k: float(v.mean()) if np.isfinite(v).all() else None for k, v in losses.items()}
    facts = {"solution": {"value": taken, "losses": means}}
    if None in means.values():
        return windows, (), facts
    where = "every output" if taken == "pivoted" else "not every output"
    text = (
        f"among the Markov parameters that fit these singular data alike the {taken} ones were taken: pivoted ones "
        f"predict {where} better on held-out samples, one step and {AHEAD * settings.past} steps ahead"
    )
    return replace(windows, solution=taken), (text,), facts


def better(smallest: Array, pivoted: Array) -> str:
    """Return which to take by the log error powers (2, l): pivoted ones where they are better in all."""
    finite = bool(np.isfinite(smallest).all() and np.isfinite(pivoted).all())
    return "pivoted" if finite and bool((pivoted < smallest).all()) else "smallest"


def _loss(
    fitted: WindowFactor, through: tuple[bool, ...], settings: Settings, solution: str, held_out: Sequence[Array],
    most: int,
) -> Array:  # fmt: skip
    """Return the log error power (2, l) of horizons and outputs; infinite without samples, states, a stable predictor.

    The order is the one asked for, or the one that these Markov parameters would lead to.
    """
    theta = estimate_markov(fitted, through, settings.regularization, solution).theta
    basis, unknown = find_states(fitted, theta, settings.future), np.full((2, fitted.outputs), np.inf)
    order = settings.order
    if order is None:
        choice = choose_held_out(fitted, basis, held_out, through, most)
        order = None if choice is None else choice.order
    if order is None or not 0 < order <= largest_useful_order(basis):
        return unknown
    T = basis.state_map(order)
    model, steps = system_matrices(fitted, T, through), AHEAD * fitted.past
    power, samples = np.zeros((2, 2, fitted.outputs))
    for z in held_out:
        before, u, y, measured = parts_of(z, fitted)
        if len(u) <= steps:
            continue
        forced = u @ (model.B - model.K @ model.D).T + y @ model.K.T
        with np.errstate(all="ignore"):  # a predictor that diverges loses by an infinite loss
            x = run_states(model.A - model.K @ model.C, forced, T @ before)[:-1]
            near = errors_of(measured, x @ model.C.T + u @ model.D.T)
            x = x[: len(u) - steps]
            for k in range(steps):
                x = x @ model.A.T + u[k : k + len(x)] @ model.B.T
            far = errors_of(measured[steps:], x @ model.C.T + u[steps:] @ model.D.T)
            power += [(about_mean(e) ** 2).sum(axis=0) for e in (near, far)]
        samples += [known_of(e) for e in (near, far)]
    if not samples.all() or not np.isfinite(power).all():
        return unknown
    out: Array = np.log(np.maximum(power / samples, np.finfo(float).tiny))
    return out
