"""Find the uncertainty of an identified model by a block multiplier bootstrap of its regression.

The noise reaches Ξ̂ through the scores alone, Ξ̂ − Ξ = Σ_k e_k ψ_kᵀ (Ψ Ψᵀ)⁻¹. Each run draws signs η, one for each block
of the stationary bootstrap (Politis and Romano 1994: blocks of geometric length) in place of resampled blocks, adds
    ΔΞ* = c Σ_k η_k ê_k ψ_kᵀ (Ψ Ψᵀ + λ²)⁻¹,        c = √(N/(N − rank)), since residuals are shorter than innovations,
to Ξ̂ and ΔΞ* Ψ to the outputs, and finds states, matrices, poles and responses anew. Why this one:
- nothing is simulated: windows stay as recorded, also inputs under feedback. Innovations resampled through the model
  need the controller, which is not known; with the recorded inputs held fixed those lose their correlation with past
  innovations, and deviations come out a fifth too small (tests/studies/bootstraps.py);
- no sample and no factor is touched again: a run costs the small decompositions. Refits with weighted blocks (merged
  factors) say much the same, for a factor of every block and another one in each run;
- the signs of a block are common, so that what correlation a short past window leaves in ê is kept, and so is noise
  whose power changes with time; the asymptotic formula has neither, nor the curvature of the map from Ξ to poles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.bands import frequency_response
from aeolid.identify.markov import MarkovEstimate, regressor_columns
from aeolid.identify.outcome import nearest
from aeolid.identify.subspace import ScaledModel, find_states, regressed_matrices
from aeolid.identify.windows import Scaling, WindowFactor, window_rows
from aeolid.models.shapes import reference_outputs, scaled_to
from aeolid.record import Record

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
MOST_CELLS = 2000  # stretches of windows whose scores are summed beforehand
LEAST_BLOCKS = 30  # fewer say little about a deviation: 13 % at 30
SOUND = 0.8  # of the runs must lead to a model


@dataclass(frozen=True, eq=False)
class Scores:
    """Hold Σ ê ψᵀ of stretches of `length` windows in a row: sums (cells, l, regressors); first: a recording begins."""

    sums: Array
    length: int
    first: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Draws:
    """Hold what the runs found: poles (runs, n) beside the estimate's, responses (runs, points, l, r).

    shapes (runs, n, l): of the modes, scaled to the reference that the estimate has.
    """

    poles: ComplexArray
    responses: ComplexArray
    shapes: ComplexArray
    block: float
    failed: int


def block_length(past: int, windows: int) -> float:
    """Return the mean block length in windows: the past window, at most a thirtieth of all."""
    return float(min(past, windows // LEAST_BLOCKS))


def collect_scores(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor, theta: Array, keep: Sequence[int]
) -> Scores:
    """Sum ê ψᵀ over stretches of windows, in one pass of 4 N l q operations.

    keep: columns of a window that are regressors. Windows with a missing sample count nothing.
    """
    width = theta.shape[1]
    length = -(-sum(map(len, records)) // MOST_CELLS)
    mean, outputs, columns = factor.mean, factor.outputs, list(keep)
    sums: list[Array] = []
    first: list[bool] = []
    for record in records:
        starts = len(sums)
        for rows in window_rows(record, scaling, factor.past, length * max(1, 2048 // length)):
            whole = np.asarray(np.isfinite(rows).all(axis=1))
            centred: Array = np.where(whole[:, None], rows - mean, 0.0)
            e = centred[:, width : width + outputs] - centred[:, :width] @ theta.T
            psi = centred[:, columns]
            sums += [e[a : a + length].T @ psi[a : a + length] for a in range(0, len(psi), length)]
        first += [True] + [False] * (len(sums) - starts - 1) if len(sums) > starts else []
    return Scores(np.array(sums), length, np.array(first))


def signs(scores: Scores, block: float, runs: int, seed: int) -> Array:
    """Draw signs (runs, cells), constant over blocks of geometric length with this mean, in windows."""
    random = np.random.default_rng(seed)
    cells = len(scores.first)
    fresh = random.random((runs, cells)) < min(scores.length / block, 1.0)
    fresh[:, scores.first] = True
    drawn = random.choice([-1.0, 1.0], size=(runs, cells))
    last = np.maximum.accumulate(np.where(fresh, np.arange(cells), 0), axis=1)
    out: Array = np.take_along_axis(drawn, last, axis=1)
    return out


def perturbations(
    factor: WindowFactor, markov: MarkovEstimate, scores: Scores, keep: Sequence[int], drawn: Array
) -> Iterator[Array]:
    """Yield ΔΞ* (l, p m + r) of each run."""
    _, s, Vt = svd(factor.R[:, list(keep)])
    s, Vt = s[: markov.rank], Vt[: markov.rank]
    inverse = 1.0 / (s**2 + (markov.penalty[:, None] * s[0]) ** 2)  # (l, rank)
    inverse *= np.sqrt(factor.windows / max(factor.windows - markov.rank, 1))
    rotated = scores.sums @ Vt.T  # (cells, l, rank)
    for row in drawn:
        delta = np.zeros_like(markov.theta)
        delta[:, list(keep)] = (np.tensordot(row, rotated, axes=1) * inverse) @ Vt
        yield delta


def run_bootstrap(
    factor: WindowFactor, markov: MarkovEstimate, model: ScaledModel, scores: Scores, through: tuple[bool, ...],
    future: int, z: ComplexArray, runs: int, seed: int, reference: int | None = None,
) -> Draws:  # fmt: skip
    """Find poles, responses at z (points,) and mode shapes of `runs` perturbed estimates.

    Raises NotIdentifiable where more than a fifth of them lead to no model. Cost a run: that of the decomposition of ΓK
    and of the regressions; no sample is touched again.
    """
    keep = markov.columns or regressor_columns(factor, through)
    block = max(block_length(factor.past, factor.windows), float(scores.length))
    drawn = signs(scores, block, runs, seed)
    poles, vectors = (part.astype(complex) for part in np.linalg.eig(model.A))
    at = reference_outputs(model.C @ vectors, reference)
    found, responses, shapes = [], [], []
    for delta in perturbations(factor, markov, scores, keep, drawn):
        try:
            other = perturbed(factor, markov, delta, len(model.A), through, future)
            values, vectors = (part.astype(complex) for part in np.linalg.eig(other.A))
        except (np.linalg.LinAlgError, NotIdentifiable):
            continue
        own = nearest(poles, values)
        found.append(values[own])
        shapes.append(scaled_to(other.C @ vectors[:, own], at).T)
        responses.append(frequency_response(other, z))
    if len(found) < SOUND * runs:
        raise NotIdentifiable(
            f"{runs - len(found)} of {runs} bootstrap runs led to no model; lower the order, or take the asymptotic "
            "uncertainty"
        )
    return Draws(np.array(found), np.array(responses), np.array(shapes), block, runs - len(found))


def perturbed(
    factor: WindowFactor, markov: MarkovEstimate, delta: Array, order: int, through: tuple[bool, ...], future: int
) -> ScaledModel:
    """Return the model that Ξ + ΔΞ leads to, with ΔΞ Ψ in the outputs."""
    width = delta.shape[1]
    full = factor.full.copy()
    full[1:, 1 + width : 1 + width + factor.outputs] += factor.R[:, :width] @ delta.T
    moved = replace(factor, full=full)
    basis = find_states(moved, markov.theta + delta, future)
    return regressed_matrices(moved, basis.state_map(order), through)
