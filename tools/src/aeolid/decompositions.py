"""Take singular values, pseudo-inverses and least squares of any finite matrix, also where LAPACK's first way fails.

numpy calls LAPACK's divide-and-conquer routines (gesdd, gelsd), the fastest. With some kernels of OpenBLAS they report
now and then that a matrix did not converge which is finite and as well conditioned as any (reported to numpy as 12941,
to OpenBLAS as 3044); which one it is depends on processor, threads and version. The routine by QR steps (gesvd), which
is slower, takes over there. Where the first way succeeds its result is returned to the bit. No other module calls these
routines of numpy or scipy (`tests/host/test_decompositions.py`). Matrices are real or complex; `singular_values` and
`pinv` take stacks of them (..., rows, columns) as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[Any]
_EPS = float(np.finfo(np.float64).eps)


def svd(matrix: Matrix, *, full_matrices: bool = False) -> tuple[Matrix, Matrix, Matrix]:
    """Return U, s, Vᴴ with matrix = U diag(s) Vᴴ; U and V with min(rows, columns) columns, or all of them.

    Raises LinAlgError on a matrix with NaN or infinities.
    """
    try:
        return np.linalg.svd(matrix, full_matrices=full_matrices)
    except np.linalg.LinAlgError:
        return _by_steps(matrix, full_matrices)


def singular_values(matrix: Matrix) -> Matrix:
    """Return the singular values (..., min(rows, columns)), the largest first; raises as `svd` does."""
    try:
        return np.linalg.svd(matrix, compute_uv=False)
    except np.linalg.LinAlgError:
        if matrix.ndim > 2:
            return np.stack([singular_values(one) for one in matrix])
        return _by_steps(matrix, False)[1]


def pinv(matrix: Matrix, rcond: float | None = None, *, hermitian: bool = False) -> Matrix:
    """Return the pseudo-inverse; singular values of `rcond` times the largest and less count as zero.

    rcond: default as numpy's, 1e-15 up to version 2.0. hermitian: whether the matrix is, known to its caller.
    """
    settings: dict[str, Any] = {} if rcond is None else {"rcond": rcond}
    try:
        return np.linalg.pinv(matrix, hermitian=hermitian, **settings)
    except np.linalg.LinAlgError:
        if matrix.ndim > 2:
            return np.stack([pinv(one, rcond, hermitian=hermitian) for one in matrix])
        U, s, Vt = _by_steps(matrix, False)
    return (Vt.conj().T * _inverted(s, 1e-15 if rcond is None else rcond)) @ U.conj().T


def lstsq(matrix: Matrix, target: Matrix, rcond: float | None = None) -> Matrix:
    """Return x, of the least size where several are, that makes ‖target − matrix x‖ least.

    rcond: singular values of so much of the largest and less count as zero; default machine precision times the larger
    number of rows and columns.
    """
    try:
        return np.linalg.lstsq(matrix, target, rcond=rcond)[0]
    except np.linalg.LinAlgError:
        U, s, Vt = _by_steps(matrix, False)
    inverse = _inverted(s, max(matrix.shape) * _EPS if rcond is None else rcond)
    found: Matrix = Vt.conj().T @ (inverse[:, None] * (U.conj().T @ target.reshape(len(target), -1)))
    return found.reshape(found.shape[0], *target.shape[1:])


def condition(matrix: Matrix) -> float:
    """Return the largest over the smallest singular value, infinite for a singular matrix."""
    s = singular_values(matrix)
    return float(s[0] / s[-1]) if s[-1] > 0 else float("inf")


def spectral_norm(matrix: Matrix) -> float:
    """Return the largest singular value, 0 of a matrix without entries."""
    return float(singular_values(matrix)[0]) if min(matrix.shape) else 0.0


def _inverted(s: Matrix, rcond: float) -> Matrix:
    """Return 1/s, and 0 where s counts as zero."""
    kept = s > rcond * s.max(initial=0.0)
    out: Matrix = np.zeros_like(s)
    out[kept] = 1 / s[kept]
    return out


def _by_steps(matrix: Matrix, full_matrices: bool) -> tuple[Matrix, Matrix, Matrix]:
    if not np.isfinite(matrix).all():
        raise np.linalg.LinAlgError("a matrix with NaN or infinite entries has no singular values")
    from scipy.linalg import svd as by_driver  # a quarter of a second to load, and seldom asked for

    return by_driver(matrix, full_matrices=full_matrices, lapack_driver="gesvd", check_finite=False)  # type: ignore[no-any-return]
