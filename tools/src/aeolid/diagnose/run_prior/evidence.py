"""Evidence of a recording under a predictor whose prior is a simulator's run, in closed form.

The predictor y_k = Θ z̄_k + e_k of the recording, paper 000 eq. (9), is near that of the run:
Θ ~ N(Θ_run, Σ ⊗ (w G_run)⁻¹). w = 1 says that the run's windows count like the recording's own, w → 0 that the run
says nothing. With Σ at its best value the log evidence is

  −n/2 log|S/n| − l/2 (log|G + w G_run| − log|w G_run|),
  S = Y Yᵀ + w Θ_run G_run Θ_runᵀ − X (G + w G_run)⁻¹ Xᵀ, X = Y Zᵀ + w Θ_run G_run.

Several regions of operation (wind speeds) have a predictor each and one weight: their evidence adds up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, cholesky, solve_triangular

from aeolid.diagnose.run_prior.grams import Gram, Moments

Array = NDArray[np.float64]
WEIGHTS = 10.0 ** (-0.5 * np.arange(9) + 0.5)  # of the run's windows: 3.16 … 3.2e-4
FREE_MEAN = 1.0  # precision of the constant: a mean may move by about one innovation's deviation
_MEMORIES = (2.0, 3.0, 5.0, 7.0, 10.0, 20.0)  # τ in lags
_RIDGES = (-8, -7, -6, -5, -4, -3, -2, -1, 0)  # κ, powers of ten
_STEEPEST, _LEVEL = 30.0, 1e-6  # exponent at which the ridge holds still; precision of the run's own constant
FREE_EXTRA = 1e-2  # precision of what a hypothesis adds: free


@dataclass(frozen=True, eq=False)
class Prior:
    """Hold what a run says of one region: precision (q, q) of its windows with its mean (q, l), and log|precision|."""

    precision: Array
    pull: Array  # precision @ mean
    square: Array  # meanᵀ precision mean
    log_det: float

    @property
    def size(self) -> int:
        """Return how many regressors have a weight that scales: all but the constant."""
        return len(self.precision)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Hold the log evidence in nats, the weight of the run, and the innovations' covariance (l, l)."""

    nats: float
    weight: float
    covariance: Array


Priors = tuple[Prior, ...]  # by region


def prior_of(run: Moments, shrinkage: Array) -> Priors:
    """Return by region the prior that a run's windows give, its own regression shrunk by `shrinkage` (q − 1,)."""
    return tuple(_prior(g, shrinkage) for g in run.regions)


def _prior(run: Gram, shrinkage: Array) -> Prior:
    k = len(shrinkage)  # the constant stands last; its mean is known, its precision is not the run's
    precision = run.Z.copy()
    precision[np.arange(k), np.arange(k)] += shrinkage
    precision[k, k] += 1e-6 * run.count
    mean = np.linalg.solve(precision, run.ZY)
    core = precision[:k, :k]
    return Prior(core, np.vstack([core @ mean[:k], FREE_MEAN * mean[k:]]), mean[:k].T @ core @ mean[:k], _log_det(core))


def shrinkage_of(run: Moments, past: int, channels: int) -> Array:
    """Return the ridge (q − 1,) that makes the run's own windows most likely.

    κ exp(2 i/τ) for a coefficient of lag i, in windows of unit variance: what is long ago matters less, so that the
    coefficients decay. κ and τ are those of most evidence on a grid.
    """
    now = len(run.regions[0].Z) - 1 - past * channels
    lags = np.concatenate([np.repeat(np.arange(1.0, past + 1), channels), np.zeros(now)])
    ridges = [10.0**k * np.exp(np.minimum(2 * lags / tau, _STEEPEST)) for tau in _MEMORIES for k in _RIDGES]
    found: Array = max(ridges, key=lambda ridge: sum(_own_evidence(g, ridge) for g in run.regions))
    return found


