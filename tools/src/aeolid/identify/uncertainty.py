"""Push the noise of the Markov parameters through PBSIDopt to the matrices, and on to the poles.

First-order analysis (van Wingerden, asymptotic variance of PBSIDopt) in closed form: with the windows fixed, all
randomness enters through Y = Ξ Ψ + E, Ξ̂ = Ξ + ΔΞ, ΔΞ = E Ψ†, cov(vec ΔΞ) = Λ ⊗ (Ψ Ψᵀ)⁻¹. The choice of S in x = S ΓK z̄
is held fixed: where ΓK has rank n another choice changes the basis only, from which poles and frequency responses are
free. With N = [X; U of feedthrough], P the projection on its rows, M = [X; U; E], ΔX = S ΔΓK Z₋ and ΔX₊ = S ΔΓK Z₊,
    [ΔC ΔD] = (ΔΞ Ψ − C ΔX) N†,
    ΔE      = −ΔΞ Ψ P − C ΔX (I − P),                    E taken as what the regression on N leaves,
    [ΔA ΔB] = (ΔX₊ − A ΔX − K ΔE) M†, columns of x and u.
The published ΔE = −ΔΞ Ψ is this one only where every input has feedthrough: without, an input under feedback is not at
right angles to the rest. Assumed: order and window chosen, (A − K C)ᵖ negligible, e white. Cost: O(f n l (p m) (n + r))
and a factor of (n + l) (n + r) columns; no array of recording length.

Where Ξ is a filter's, its ΔΞ is not that of the regressions on all windows, which the terms in Ψ hold; both are driven
by the same noise (recursive_spread.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.identify.markov import MarkovEstimate
from aeolid.identify.subspace import ScaledModel, StateBasis
from aeolid.identify.windows import WindowFactor, triangularise

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
RANK = 1e-11  # of the regressions, as in `subspace`
CHUNK_NUMBERS = 4_000_000  # held at a time where many entries are pushed through: 64 MB


@dataclass(frozen=True, eq=False)
class MatrixSpread:
    """Hold the covariance of the entries of [A B; C D] (n + l, n + r), row by row: rootᵀ root.

    root (k, (n + l)(n + r)); states n. Any linear function of the matrices has the norm of root · (its coefficients)
    for a deviation. The covariance itself hangs on the basis of the states and is singular along changes of basis.
    """

    root: Array
    states: int
    inputs: int

    def reach(self, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        """Return root · vec(leftᵀ [ΔA ΔB; ΔC ΔD] right) (k, …): left (…, n + l), right (…, n + r)."""
        rows, columns = left.shape[-1], right.shape[-1]
        left_of, right_of = left.reshape(-1, rows), right.reshape(-1, columns)
        out = np.empty((len(self.root), len(left_of)), dtype=np.complex128)
        step = max(1, CHUNK_NUMBERS // (rows * len(left_of)))
        for first in range(0, len(out), step):
            half = self.root[first : first + step].reshape(-1, rows, columns) @ right_of.T
            out[first : first + step] = np.einsum("kab,ba->kb", half, left_of)
        return out.reshape(-1, *left.shape[:-1])


def matrix_spread(
    factor: WindowFactor, basis: StateBasis, model: ScaledModel, markov: MarkovEstimate, through: tuple[bool, ...]
) -> MatrixSpread:
    """Return the first-order spread of [A B; C D] in scaled units; through: inputs with feedthrough."""
    n, r, outputs = len(model.A), factor.inputs, factor.outputs
    width = factor.past * factor.channels
    S = basis.selector(n).reshape(n, -1, outputs).transpose(1, 0, 2)  # (f, n, l): S_i
    before, after, rest, direct, now, fitted = projections(factor, basis.state_map(n), model, through)

    def moved(projected: Array) -> Array:
        """Return S ΔΓK · projected (n, columns, l, rank); block row i of ΓK holds Ξ moved right by i blocks."""
        m, spread = factor.channels, markov.spread
        parts = np.array([spread[: width - i * m].T @ projected[i * m :] for i in range(len(S))])
        out: Array = np.tensordot(S, parts, axes=(0, 0)).transpose(0, 3, 1, 2)
        return out

    def plain(projected: Array) -> Array:
        """Return ΔΞ · projected (l, columns, l, rank)."""
        own = markov.spread if markov.direct is None else markov.direct  # of the fit to all windows
        out: Array = np.einsum("ab,rc->acbr", np.eye(outputs), own.T @ projected)
        return out

    if not np.isfinite(markov.spread).all():
        return MatrixSpread(np.full((1, (n + outputs) * (n + r)), np.nan), n, r)

    J = np.zeros((n + outputs, n + r, outputs, markov.spread.shape[1]))
    J[:n] = moved(after) - _times(model.A, moved(before)) + _times(model.K @ model.C, moved(rest))
    J[:n] += _times(model.K, plain(direct))
    columns = [*range(n), *(n + i for i, t in enumerate(through) if t)]
    J[n:, columns] = plain(fitted) - _times(model.C, moved(now))
    J = np.einsum("abcr,cd->abdr", J, root_of(markov.residual_covariance))
    rows = J.reshape((n + outputs) * (n + r), -1).T
    if markov.bias is not None:  # as if it were a deviation; the fit to all windows has none
        shift = _shift(markov.bias, S, model, (before, after, rest, now), columns, factor.channels)
        rows = np.vstack([rows, shift.ravel()])
    return MatrixSpread(triangularise(rows) if len(rows) > rows.shape[1] else rows, n, r)


def _shift(
    bias: Array, S: Array, model: ScaledModel, projected: Sequence[Array], columns: Sequence[int], channels: int
) -> Array:
    """Return by how much [A B; C D] (n + l, n + r) is off where Ξ is by the bias (l, p m + r); S (f, n, l)."""
    before, after, rest, now = projected
    n, width = len(model.A), len(before)

    def moved(through: Array) -> Array:
        """Return S ΔΓK · through (n, columns)."""
        parts = [S[i] @ bias[:, : width - i * channels] @ through[i * channels :] for i in range(len(S))]
        out: Array = np.sum(parts, axis=0)
        return out

    out = np.zeros((n + len(model.C), before.shape[1]))
    out[:n] = moved(after) - model.A @ moved(before) + model.K @ model.C @ moved(rest)
    out[n:, list(columns)] = -model.C @ moved(now)
    return out


def pole_covariance(A: Array, spread: MatrixSpread) -> Array:
    """Return the covariance (n, 2, 2) of real and imaginary part of each pole, in the order of eig(A).

    With left and right eigenvectors, wᴴ v = 1, Δλ = wᴴ ΔA v. NaN where A has no full set of eigenvectors: its poles
    have no first-order expansion.
    """
    _, right = np.linalg.eig(A)
    n, columns = spread.states, spread.states + spread.inputs
    rows = spread.root.shape[1] // columns
    try:
        left = np.linalg.inv(right)  # rows wᴴ
    except np.linalg.LinAlgError:
        return np.full((n, 2, 2), np.nan)
    reached = spread.reach(_padded(left, rows), _padded(right.T, columns))  # (k, n)
    return covariance_of(reached)


def covariance_of(reached: ComplexArray) -> Array:
    """Return the covariance (…, 2, 2) of real and imaginary part of what white noise reaches through (k, …)."""
    parts = np.stack([reached.real, reached.imag], axis=-1)
    out: Array = np.einsum("k...i,k...j->...ij", parts, parts)
    return out


def _padded(vectors: ComplexArray, length: int) -> ComplexArray:
    return np.pad(vectors.astype(complex), ((0, 0), (0, length - vectors.shape[1])))


def _times(matrix: Array, J: Array) -> Array:
    """Multiply the first axis."""
    out: Array = np.tensordot(matrix, J, axes=(1, 0))
    return out


def root_of(covariance: Array) -> Array:
    """Return F (l, l) with F Fᵀ = covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    out: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return out


