"""Ask which equation noise has to make up for, and which declared value does not stay what it is (S3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.predictor.quiet import audible
from aeolid.diagnose.predictor.sensitivity import Variant, columns, noise_variant, step_of, theta_variant
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.blocks import Blocks, blocks_of, redrawn, shares_of, standardiser
from aeolid.diagnose.stats.numbers import finite
from aeolid.diagnose.stats.projection import outside, span
from aeolid.diagnose.structure.forces import FORCE, RATE

Array = NDArray[np.float64]
_DRAWS = 999
_COSINES = 4  # of a random walk about its mean: 87 % of its variance
_REFIT = 2  # Gauss–Newton iterations without an equation's noise, from where the fit stands


@dataclass(frozen=True, eq=False)
class Score:
    """Hold a fair z as in the score bank, and what it would be without anything to find: null (draws,)."""

    z: float
    null: Array


def deficient(prepared: Prepared, seed: int) -> list[dict[str, Any]]:
    """Rank the equations and the declared values of a baseline in equations by what they leave to noise or to time.

    A state: nats that the fit loses without the noise of its equation, white and with memory, the rest refitted in
    brief; the score of a noise that is free is zero where the fit stands. A state that no force drives: the projected
    score of noise in its equation. A parameter: the projected score of a random walk, its sensitivity times the first
    cosines. Empty for linear models and simulators' runs, whose coordinates are nobody's equations.
    """
    bare = prepared.only(())
    if bare.linear is not None or bare.fit.point.K is not None:
        return []
    rows = [*_driven(bare), *_scored(bare, seed)]
    return sorted(rows, key=lambda r: -_excess(r))


def _excess(row: dict[str, Any]) -> float:
    statistic = row["statistic"]
    return np.inf if statistic is None else float(statistic / row["threshold"])


def _driven(bare: Prepared) -> list[dict[str, Any]]:
    """Return what each equation's noise is worth, in nats."""
    model, fit = bare.extended, bare.fit
    states = {s.name: i for i, s in enumerate(model.states)}
    driven = [s for s in bare.declared.states if states[s.name] in fit.free.noise]
    level = in_force().localise.false_alarm_level
    limit = 0.5 * float(chdtri(3, level / max(len(driven), 1)))  # white noise, a force, the force's memory
    best = bare.predictor.objective(fit.point)
    rows = []
    for state in driven:
        lost = _lost(bare, [states[n] for n in (state.name, FORCE + state.name) if n in states], best)
        rows.append(_row("state", state.name, "noise its equation needs", finite(lost), limit, "nats"))
    return rows


def _lost(bare: Prepared, silent: Sequence[int], best: float) -> float:
    """Return the nats that the fit loses with these states' noise at none."""
    fit, model = bare.fit, bare.extended
    noise = fit.point.noise.copy()
    noise[list(silent)] = 0.0
    rates = {RATE + model.states[i].name.removeprefix(FORCE) for i in silent}
    free = replace(
        fit.free,
        theta=tuple(i for i in fit.free.theta if model.parameters[i].name not in rates),
        noise=tuple(i for i in fit.free.noise if i not in silent),
    )
    found = bare.predictor.climb(replace(fit.point, noise=noise), free, iterations=_REFIT)
    return np.inf if found is None else max(found[0] - best, 0.0)


