"""Solve the eigenvalue problem of a linear system that is periodic in an angle, by its harmonics (Hill's method).

    x_{k+1} = A(ψ_k) x_k,   A(ψ) = Σ_h A_h e^{ihψ},   ψ_{k+1} = ψ_k + θ,

θ = Ω T the angle of a sample. With x_k = λᵏ p(ψ_k), p(ψ) = Σ_n v_n e^{inψ}, it becomes, harmonic by harmonic,

    λ v_n = e^{−inθ} Σ_m A_{n−m} v_m,     −N ≤ n ≤ N,

an eigenvalue problem of (2N + 1) blocks of n states (Hill 1886; for rotors Wereley 1991). It asks
for no whole number of samples a revolution. Where there is one, P, harmonics n and n + P are one on the samples, and
the problem of P harmonics, in which h is counted modulo P, is exact.

A solution shifted by k harmonics is the same motion with λ e^{−ikθ}: the eigenvalues form as many families as there
are states, and one of each is returned, the one whose harmonics lie about 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq, svd
from aeolid.errors import NotIdentifiable, UsageError

Complex = NDArray[np.complex128]
Indices = NDArray[np.intp]
MOST_ROWS = 520  # of the eigenvalue problem: some seconds and 20 MB on a slow processor
MOST_HARMONICS = 100
VANISHES = 1e-3  # a solution that a sample brings below a thousandth is a delay or a rounding error, not a mode
CONVERGED = 1e-6  # backward error at every angle
LOOKED_AT = 4  # solutions about harmonic 0 that may be of a family, for each family
SAME = 1e-9  # relative distance of eigenvalues whose eigenvectors the solver mixes
FAMILY = 1e-7  # relative distance of shifted eigenvalues that are of one family, or of several that coincide
PARALLEL = 1e-4  # part of a state at angle 0 that must point elsewhere to be of another family
LONGEST = 100_000  # samples of a revolution that are multiplied


@dataclass(frozen=True, eq=False)
class Families:
    """Hold one solution of each family: λ_j (F,), v_j and w_j (F, orders, n), with |v| = 1 and wᴴv = 1.

    orders (2N + 1,), or (P,) where h is counted modulo P. errors (F,): backward errors, see `backward_errors`. left
    (w_j) is None unless asked for. missing: families that are not among them, because a sample brings them below a
    thousandth, because they coincide with another or because no number of harmonics within the limits describes them.
    """

    values: Complex
    vectors: Complex
    left: Complex | None
    orders: Indices
    errors: NDArray[np.float64]
    missing: int


def solve_families(A: Complex, theta: float, harmonics: int | None = None, *, left: bool = False) -> Families:
    """Return one solution of each family.

    A (2M + 1, n, n): A_{−M} … A_M; theta: angle of a sample, rad, 0 < |θ| < π. harmonics: N; by default it doubles
    until the backward error of every solution about harmonic 0 is below `CONVERGED`, or until 2N + 1 ≥ P. left: whether
    the left eigenvectors are needed. Cost 25 ((2N + 1) n)³, at most `MOST_ROWS` rows. Raises UsageError on an N that
    cannot be, NotIdentifiable where no N within the limits describes any solution.
    """
    n, reach = A.shape[1], (len(A) - 1) // 2
    most, least = min((MOST_ROWS // n - 1) // 2, MOST_HARMONICS), max(1, reach)
    if harmonics is not None and not least <= harmonics <= most:
        raise UsageError(f"{harmonics} harmonics are not within {least} … {most}, the limits of {n} states")
    if most < least:
        raise UsageError(f"a model of {n} states is too large: at most {MOST_ROWS // (2 * least + 1)} are analysed")
    whole, N = whole_samples(theta), harmonics or min(2 * least + 2, most)
    while True:
        if whole is not None and 2 * N + 1 >= whole > 2 * reach:
            return _chosen(_closed(A, theta, whole), A, theta, _about_zero(whole), left, strict=False)[0]
        orders = np.arange(-N, N + 1)
        found, complete = _chosen(_hill(A, theta, N), A, theta, orders, left, strict=harmonics is None)
        if complete or harmonics is not None:
            return found
        if most <= N:
            if len(found.values):
                return found  # what has converged; the others are missing
            raise NotIdentifiable(
                f"{N} harmonics do not describe the modes at {2 * np.pi / abs(theta):.4g} samples a revolution: the "
                "model changes too much within a revolution for this speed and sample time; check the speed, or "
                "identify the model anew with a longer recording"
            )
        N = min(2 * N, most)


def backward_errors(
    A: Complex, theta: float, values: Complex, vectors: Complex, orders: Indices
) -> NDArray[np.float64]:
    """Return for each solution max over ψ of |A(ψ) p(ψ) − λ p(ψ + θ)| / (|A(ψ)| |p(ψ)|), (F,).

    Each is the exact solution of a system whose A(ψ) differs nowhere by more than that part of its size. Over the whole
    period rather than in the mean: where p is small, a motion that is none would pass. values (F,), vectors
    (F, orders, n).
    """
    whole = whole_samples(theta)
    closed = whole == len(orders)
    count = len(orders) if closed else 2 * (len(orders) + len(A))
    angle = 2 * np.pi / count * np.arange(count)
    reach = (len(A) - 1) // 2
    matrices = np.tensordot(np.exp(1j * np.outer(angle, np.arange(-reach, reach + 1))), A, axes=1)
    size = np.linalg.norm(matrices, axis=(1, 2))
    here, next_ = (np.exp(1j * np.outer(angle + step, orders)) for step in (0.0, theta))
    out = np.empty(len(values))
    with np.errstate(divide="ignore", invalid="ignore"):
        for i, (value, vector) in enumerate(zip(values, vectors, strict=True)):
            p = here @ vector
            rest = np.linalg.norm((matrices @ p[:, :, None])[:, :, 0] - value * (next_ @ vector), axis=1)
            out[i] = np.nan_to_num(rest / (size * np.linalg.norm(p, axis=1)), nan=np.inf).max()
    return out


def monodromy(A: Complex, samples: int, start: float = 0.0) -> Complex | None:
    """Return A(ψ_{P−1}) … A(ψ_0) over one revolution of P samples from the angle `start`; None where it overflows."""
    orders = np.arange(len(A)) - (len(A) - 1) // 2
    product = np.eye(A.shape[1], dtype=complex)
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(samples):
            product = np.tensordot(np.exp(1j * orders * (start + 2 * np.pi * k / samples)), A, axes=1) @ product
    return product if np.isfinite(product).all() else None


def whole_samples(theta: float) -> int | None:
    """Return the samples of a revolution where they are a whole number, at most `LONGEST`; else None."""
    samples = 2 * np.pi / abs(theta)
    if samples > LONGEST + 0.5:
        return None
    whole = round(samples)
    return whole if abs(samples - whole) <= 1e-9 * samples else None


def shift_between(value: complex, other: complex, theta: float, most: int) -> tuple[int, float]:
    """Return the k, |k| ≤ most, for which other · e^{ikθ} is nearest to value, and their distance."""
    orders = np.arange(-most, most + 1)
    distance = abs(value - other * np.exp(1j * theta * orders))
    best = int(np.argmin(distance))
    return int(orders[best]), float(distance[best])


def _chosen(
    matrix: Complex, A: Complex, theta: float, orders: Indices, left: bool, *, strict: bool
) -> tuple[Families, bool]:
    """Return the families of a Hill matrix, and whether they are all; strict: those that have converged alone."""
    n = A.shape[1]
    values, right, other = _solutions(matrix, np.repeat(orders, n), left)
    size = float(abs(values).max())
    alive = np.flatnonzero((abs(values) >= VANISHES) & np.isfinite(right).all(axis=0))
    centre = abs(np.repeat(orders, n) @ np.abs(np.nan_to_num(right)) ** 2)
    alive = alive[np.argsort(centre[alive], kind="stable")]
    wanted = round(np.count_nonzero(abs(values) >= VANISHES) / len(orders))
    alive = alive[: LOOKED_AT * wanted] if strict else alive
    blocks = right.T.reshape(-1, len(orders), n)
    errors = backward_errors(A, theta, values[alive], blocks[alive], orders)
    picked: list[int] = []
    kept: list[float] = []
    for i, error in zip(alive.tolist(), errors.tolist(), strict=True):
        if len(picked) == wanted:
            break
        fit = error <= CONVERGED or not strict
        if fit and _is_new(i, picked, values, blocks.sum(axis=1).T, theta, FAMILY * size):
            picked.append(i)
            kept.append(error)
    w = None if other is None else other.T.reshape(blocks.shape)[picked]
    found = Families(values[picked], blocks[picked], w, orders, np.array(kept), n - len(picked))
    return found, len(picked) == wanted or bool((errors <= CONVERGED).all())


def _hill(A: Complex, theta: float, N: int) -> Complex:
    """Return the matrix ((2N + 1) n)², block (n, m): e^{−inθ} A_{n−m}."""
    n, reach = A.shape[1], (len(A) - 1) // 2
    out = np.zeros((2 * N + 1, n, 2 * N + 1, n), complex)
    for row in range(2 * N + 1):
        for column in range(max(0, row - reach), min(2 * N, row + reach) + 1):
            out[row, :, column] = np.exp(-1j * (row - N) * theta) * A[row - column + reach]
    return out.reshape((2 * N + 1) * n, -1)


def _closed(A: Complex, theta: float, P: int) -> Complex:
    """Return the matrix (P n)² in which harmonics n and n + P are one."""
    n, reach, orders = A.shape[1], (len(A) - 1) // 2, _about_zero(P)
    out = np.zeros((P, n, P, n), complex)
    for row in range(P):
        for h in range(-reach, reach + 1):
            out[row, :, (row - h) % P] += np.exp(-1j * orders[row] * theta) * A[h + reach]
    return out.reshape(P * n, -1)


def _about_zero(P: int) -> Indices:
    """Return P harmonics about 0."""
    return np.arange(P) - (P - 1) // 2


def _solutions(matrix: Complex, orders: Indices, with_left: bool) -> tuple[Complex, Complex, Complex | None]:
    """Return eigenvalues, right and, if asked for, left eigenvectors as columns, |v| = 1 and wᴴv = 1.

    Of eigenvalues that coincide the solver returns any mixture: there v are taken that have their harmonics apart, the
    eigenvectors of the harmonic's number (orders, one a row) within their span.
    """
    from scipy.linalg import eig  # a tenth of a second to load
    from scipy.sparse.csgraph import connected_components

    left: Complex | None = None
    if with_left:
        values, left, right = eig(matrix, left=True, right=True)
    else:
        values, right = np.linalg.eig(matrix)
    right = right / np.linalg.norm(right, axis=0)
    near = abs(values[:, None] - values) <= SAME * abs(values).max()
    count, label = connected_components(near, directed=False)
    for which in np.flatnonzero(np.bincount(label, minlength=count) > 1):
        members = np.flatnonzero(label == which)
        if abs(values[members]).max() >= VANISHES:
            right[:, members] = _apart(right[:, members], orders)
            if left is not None:
                left[:, members] = _dual(left[:, members], right[:, members])
    if left is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            left = left / np.einsum("ij,ij->j", left.conj(), right).conj()
    return values, right, left


def _apart(vectors: Complex, orders: Indices) -> Complex:
    """Return an orthonormal basis (rows, c) of the span of vectors that the harmonic's number makes diagonal."""
    basis, sizes, _ = svd(vectors)
    basis = basis[:, sizes > SAME * sizes[0]]
    _, turned = np.linalg.eigh(basis.conj().T @ (orders[:, None] * basis))
    out = np.full(vectors.shape, np.nan, complex)  # what a defective eigenvalue lacks is no solution
    out[:, : basis.shape[1]] = basis @ turned
    return out


def _dual(left: Complex, right: Complex) -> Complex:
    """Return those combinations w of left eigenvectors for which wᴴv is the identity; NaN where there are none."""
    try:
        dual: Complex = left @ np.linalg.inv(left.conj().T @ right).conj().T
    except np.linalg.LinAlgError:
        return np.full(left.shape, np.nan, complex)
    return dual


def _is_new(i: int, picked: list[int], values: Complex, states: Complex, theta: float, near: float) -> bool:
    """Tell whether a solution is of no family picked before: another λ, or another state (n, ·) at angle 0."""
    most = 2 * len(values) // max(states.shape[0], 1)
    same = [j for j in picked if shift_between(values[i], values[j], theta, most)[1] <= near]
    if not same:
        return True
    basis = states[:, same] / np.linalg.norm(states[:, same], axis=0)
    own = states[:, i] / np.linalg.norm(states[:, i])
    rest = own - basis @ lstsq(basis, own)
    return bool(np.linalg.norm(rest) > PARALLEL)
