"""Evaluate the condition under which extended least squares is known to converge: paper 000 eq. (25).

With p l above the order of the system Ξ is not unique: a longer window can put its memory into the past of the outputs
or into that of the innovations. The proof of convergence needs one Ξ that predicts right and whose H̄ satisfies (25), so
the condition is evaluated for the smallest moving average among the Ξ that predict as well as data can tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from aeolid.decompositions import pinv, singular_values, spectral_norm
from aeolid.identify.markov import regressor_columns
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
STEPS = 10  # halvings of the range of the weight, 1e-10 … 1e4 of the largest: 1/70 of a decade is left
RANK = 1e-3  # of the largest eigenvalue of the innovation covariance; below it a direction counts as free of noise
POINTS = 1024  # frequencies from 0 to the Nyquist frequency, both included
BESIDE = np.array([0, 1, 2, 4, 8, 16])  # distances from a zero's angle, in its distance to the unit circle


@dataclass(frozen=True)
class PositiveReal:
    """Hold the verdict on Re H̄(e^{iω})⁻¹ > 1/2.

    margin: the smallest eigenvalue of the Hermitian part of H̄⁻¹ over all frequencies, less 1/2; frequency_hz: where;
    radius: the largest magnitude of the zeros of det H̄ (the predictor forgets when it is below 1); rank of `outputs`:
    directions that noise reaches, the only ones that count. remaining: the largest singular value of H̄ − I over all
    frequencies, below 1 exactly where the margin is above 0: a pass whose regressors hold ê = e + d leaves residuals
    e − (H̄ − I) d, so that this is the part of an error in the innovations that a pass leaves where it is largest.
    """

    margin: float
    frequency_hz: float
    radius: float
    rank: int
    outputs: int
    remaining: float

    @property
    def holds(self) -> bool:
        """Tell whether the condition of convergence is met; accuracy is another matter."""
        return self.margin > 0 and self.radius < 1

    @property
    def text(self) -> str:
        """Return the verdict as one sentence."""
        if self.holds:
            return (
                f"the positive-real condition of convergence is met with a margin of {self.margin:.2f} (smallest at "
                f"{self.frequency_hz:.3g} Hz): a pass of extended least squares leaves at most {self.remaining:.0%} of "
                "the error of the innovations. That says nothing about how accurate the model is: judge it by its "
                "deviations and on a recording held out (aeolid validate)"
            )
        if self.radius >= 1:
            return (
                f"the positive-real condition fails: a zero of the noise polynomial at {self.radius:.4f} lies on or "
                "outside the unit circle, the predictor does not forget its start; convergence is not guaranteed"
            )
        return (
            f"the positive-real condition fails by {-self.margin:.2f} near {self.frequency_hz:.3g} Hz: convergence of "
            "extended least squares is not guaranteed by theory, judge it by the residuals"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as JSON facts."""
        return {
            "holds": self.holds, "error_left_by_a_pass": self.remaining, "margin": self.margin,
            "frequency_hz": self.frequency_hz,
            "zero_radius": self.radius, "innovation_rank": self.rank, "outputs": self.outputs, "verdict": self.text,
        }  # fmt: skip


def least_moving_average(factor: WindowFactor, feedthrough: tuple[bool, ...]) -> Array:
    """Return the Ξ (l, p m + r) with the smallest columns of e that predicts as well as data can tell.

    min ‖Y − Ξ Ψ‖² + μ ‖Ξᵉ‖² with the largest μ whose mean log error power stays within p l/N of the least: that is what
    as many columns without any meaning would gain.
    """
    keep, l = regressor_columns(factor, feedthrough), factor.outputs  # noqa: E741
    width, m = factor.past * factor.channels, factor.channels
    R = triangularise(np.hstack([factor.R[:, keep], factor.y_now]))
    place = np.array(keep)
    noise = np.where((place < width) & (place % m >= factor.inputs + l), 1.0, 0.0)
    size = spectral_norm(R[:, : len(keep)])

    def solve(weight: float) -> tuple[Array, float]:
        penalty = np.diag(size * np.maximum(np.sqrt(weight) * noise, 1e-9))  # the floor decides what data leave open
        factor = triangularise(np.vstack([R, np.hstack([penalty, np.zeros((len(keep), l))])]))
        theta = solve_triangular(factor[: len(keep), : len(keep)], factor[: len(keep), len(keep) :])
        power = ((R[:, len(keep) :] - R[:, : len(keep)] @ theta) ** 2).sum(axis=0)
        return theta, float(np.mean(np.log(np.maximum(power, 1e-300))))

    low, high = -10.0, 4.0
    best, power = solve(0.0)
    limit = power + factor.past * l / max(factor.windows, 1)
    for _ in range(STEPS):
        middle = (low + high) / 2
        theta, reached = solve(10.0**middle)
        if reached <= limit:
            best, low = theta, middle
        else:
            high = middle
    out = np.zeros((l, width + factor.inputs))
    out[:, keep] = best.T
    return out


