"""Estimate the Markov parameters of a predictor from a window factor: paper 000 eq. (9), (14), (23).

min ‖Y − Ξ Ψ‖², solved per output through the singular value decomposition Ψᵀ = U S Vᵀ of the triangular factor with
filter factors s²/(s² + λ²). The generalised cross-validation that picks λ scores exactly these filter factors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from aeolid.decompositions import svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.ridge import Spectrum, filter_factors
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
TINY = float(np.finfo(float).tiny)
OPEN = 30.0  # standard error of a direction's coefficient, signals of unit size: beyond it the data do not tell it


@dataclass(frozen=True, eq=False)
class MarkovEstimate:
    """Hold Ξ (l, p m + r) in the order of eq. (9) or (14), scaled units.

    Columns of inputs without feedthrough are zero. `excited` of `regressors` directions are above rounding, `rank` of
    them are told by the data and used;
    penalty (l,) the λ of each output relative to the largest singular value, 0 where Ξ is not of this regression;
    spread (p m + r, rank) and residual_covariance (l, l) give cov(vec Ξ) = residual_covariance ⊗ spread spreadᵀ (with
    the outputs' mean filter factors, where those differ). Where Ξ is a filter's, direct (p m + r, rank) is the spread
    of the fit to all windows, driven by the same noise, and bias (l, p m + r) what Ξ is off by; both None elsewhere.
    NaN in `spread` says that it is not known. columns: those of a window that Ξ leans on, None where it is all that are
    regressors.
    """

    theta: Array
    rank: int
    regressors: int
    condition: float
    penalty: Array
    spread: Array
    residual_covariance: Array
    direct: Array | None = None
    bias: Array | None = None
    excited: int = 0
    columns: tuple[int, ...] | None = None


def regressor_columns(factor: WindowFactor, feedthrough: tuple[bool, ...]) -> list[int]:
    """Return the columns of a window that are regressors: the past, and the present inputs with feedthrough."""
    past = factor.past * factor.channels
    return [*range(past), *(past + i for i, through in enumerate(feedthrough) if through)]


def pivot_columns(factor: WindowFactor, columns: list[int], rank: int) -> list[int]:
    """Return the first `rank` of these columns by QR with pivoting: each the one farthest from those before it."""
    order = qr(factor.R[:, columns], mode="r", pivoting=True)[1]
    return [columns[i] for i in sorted(order[:rank])]


def estimate_markov(
    factor: WindowFactor, feedthrough: tuple[bool, ...], regularization: str | float, solution: str = "smallest"
) -> MarkovEstimate:
    """Solve eq. (23) from the window factor.

    feedthrough: for each input, whether u_k acts on y_k; in a loop whose controller has feedthrough itself, D of that
    input cannot be identified without bias. regularization: "gcv", "none" or λ relative to the largest singular value.
    Singular values below max(N, q) ε of the largest are left out: they are rounding. So are those whose coefficient has
    a standard error above OPEN: where channels hang together to 1e-5 and less (exact data in binary32, or with few
    digits) and D of an input is held at zero, what that leaves would be sought there, by coefficients that ΓK brings to
    where the channels do not hang together. Rank and excited say so. solution: "smallest", or "pivoted", on as many
    columns as the rank has (see `solution`).
    """
    keep = every = regressor_columns(factor, feedthrough)
    U, s, Vt, R, rank, excited = _decomposed(factor, keep)
    condition = float(s[0] / max(s[-1], TINY))
    if solution == "pivoted":
        keep = pivot_columns(factor, every, rank)
        U, s, Vt, R, rank, _ = _decomposed(factor, keep)
    size, outputs = len(keep), factor.outputs
    targets = factor.past * factor.channels + factor.inputs
    projected = U[:, :rank].T @ R[:size, size:]  # (rank, l)
    total = (R[:, size:] ** 2).sum(axis=0)  # (l,): power of each output
    outside = np.maximum(total - (projected**2).sum(axis=0), 0.0)  # power no regressor reaches
    penalty, factors = filter_factors(Spectrum(s[:rank], projected, outside, factor.windows), regularization)
    shrink = factors / s[:rank]  # (l, rank)
    theta = np.zeros((outputs, targets))
    theta[:, keep] = (shrink * projected.T) @ Vt[:rank]
    error = (factor.y_now - factor.R[:, :targets] @ theta.T).T  # (l, q): residuals in the coordinates of R
    freedom = max(factor.windows - rank, 1)
    spread = np.zeros((targets, rank))
    spread[keep] = Vt[:rank].T * shrink.mean(axis=0)
    return MarkovEstimate(
        theta, rank, len(every), condition, penalty / s.max(initial=TINY), spread, error @ error.T / freedom,
        excited=excited, columns=tuple(keep) if solution == "pivoted" else None,
    )  # fmt: skip


def _decomposed(factor: WindowFactor, keep: list[int]) -> tuple[Array, Array, Array, Array, int, int]:
    """Return U, s, Vᵀ of these columns, the factor R of columns and targets, and how many are told and excited."""
    size = len(keep)
    R = triangularise(np.hstack([factor.R[:, keep], factor.y_now]))
    U, s, Vt = svd(R[:size, :size])
    excited = int(np.count_nonzero(s > s[0] * max(factor.windows, size) * np.finfo(float).eps))
    error_size = float(np.sqrt((R[size:, size:] ** 2).sum(axis=0).max() / max(factor.windows, 1)))
    rank = min(excited, int(np.count_nonzero(OPEN * s * np.sqrt(factor.windows) > error_size * s[0])))
    return U, s, Vt, R, rank, excited


def with_theta(estimate: MarkovEstimate, theta: Array, factor: WindowFactor) -> MarkovEstimate:
    """Return the estimate with another Ξ (l, p m + r); its residuals are computed anew."""
    error = factor.y_now - factor.R[:, : theta.shape[1]] @ theta.T
    covariance = error.T @ error / max(factor.windows - estimate.rank, 1)
    return replace(estimate, theta=theta, residual_covariance=covariance, penalty=np.zeros_like(estimate.penalty))


def require_excitation(estimate: MarkovEstimate, source: str) -> None:
    """Refuse data that excite fewer than half the regressors: whatever came out would be invention."""
    if estimate.excited * 2 < estimate.regressors:
        raise NotIdentifiable(
            f"{source}: the data excite {estimate.excited} of {estimate.regressors} regressors; excite every input "
            "over the frequencies of interest, or use a shorter past window"
        )