def _scored(bare: Prepared, seed: int) -> list[dict[str, Any]]:
    """Return the projected scores of noise where no force drives, and of declared values that wander."""
    fit, model, predictor = bare.fit, bare.extended, bare.predictor
    own = {p.name for p in bare.declared.parameters}
    asked = [i for i, p in enumerate(model.parameters) if p.name in own]
    names = [s.name for s in model.states]
    still = [i for i in (names.index(s.name) for s in bare.declared.states) if i not in fit.free.noise]
    moved = _columns(predictor, fit.point, asked, still, bare)
    basis = span(np.vstack([fit.jacobian, fit.prior_jacobian])[:, audible(model, fit)])
    outputs = predictor.segments[0].y.shape[1]
    blocks = blocks_of(len(fit.residual) // outputs, outputs, len(fit.prior_residual), seed, _DRAWS)
    residual = np.concatenate([fit.residual, fit.prior_residual])
    rows, largest = [], np.zeros(_DRAWS)
    found = [wander(moved[:, k], basis, residual, blocks, outputs) for k in range(len(asked))]
    found += [stirred(moved[:, len(asked) + k], basis, residual, blocks) for k in range(len(still))]
    for w in (w for w in found if w is not None):
        largest = np.maximum(largest, w.null)
    limit = float(np.quantile(largest, 1 - in_force().localise.false_alarm_level))
    for i, told in zip(asked, found, strict=False):
        if told is not None:
            rows.append(_row("parameter", model.parameters[i].name, "wanders in time", told.z, limit, "z"))
    for i, told in zip(still, found[len(asked) :], strict=True):
        if told is not None:
            rows.append(_row("state", names[i], "noise where no force acts", told.z, limit, "z"))
    return rows


def _columns(predictor: Predictor, point: Point, asked: Sequence[int], still: Sequence[int], bare: Prepared) -> Array:
    """Return the sensitivities (M + p, k) of parameters and of noise in states at rest; the prior says nothing."""
    fit = bare.fit
    variants = [theta_variant(point, {i: step_of(predictor, i, point)}) for i in asked]
    variants += [noise_variant(point, i) for i in still]
    base = predictor.whitened(predictor.innovations(point), fit.noise)
    found = columns(predictor, point, fit.noise, base, [*variants, Variant(point, 1.0)])
    # less what rounds otherwise side by side: of a value that acts nowhere nothing is left
    moved = found[:, :-1] - found[:, -1:] / np.array([v.h for v in variants])
    moved = np.where(np.all(np.isfinite(moved), axis=0), moved, 0.0)  # a small step made the model run away
    return np.vstack([moved, np.zeros((len(fit.prior_residual), len(variants)))])


def wander(column: Array, basis: Array, residual: Array, blocks: Blocks, outputs: int) -> Score | None:
    """Score a random walk of one parameter with this sensitivity (M,); None where the baseline absorbs it.

    A random walk about its mean moves in cosines of m half periods over the recording, its variance with 1/m²
    (Karhunen and Loève); the first four are asked together: LM = pᵀ C⁻¹ p, p the residual on what the baseline's basis
    (M, q) leaves of sensitivity times cosine, C its covariance over blocks, never less than white noise's.
    """
    scoring = in_force().scoring
    time = np.arange(len(column)) // outputs
    phase = np.pi * (time + 0.5) / max(len(column) // outputs, 1)
    G = column[:, None] * np.cos(phase[:, None] * np.arange(1, _COSINES + 1))
    projected, size = outside(G, basis), np.linalg.norm(G, axis=0)
    keep = np.linalg.norm(projected, axis=0) > scoring.absorbed_share * np.maximum(size, 1e-300)
    if not np.all(keep) or not np.all(np.isfinite(size)):
        return None
    H, R = np.linalg.qr(projected / size)
    if np.min(np.abs(np.diag(R))) < scoring.absorbed_share:
        return None
    point = H.T @ residual
    shares = shares_of(H, residual, blocks)
    z = _z(point @ standardiser(shares.T @ shares))
    return Score(float(z), _z(redrawn(shares, blocks)))


def stirred(column: Array, basis: Array, residual: Array, blocks: Blocks) -> Score | None:
    """Score noise that is not there, of this sensitivity (M,): one-sided, for a variance cannot be less than none."""
    projected, size = outside(column[:, None], basis), float(np.linalg.norm(column))
    length = float(np.linalg.norm(projected))
    if not size > 0 or length <= in_force().scoring.absorbed_share * size:
        return None
    H = projected / length
    shares = shares_of(H, residual, blocks)
    point = np.maximum(H.T @ residual @ standardiser(shares.T @ shares), 0.0)
    return Score(float(_z(point)), _z(np.maximum(redrawn(shares, blocks), 0.0)))


def _z(standard: Array) -> Array:
    """Return sqrt(2 LM) − sqrt(2 df − 1) of standardised projections (…, df)."""
    freedom = standard.shape[-1]
    result: Array = np.sqrt(2 * np.sum(standard**2, axis=-1)) - np.sqrt(2 * freedom - 1)
    return result


def _row(what: str, name: str, asked: str, statistic: float | None, limit: float, scale: str) -> dict[str, Any]:
    beyond = statistic is None or statistic > limit
    return {
        "what": what, "name": name, "asked": asked, "statistic": statistic, "threshold": limit, "scale": scale,
        "significant": bool(beyond),
    }  # fmt: skip