def projections(
    factor: WindowFactor, T: Array, model: ScaledModel, through: Sequence[bool]
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return Z₋ M†, Z₊ M†, Z₋ (I − P) M†, Ψ P M†, Z₋ N†, Ψ N†; of M† the columns of x and u."""
    R, m, r, n = factor.R, factor.channels, factor.inputs, len(T)
    width = factor.past * m
    now, u, y = R[:, :width] @ T.T, factor.u_now, factor.y_now
    first = np.hstack([now, u[:, np.flatnonzero(through)]])  # N
    e = y - now @ model.C.T - u @ model.D.T
    whole = pseudo_inverse(np.hstack([now, u, e]))[:, : n + r]
    short = pseudo_inverse(first)
    within = first @ (short.T @ whole)  # P M†
    Z, following, regressors = R[:, :width].T, R[:, m : width + m].T, R[:, : width + r].T
    return Z @ whole, following @ whole, Z @ (whole - within), regressors @ within, Z @ short, regressors @ short


def pseudo_inverse(columns: Array) -> Array:
    """Return the transposed pseudo-inverse (q, k) of columns (q, k), each brought to unit size first."""
    norm = np.sqrt((columns**2).sum(axis=0))
    norm = np.where(norm > 0, norm, 1.0)
    out: Array = pinv(columns / norm, rcond=RANK).T / norm
    return out