def _own_evidence(run: Gram, ridge: Array) -> float:
    k, outputs = len(ridge), run.ZY.shape[1]
    H = run.Z.copy()
    H[np.arange(k), np.arange(k)] += ridge
    H[k, k] += _LEVEL
    try:
        c = cholesky(H, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return -np.inf
    X = solve_triangular(c, run.ZY, lower=True, check_finite=False)
    sign, log_s = np.linalg.slogdet((run.YY - X.T @ X) / run.count)
    if sign <= 0:
        return -np.inf
    return float(-0.5 * run.count * log_s - 0.5 * outputs * (2 * np.log(np.diag(c)).sum() - np.log(ridge).sum()))


def evidence(prior: Priors, recording: Moments, start: float | None = None) -> Evidence:
    """Return the evidence at the weight that is most likely, found on the grid of WEIGHTS.

    start: a weight to begin at; the search then climbs from there (two to four evaluations instead of nine).
    """
    known: dict[int, tuple[float, Array]] = {}

    def at(i: int) -> float:
        if i not in known:
            known[i] = _at(prior, recording, float(WEIGHTS[i]))
        return known[i][0]

    if start is None:
        best = max(range(len(WEIGHTS)), key=at)
    else:
        best = int(np.argmin(np.abs(np.log(WEIGHTS / start))))
        while True:
            near = [i for i in (best - 1, best, best + 1) if 0 <= i < len(WEIGHTS)]
            top = max(near, key=at)
            if top == best:
                break
            best = top
    return Evidence(at(best), float(WEIGHTS[best]), known[best][1])


def lost_by(prior: Priors, recording: Moments, best: Evidence) -> float:
    """Return the nats that a recording loses against its best weight when the run counts fully, or more than that."""
    return best.nats - max(evidence_at(prior, recording, float(w)) for w in WEIGHTS if w >= 1.0)


def evidence_at(prior: Priors, recording: Moments, weight: float) -> float:
    """Return the log evidence in nats at a weight of the run."""
    return _at(prior, recording, weight)[0]


def covariance_at(prior: Priors, recording: Moments, weight: float) -> Array:
    """Return the innovations' covariance (l, l) at a weight of the run."""
    return _at(prior, recording, weight)[1]


def _at(priors: Priors, recording: Moments, w: float) -> tuple[float, Array]:
    found = [_of_region(p, g, w) for p, g in zip(priors, recording.regions, strict=True)]
    mean: Array = np.sum([g.count * c for g, (_, c) in zip(recording.regions, found, strict=True)], axis=0)
    return sum(nats for nats, _ in found), mean / recording.count


def _of_region(prior: Prior, G: Gram, w: float) -> tuple[float, Array]:
    k, q, outputs = prior.size, len(G.Z), G.ZY.shape[1]
    H, b = _precision(prior, G, w), _pulled(prior, G, w)
    try:
        c = cholesky(H, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return -np.inf, np.eye(outputs)
    X = solve_triangular(c, b, lower=True, check_finite=False)
    mean_square = np.outer(prior.pull[k], prior.pull[k]) / FREE_MEAN
    S = G.YY + w * prior.square + mean_square - X.T @ X
    half = np.log(np.diag(c)).sum()
    prior_det = prior.log_det + k * np.log(w) + np.log(FREE_MEAN) + (q - k - 1) * np.log(FREE_EXTRA)
    sign, log_s = np.linalg.slogdet(S / G.count)
    if sign <= 0 or not np.isfinite(log_s):
        return -np.inf, np.eye(outputs)
    return float(-0.5 * G.count * log_s - 0.5 * outputs * (2 * half - prior_det)), S / G.count


def posterior(priors: Priors, recording: Moments, w: float) -> tuple[Array, ...]:
    """Return by region the coefficients (q, l) of most posterior density at a weight of the run."""
    both = zip(priors, recording.regions, strict=True)
    return tuple(cho_solve(cho_factor(_precision(p, g, w), lower=True), _pulled(p, g, w)) for p, g in both)


def _precision(prior: Prior, G: Gram, w: float) -> Array:
    k, q = prior.size, len(G.Z)
    H = G.Z.copy()
    H[:k, :k] += w * prior.precision
    H[k, k] += FREE_MEAN
    H[np.arange(k + 1, q), np.arange(k + 1, q)] += FREE_EXTRA
    return H


def _pulled(prior: Prior, G: Gram, w: float) -> Array:
    k = prior.size
    b = G.ZY.copy()
    b[:k] += w * prior.pull[:k]
    b[k] += prior.pull[k]
    return b


def _log_det(matrix: Array) -> float:
    return float(2 * np.log(np.diag(cholesky(matrix, lower=True, check_finite=False))).sum())
