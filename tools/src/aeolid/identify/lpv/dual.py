"""Solve Algorithms 2 and 3 of paper 001: the dual regression on the kernel, all of it or a selection of its rows.

The dual solution with penalty λ is α = Y (G + λ²)⁻¹, G = [Z U]ᵀ[Z U] (eq. (20), Tikhonov), and equals the primal one
with the same λ. Structure in the scheduling (periodic, piecewise constant) shows as a lack of rank of G, which a
pivoted Cholesky factor finds: it works on as many rows as span the others, exactly (section 6.1). With a number of
rows M the factor stops there (section 6.2): the row least explained by those before is taken next, or the first M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, lapack, solve_triangular

from aeolid.decompositions import svd
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.lpv.data import Indices, LpvData
from aeolid.identify.lpv.kernel import Kernel
from aeolid.identify.lpv.states import Estimate, StateSequence, largest_kept
from aeolid.identify.lpv.structure import Structure
from aeolid.identify.ridge import Spectrum, filter_factors

Array = NDArray[np.float64]
LOW_RANK = 0.6  # of the windows; up to here the Cholesky factor is cheaper than all eigenvectors
ROUNDING = 1e-10  # the kernel holds squares of what the primal data matrix holds
SELECTIONS = ("greedy", "first")


@dataclass(frozen=True, eq=False)
class DualSolution:
    """Hold α (l, M) for the windows `rows` (M,), None for all; rank of the kernel and the filter that made α."""

    alpha: Array
    rows: Indices | None
    rank: int
    penalty: Array
    freedom: Array


def solve_dual(
    data: LpvData,
    structure: Structure,
    future: int,
    regularization: str | float,
    kernel_rows: int | None,
    selection: str,
    tolerance: float | None = None,
) -> Estimate:
    """Estimate the states by Algorithm 2, or 3 with a number of rows or with a tolerance ε (see `select_rows`)."""
    kernel = Kernel.of(data, structure)
    count = data.windows if kernel_rows is None else min(kernel_rows, data.windows)
    if tolerance is None and count == data.windows:
        solution = _solve_full(kernel, regularization)
    else:
        solution = _solve_rows(kernel, regularization, count, selection, tolerance)
    stacked = kernel.states_rows(solution.alpha, future, solution.rows)
    _, s, right = svd(stacked)
    kept = largest_kept(s, ROUNDING)
    X = right[:kept].T * np.sqrt(s[:kept])
    used = data.windows if solution.rows is None else len(solution.rows)
    facts = {
        "rows": used,
        "of": data.windows,
        "rank": solution.rank,
        "selection": None if used == data.windows else selection,
        "tolerance": tolerance,
    }
    return Estimate(
        StateSequence(s / np.sqrt(data.windows), X), solution.rank, data.windows, solution.penalty,
        solution.freedom, {"kernel": facts},
    )  # fmt: skip


def require_kernel(data: LpvData, structure: Structure, source: str, kernel_rows: int | None, limit: float) -> None:
    """Refuse a kernel beyond the memory limit (bytes), before anything is allocated."""
    N = data.windows
    if kernel_rows is not None and kernel_rows < 1:
        raise UsageError(f"{kernel_rows} kernel rows: at least 1 is needed")
    needed = kernel_bytes(data, kernel_rows)
    if needed <= limit:
        return
    most = int(limit / (8.0 * 3 * max(N, 1)))
    raise NotIdentifiable(
        f"{source}: a kernel of {N if kernel_rows is None else min(kernel_rows, N)} rows by {N} windows needs "
        f"{needed / 1e9:.1f} GB, the limit is {limit / 1e9:.1f} GB; use at most {most} rows (--kernel-rows), a part of "
        "the recording, or raise --memory"
    )


def kernel_bytes(data: LpvData, kernel_rows: int | None) -> float:
    """Return the bytes the solution holds at its peak: kernel, eigenvectors and work, or the factor of M rows."""
    N = data.windows
    if kernel_rows is None or kernel_rows >= N:
        return 8.0 * 4 * N * N
    return 8.0 * 3 * N * kernel_rows


def _solve_full(kernel: Kernel, regularization: str | float) -> DualSolution:
    data = kernel.data
    y, N = data.y[data.targets], data.windows
    G = kernel.full()
    top = float(G.diagonal().max())
    factor, pivots, rank, _ = lapack.dpstrf(G, tol=top * N * np.finfo(float).eps, lower=1)
    if rank <= LOW_RANK * N:
        L = np.empty((N, rank))
        L[pivots - 1] = np.tril(factor[:, :rank])
        values, V = eigh(L.T @ L, overwrite_a=True, driver="evd")
        del factor, G
    else:
        del factor
        values, V = eigh(G, overwrite_a=True, driver="evd")
        L = None
    keep = values > values[-1] * N * np.finfo(float).eps
    s, V = np.sqrt(values[keep][::-1]), V[:, keep][:, ::-1]
    P = V if L is None else (L @ V) / s
    projected = P.T @ y
    penalty, factors = filter_factors(Spectrum(s, projected, _outside(y, projected), N), regularization)
    alpha = (P @ (factors.T / s[:, None] ** 2 * projected)).T  # (l, N)
    return DualSolution(alpha, None, len(s), penalty / s[0], factors.sum(axis=1))


def _solve_rows(
    kernel: Kernel, regularization: str | float, count: int, selection: str, tolerance: float | None
) -> DualSolution:
    """Regress on the features the selected rows span, L with L Lᵀ ≈ G: the penalty is that of the primal problem."""
    data = kernel.data
    L, rows = select_rows(kernel, count, selection, tolerance)
    P, s, Vt = svd(L)
    keep = s > s[0] * np.sqrt(data.windows * np.finfo(float).eps)
    P, s, Vt = P[:, keep], s[keep], Vt[keep]
    y = data.y[data.targets]
    projected = P.T @ y
    penalty, factors = filter_factors(Spectrum(s, projected, _outside(y, projected), data.windows), regularization)
    beta = (factors / s * projected.T) @ Vt  # (l, M): y ≈ L βᵀ
    alpha = solve_triangular(L[rows], beta.T, lower=True, trans="T").T  # L = G[:, rows] L[rows]⁻ᵀ
    return DualSolution(alpha, rows, len(s), penalty / s[0], factors.sum(axis=1))


def select_rows(kernel: Kernel, count: int, selection: str, tolerance: float | None = None) -> tuple[Array, Indices]:
    """Return the partial Cholesky factor L (N, ≤ M) of the kernel and the rows it was built on, Algorithm 3.

    greedy: the next row is the one whose feature lies farthest from the span of those taken; first: rows 1 … M in
    turn. Rows within rounding of that span are passed over. Memory M N: the kernel itself is never formed.
    tolerance: ε of Algorithm 3, relative to the largest squared feature: a row is taken only while more than that is
    left of its squared feature; "first" then looks at every row in turn, as the paper prints it.
    """
    if selection not in SELECTIONS:
        raise UsageError(f"kernel selection {selection!r} is none of {', '.join(SELECTIONS)}")
    N = kernel.data.windows
    left = kernel.diagonal()
    floor = float(left.max()) * max(N * float(np.finfo(float).eps), tolerance or 0.0)
    last = min(count, N) if tolerance is None else N  # rows that "first" looks at
    L = np.zeros((N, min(count, N)), order="F")
    rows: list[int] = []
    tried = 0
    while len(rows) < min(count, N):
        if selection == "greedy":
            candidate = int(np.argmax(left))
            if left[candidate] <= floor:
                break
        else:
            candidate, tried = tried, tried + 1
            if candidate >= last:
                break
            if left[candidate] <= floor:
                continue
        row = kernel.regressor_rows(np.array([candidate]))[0]
        i = len(rows)
        column = (row - L[:, :i] @ L[candidate, :i]) / np.sqrt(left[candidate])
        column[rows] = 0.0
        L[:, i] = column
        left = np.maximum(left - column**2, 0.0)
        left[candidate] = 0.0
        rows.append(candidate)
    return L[:, : len(rows)], np.array(rows, dtype=np.intp)


def _outside(y: Array, projected: Array) -> Array:
    return np.asarray(np.maximum((y**2).sum(axis=0) - (projected**2).sum(axis=0), 0.0))
