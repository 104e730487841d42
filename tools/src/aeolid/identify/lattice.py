"""Estimate the Markov parameters of the VARX predictor by least-squares lattice recursions: paper 003.

Two block estimators that need no regressor matrix: from sample covariances, and from the forward and backward residuals
themselves. Corrections to the note: the lattice runs on all m channels (with 𝓘 = [0 I] eq. (13) and (16) do not close)
and the last l rows are taken at the end; the products of eq. (7)–(10) are z_{k−j} z_{k−t}ᵀ; φ_{−t} = φ_tᵀ; covariances
have 1/N, because with 1/(N − t) eq. (17) may lose its sign; reflections of residuals are geometric means, because those
of eq. (22) do not keep E > 0; u_k is regressed on last, because the note has no D.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.streamed import StreamedMarkov, theta_in_units
from aeolid.identify.windows import Scaling
from aeolid.models.prediction import complete_stretches
from aeolid.record import Record

Array = NDArray[np.float64]
LOADING = 1e-10  # white noise of this power, relative to each channel's, keeps channels that determine each other apart


@dataclass(frozen=True, eq=False)
class Predictors:
    """Hold the predictors of one order j: z_k = Σ Ξ_i z_{k−i} + e_k and z_{k−j−1} = Σ Θ_i z_{k−j−1+i} + r.

    forward Ξ (j, m, m), backward Θ (j, m, m), the nearest sample first; forward_covariance E^f (m, m),
    backward_covariance E^b (m, m), both positive definite.
    """

    forward: Array
    backward: Array
    forward_covariance: Array
    backward_covariance: Array

    def raise_order(self, cross: Array) -> Predictors:
        """Return the predictors of order j + 1 for Δ_{j+1} (m, m): eq. (16) to (20)."""
        last = _divide(cross, self.backward_covariance)  # Ξ_{j+1,j+1} = Δ (E^b)⁻¹
        first = _divide(cross.T, self.forward_covariance)  # Θ_{j+1,j+1} = Δᵀ (E^f)⁻¹
        forward = np.concatenate([self.forward - last @ self.backward[::-1], last[None]])
        backward = np.concatenate([self.backward - first @ self.forward[::-1], first[None]])
        return Predictors(
            forward,
            backward,
            _symmetric(self.forward_covariance - last @ cross.T),
            _symmetric(self.backward_covariance - first @ cross),
        )


@dataclass(frozen=True, eq=False)
class LatticeEstimate:
    """Hold what a block lattice found, for z = [u; y] scaled.

    theta Ξ (l, p m + r): order of paper 000 eq. (9), oldest block first, columns of inputs without feedthrough zero.
    predictors: of all m channels at order p. residual_covariance (l, l); samples used; method "covariance" or
    "prediction-error".
    """

    theta: Array
    predictors: Predictors
    residual_covariance: Array
    samples: int
    method: str

    def to_streamed(self, scaling: Scaling, feedthrough: Sequence[bool]) -> StreamedMarkov:
        """Return Ξ in the channels' units, as `identify_varx(markov=…)` takes it.

        scaling: the one of the estimate; feedthrough: for each input, whether its present value is a regressor.
        """
        r, m = len(scaling.inputs), scaling.channels
        past = (self.theta.shape[1] - r) // m
        units = theta_in_units(self.theta, scaling, past)
        keep = [*range(past * m), *(past * m + i for i in range(r) if feedthrough[i])]
        return StreamedMarkov(units[:, keep], f"lattice, {self.method}")


def estimate_by_covariance(
    records: Sequence[Record], scaling: Scaling, past: int, feedthrough: Sequence[bool]
) -> LatticeEstimate:
    """Estimate Ξ from sample covariances: eq. (14) to (21).

    records: merged, no product spans two of them or a missing sample. scaling: `find_scaling(records)`. past: p ≥ 1.
    feedthrough: for each input, whether u_k acts on y_k. Samples outside a stretch count as 0, which keeps E^f, E^b
    positive definite and biases Ξ by O(p/N) of the signal.
    Raises UsageError on a past window below 1 or a mask of another length, NotIdentifiable on too few samples.
    Cost: N p m² + p² m³ operations; memory of the samples.
    """
    stretches = _require_stretches(records, scaling, past, feedthrough)
    predictors = solve_yule_walker(sample_covariances(stretches, past), past)
    return _finish(predictors, scaling, feedthrough, stretches, "covariance", predictors.forward_covariance)


def estimate_by_prediction_error(
    records: Sequence[Record], scaling: Scaling, past: int, feedthrough: Sequence[bool]
) -> LatticeEstimate:
    """Estimate Ξ from forward and backward residuals: eq. (22).

    As `estimate_by_covariance`, but nothing is taken as 0: averages run over the samples where both residuals exist,
    so short records and narrow resonances come out sharper. The reflection is the geometric mean
    Δ = E^f½ P^f−½ P^fb P^b−½ᵀ E^b½ᵀ (P averages of residuals, factors of Cholesky), whose singular values stay below 1.
    Cost: 3 N p m² operations; memory three times the samples.
    """
    stretches = _require_stretches(records, scaling, past, feedthrough)
    power = sample_covariances(stretches, 0)[0]
    covariance, noise = _load(power), _noise(power)
    m = len(covariance)
    predictors = Predictors(np.zeros((0, m, m)), np.zeros((0, m, m)), covariance, covariance)
    forward = backward = stretches
    for _ in range(past):
        forward = [f[1:] for f in forward]
        backward = [b[:-1] for b in backward]  # (N − j − 1, m): r_j(k−1) beside e_j(k)
        following = predictors.raise_order(_find_cross(forward, backward, predictors, noise))
        last, first = following.forward[-1], following.backward[-1]
        forward, backward = (
            [f - b @ last.T for f, b in zip(forward, backward, strict=True)],
            [b - f @ first.T for f, b in zip(forward, backward, strict=True)],
        )
        predictors = following
    residual = _load(sample_covariances(forward, 0)[0])
    return _finish(predictors, scaling, feedthrough, stretches, "prediction-error", residual)


def sample_covariances(stretches: Iterable[Array], past: int) -> Array:
    """Return φ_t = (1/N) Σ z_k z_{k−t}ᵀ, t = 0 … p, as (p + 1, m, m).

    stretches: samples (N_i, m) without a gap, zero outside; past: p ≥ 0. With 1/N, N = Σ N_i, the matrix of eq. (11)
    is positive semidefinite whatever the samples.

    >>> sample_covariances([np.array([[1.0], [2.0], [-1.0]])], 1).ravel().tolist()
    [2.0, 0.0]
    """
    total, sums = 0, np.zeros(0)
    for z in stretches:
        lags = [z[t:].T @ z[: len(z) - t] if t < len(z) else np.zeros((z.shape[1],) * 2) for t in range(past + 1)]
        sums = np.array(lags) if total == 0 else sums + lags
        total += len(z)
    return sums / max(total, 1)


def solve_yule_walker(covariances: Array, past: int) -> Predictors:
    """Solve eq. (11), (12) by the Levinson–Durbin recursion.

    covariances: φ_t (≥ p + 1, m, m), t = 0 first; past: p ≥ 0. White noise of 1e-10 of their power is added to φ_0,
    so that channels which determine each other still have a solution. Cost: p² m³ operations.
    Raises NotIdentifiable when the φ_t are no covariances: E^f or E^b not positive definite.

    >>> float(solve_yule_walker(np.array([[[1.0]], [[0.5]], [[0.25]]]), 2).forward[0, 0, 0].round(9))
    0.5
    """
    start = _load(covariances[0])
    m = len(start)
    predictors = Predictors(np.zeros((0, m, m)), np.zeros((0, m, m)), start, start)
    for j in range(past):
        # Δ_{j+1} = φ_{j+1} − Σ_i Ξ_i φ_{j+1−i}: eq. (14)
        cross = covariances[j + 1] - np.einsum("iab,ibc->ac", predictors.forward, covariances[j:0:-1])
        predictors = predictors.raise_order(cross)
    _cholesky(predictors.forward_covariance)
    return predictors


def _find_cross(forward: Sequence[Array], backward: Sequence[Array], predictors: Predictors, noise: Array) -> Array:
    """Return Δ (m, m) of the geometric mean reflection, such that the next E^f and E^b are at least noise (m, m)."""
    f, b = np.concatenate(forward), np.concatenate(backward)
    own, other = _cholesky(f.T @ f + len(f) * noise), _cholesky(b.T @ b + len(b) * noise)
    rho = solve_triangular(other, solve_triangular(own, f.T @ b, lower=True).T, lower=True).T  # P^f−½ P^fb P^b−½ᵀ
    left, right = _cholesky(predictors.forward_covariance), _cholesky(predictors.backward_covariance)
    out: Array = left @ _leave(left, noise) @ rho @ _leave(right, noise) @ right.T
    return out


def _leave(factor: Array, noise: Array) -> Array:
    """Return (I − C)½ (m, m), C the noise seen through the factor of E ≥ noise.

    What E has above the noise may be predicted: ρ ρᵀ ≤ I − C gives E½ (I − ρ ρᵀ) E½ᵀ ≥ noise. A line spectrum would
    otherwise take E below rounding, order after order.
    """
    seen = solve_triangular(factor, np.sqrt(noise), lower=True)
    values, vectors = np.linalg.eigh(seen @ seen.T)
    out: Array = (vectors * np.sqrt(np.maximum(1.0 - values, 0.0))) @ vectors.T
    return out


def _finish(
    predictors: Predictors, scaling: Scaling, feedthrough: Sequence[bool], stretches: Sequence[Array], method: str,
    residual: Array,
) -> LatticeEstimate:  # fmt: skip
    """Take the rows of y, after a last regression on the present inputs, in the order of eq. (9)."""
    r = len(scaling.inputs)
    through = [i for i in range(r) if feedthrough[i]]
    # y_k − D u_k = (Ξ_y − D Ξ_u) past: D from what is left of both, D = E_yu E_uu⁻¹
    D = np.zeros((len(residual) - r, r))
    if through:
        D[:, through] = _divide(residual[r:, through], residual[np.ix_(through, through)])
    rows = np.hstack([-D, np.eye(len(D))])  # (l, m)
    blocks = [rows @ block for block in predictors.forward[::-1]]
    theta = np.hstack([*blocks, D])
    samples = sum(len(z) for z in stretches)
    return LatticeEstimate(theta, predictors, _symmetric(rows @ residual @ rows.T), samples, method)


def _require_stretches(
    records: Sequence[Record], scaling: Scaling, past: int, feedthrough: Sequence[bool]
) -> list[Array]:
    """Return the scaled stretches (N_i, m) without a missing sample that are longer than p."""
    if past < 1:
        raise UsageError(f"past window {past} is not at least 1")
    if len(feedthrough) != len(scaling.inputs):
        raise UsageError(f"feedthrough has {len(feedthrough)} entries for {len(scaling.inputs)} inputs")
    found = []
    for record in records:
        z = scaling.apply(record.columns(scaling.inputs + scaling.outputs))
        found += [z[a:b] for a, b in complete_stretches(z, past + 1)]
    pairs, needed = sum(len(z) - past for z in found), scaling.channels + 1
    if pairs < needed:
        raise NotIdentifiable(
            f"{records[0].source if records else 'no recording'}: {max(pairs, 0)} samples have a complete past window "
            f"of {past}; {scaling.channels} channels need at least {needed}; record longer or shorten the window"
        )
    return found


def _noise(covariance: Array) -> Array:
    """Return the covariance (m, m) of white noise far below each channel."""
    out: Array = np.diag(np.maximum(LOADING * np.diag(covariance), float(np.finfo(float).tiny)))
    return out


def _load(covariance: Array) -> Array:
    """Add the white noise that keeps a covariance (m, m) positive definite."""
    return _symmetric(covariance) + _noise(covariance)


def _symmetric(matrix: Array) -> Array:
    out: Array = (matrix + matrix.T) / 2
    return out


def _cholesky(covariance: Array) -> Array:
    try:
        L: Array = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise NotIdentifiable(
            "the channels are predictable from each other to rounding; add excitation or leave out a channel"
        ) from None
    return L


def _divide(left: Array, covariance: Array) -> Array:
    """Return left (a, m) times the inverse of a covariance (m, m)."""
    L = _cholesky(covariance)
    out: Array = solve_triangular(L.T, solve_triangular(L, left.T, lower=True), lower=False).T
    return out
