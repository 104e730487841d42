"""Refuse a loop whose recordings fit plants that differ: a controller to which too little is added from outside.

A linear controller of a few states that nothing from outside moves ties the inputs to the outputs over every window:
Ξ and Ξ + α N predict alike for every row N that the windows annihilate, and the smallest Ξ, which eq. (23) takes,
shares the plant out between inputs and outputs. Its poles are those of no plant, its deviations are small. Noise does
not help, since it passes through the controller too; neither does a window, since the controller's order is below it.

The test is on data alone. Where every input follows from the outputs of the window much better than from its own past,
two more solutions are taken that predict as well as data can tell: one for which coefficients of the inputs are dear,
one for which those of the outputs are. Where the models that follow from the three respond alike to one of the inputs,
something from outside moves it and shows the poles (a sum of sines does, although a window determines it); where they
respond alike to none, nothing does. Outputs with fewer sources of noise than there are of them tell their inputs by
themselves, whatever moves these: where a combination of outputs is exact nothing is concluded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import singular_values, spectral_norm
from aeolid.errors import NotIdentifiable
from aeolid.identify.excitation import OWN, share_left
from aeolid.identify.markov import MarkovEstimate, estimate_markov
from aeolid.identify.subspace import ScaledModel, find_states, largest_useful_order, system_matrices
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
TIED = 0.2  # of what an input's own past leaves of it, what the outputs leave: above it the input is moved from outside
DEAR = 100.0  # by how much a coefficient of the one kind costs more than one of the other
DIFFERENT = 0.5  # of the larger response, rms over frequency and outputs: plants that far apart are different ones
POINTS = 64  # frequencies from a cycle in four windows to the Nyquist frequency


def require_outside_excitation(
    factor: WindowFactor, names: Sequence[str], order: int, future: int, feedthrough: tuple[bool, ...],
    regularization: str | float, source: str,
) -> None:  # fmt: skip
    """Refuse inputs that a controller ties to the outputs, where what is added leaves the plant open.

    names: inputs in the factor's order; order: n of the model; future: f. Raises NotIdentifiable that names the input.
    Cost: 2 q³ for an input, and where all are tied three fits to the factor.
    """
    if not names or not noisy(factor):
        return
    shares = outside_shares(factor, feedthrough)
    if not all(besides < TIED * own for own, besides in shares):
        return
    apart = disagreement(factor, order, future, feedthrough, regularization)
    every = (True,) * factor.inputs
    if apart.min() > DIFFERENT and feedthrough != every:  # D that is left out ties the input to the outputs as well
        apart = np.minimum(apart, disagreement(factor, order, future, every, regularization))
    i = int(np.argmin(apart))
    if apart[i] > DIFFERENT:
        own, besides = shares[i]
        raise NotIdentifiable(
            f"{source}: input {names[i]!r} follows from the outputs by a controller to which too little is added from "
            f"outside ({besides:.1g} of it is left open over past window {factor.past}, {own:.1g} by its own past): "
            f"models whose responses to it differ by {min(apart[i], 1):.0%} and more predict the recording alike, so "
            "it shows no plant; record with a dither or set points that move the input, or with a controller of more "
            "states than the past window has samples"
        )


def noisy(factor: WindowFactor) -> bool:
    """Return whether no combination of outputs follows exactly from the window and the inputs of the sample."""
    regressors = np.hstack([factor.R[:, : factor.past * factor.channels], factor.u_now])
    size = regressors.shape[1]
    R = triangularise(np.hstack([regressors, factor.y_now]))
    left = singular_values(R[size:, size:])
    return bool(left[-1] > OWN * spectral_norm(factor.y_now))


def outside_shares(factor: WindowFactor, feedthrough: Sequence[bool]) -> list[tuple[float, float]]:
    """Return for each input which share of it its own past and the other inputs leave, and the outputs besides.

    Outputs of the sample itself count where the input does not act on them within the sample.
    """
    m, r, width = factor.channels, factor.inputs, factor.past * factor.channels
    past = factor.R[:, :width]
    inputs = past[:, [c for c in range(width) if c % m < r]]
    shares = []
    for i in range(r):
        others = np.delete(factor.u_now, i, axis=1)
        now = [others] if feedthrough[i] else [others, factor.y_now]
        own = share_left(np.hstack([inputs, others]), factor.u_now[:, i])
        shares.append((own, share_left(np.hstack([past, *now]), factor.u_now[:, i])))
    return shares


def disagreement(
    factor: WindowFactor, order: int, future: int, feedthrough: tuple[bool, ...], regularization: str | float
) -> Array:
    """Return how far the responses to each input (r,) lie apart at most among three solutions, 0 … 2.

    The rms over frequency and outputs of the difference of two, relative to that of the larger one.
    """
    responses = []
    for weight in (1.0, DEAR, 1 / DEAR):
        model = _model(factor, order, future, feedthrough, regularization, weight)
        responses.append(_response(model, factor.past))
    out = np.zeros(factor.inputs)
    for a in range(3):
        for b in range(a):
            size = np.maximum(*(np.sqrt((abs(responses[j]) ** 2).sum(axis=(0, 1))) for j in (a, b)))
            apart = np.sqrt((abs(responses[a] - responses[b]) ** 2).sum(axis=(0, 1)))
            out = np.maximum(out, np.where(size > 0, apart / np.where(size > 0, size, 1.0), 0.0))
    return out


def _model(
    factor: WindowFactor, order: int, future: int, feedthrough: tuple[bool, ...], regularization: str | float,
    weight: float,
) -> ScaledModel:  # fmt: skip
    """Return the model of the solution for which a coefficient of an input costs weight² times one of an output."""
    theta = weighted_markov(factor, feedthrough, regularization, weight).theta
    basis = find_states(factor, theta, future)
    return system_matrices(factor, basis.state_map(max(min(order, largest_useful_order(basis)), 1)), feedthrough)


def weighted_markov(
    factor: WindowFactor, feedthrough: tuple[bool, ...], regularization: str | float, weight: float
) -> MarkovEstimate:
    """Solve eq. (23) with inputs made smaller by `weight` than they are: their coefficients are dearer by as much."""
    m, r = factor.channels, factor.inputs
    scale = np.ones(factor.full.shape[1])
    place = np.arange(len(scale) - 1)
    scale[1:][place % m < r] = 1 / weight
    estimate = estimate_markov(replace(factor, full=factor.full * scale), feedthrough, regularization)
    return replace(estimate, theta=estimate.theta * scale[1 : 1 + estimate.theta.shape[1]])


def _response(model: ScaledModel, past: int) -> NDArray[np.complex128]:
    """Return the frequency response (POINTS, l, r) in scaled units."""
    turns = np.exp(1j * np.geomspace(np.pi / (2 * past), np.pi, POINTS))
    with np.errstate(all="ignore"):
        states = np.linalg.solve(turns[:, None, None] * np.eye(len(model.A)) - model.A, model.B.astype(complex))
    out: NDArray[np.complex128] = np.nan_to_num(model.C @ states + model.D)
    return out