def noise_polynomial(theta: Array, past: int, inputs: int) -> Array:
    """Return the coefficients I, Ξᵉ_1 … Ξᵉ_p of H̄(z) as (p + 1, l, l), from Ξ in the order of eq. (14)."""
    outputs = theta.shape[0]
    m = inputs + 2 * outputs
    blocks = theta[:, : past * m].reshape(outputs, past, m)[:, ::-1, inputs + outputs :]  # newest first
    return np.concatenate([np.eye(outputs)[None], blocks.transpose(1, 0, 2)])


def check_positive_real(theta: Array, past: int, inputs: int, covariance: Array, sample_time_s: float) -> PositiveReal:
    """Evaluate (25) from the estimated H̄, for several outputs as λ_min(H̄⁻¹ + H̄⁻ᴴ)/2 > 1/2 at every frequency.

    theta (l, ≥ p m) of eq. (14), covariance (l, l) of the innovations, in the same units. The condition is taken in the
    coordinates w of e = L w, cov(w) = I, which makes it free of the outputs' units: all outputs share one regressor,
    so the estimate, and with it its convergence, is the same in any coordinates. Directions that no noise reaches carry
    no innovation and are left out. Cost: POINTS + 11 p l inversions of size l.

    >>> theta = np.array([[0.0, 0.0, 0.5]])  # y_k = e_k + 0.5 e_{k−1}: Re 1/(1 + 0.5 z⁻¹) is least at ω = 0
    >>> verdict = check_positive_real(theta, 1, 1, np.eye(1), 1.0)
    >>> round(verdict.margin, 3), verdict.holds
    (0.167, True)
    """
    values, vectors = np.linalg.eigh(covariance)
    kept = values > max(RANK * values[-1], np.finfo(float).tiny)
    outputs, rank = len(values), int(np.count_nonzero(kept))
    if rank == 0:  # exact data: nothing to predict from, nothing that could diverge
        return PositiveReal(0.5, 0.0, 0.0, 0, outputs, 0.0)
    L = vectors[:, kept] * np.sqrt(values[kept])  # (l, k)
    back = vectors[:, kept].T / np.sqrt(values[kept])[:, None]  # (k, l), back L = I
    H = np.einsum("kl,plm,mj->pkj", back, noise_polynomial(theta, past, inputs), L)
    zeros = _zeros(H)
    frequency = _frequencies(zeros)
    turn = np.exp(-1j * np.outer(frequency, np.arange(len(H))))
    response = np.einsum("fp,pkj->fkj", turn, H)
    with np.errstate(all="ignore"):
        inverse = pinv(response)
    least = np.linalg.eigvalsh((inverse + inverse.conj().transpose(0, 2, 1)) / 2)[:, 0]
    place = int(np.argmin(least))
    hertz = float(frequency[place] / (2 * np.pi * sample_time_s)) if sample_time_s > 0 else 0.0
    radius = float(abs(zeros).max(initial=0.0))
    remaining = float(singular_values(response - np.eye(rank)).max())
    return PositiveReal(float(least[place] - 0.5), hertz, radius, rank, outputs, remaining)


def _zeros(H: Array) -> NDArray[np.complex128]:
    """Return the zeros (p k,) of det H(z), H (p + 1, k, k) monic, through its block companion matrix."""
    order, k = len(H) - 1, H.shape[1]
    companion = np.eye(order * k, k=-k)
    companion[:k] = -np.hstack(list(H[1:]))
    return np.linalg.eigvals(companion).astype(complex)


def _frequencies(zeros: NDArray[np.complex128]) -> Array:
    """Return where to look, radians a sample: evenly, and around the zeros of det H̄.

    With δ the distance of a zero to the circle, Re 1/(1 − z₀ e^{−iω}) and its products dip within a few δ of the zero's
    angle, which may be far below the even spacing; a ladder of factor 2 meets the dip within 6 % of its depth.
    """
    steps = np.outer(np.concatenate([-BESIDE[:0:-1], BESIDE]), abs(1.0 - abs(zeros)))
    beside = (abs(np.angle(zeros)) + steps).ravel()
    beside = beside[(beside > 0) & (beside < np.pi)]
    out: Array = np.sort(np.concatenate([np.linspace(0.0, np.pi, POINTS), beside]))
    return out
