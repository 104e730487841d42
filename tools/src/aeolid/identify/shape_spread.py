"""Push the spread of the matrices on to mode shapes.

With A v = λ v, wᴴ v = 1 a change of the matrices moves the shape C v by
    Δ(C v) = ΔC v + C (λI − A)⁺ ΔA v,       (λI − A)⁺ = Σ v_j w_jᴴ/(λ − λ_j) over the other poles λ_j;
what moves along v itself drops out of the shape ψ = C v/c_r scaled to its reference r:
    Δψ_i = [(L_i − ψ_i L_r)/c_r] [ΔA; ΔC] v,       L = [C (λI − A)⁺, I].
Linear in the spread of the matrices, and free of the states' basis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.subspace import ScaledModel
from aeolid.identify.uncertainty import MatrixSpread, covariance_of
from aeolid.models.shapes import reference_outputs, scaled_to

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def shape_covariance(model: ScaledModel, spread: MatrixSpread, reference: int | None) -> Array:
    """Return the covariance (n, l, 2, 2) of real and imaginary part of each shape, in the order of eig(A).

    reference: index of the output that scales the shapes, by default the one that moves most. NaN where A has no full
    set of eigenvectors.
    """
    rows, columns = shape_rows(model, reference)
    padded = np.pad(columns, ((0, 0), (0, spread.inputs)))
    out = np.empty((*rows.shape[:2], 2, 2))
    for i, (row, column) in enumerate(zip(rows, padded, strict=True)):
        good = bool(np.isfinite(row).all())
        out[i] = covariance_of(spread.reach(row, np.broadcast_to(column, (len(row), len(column))))) if good else np.nan
    return out


def shape_rows(model: ScaledModel, reference: int | None) -> tuple[ComplexArray, ComplexArray]:
    """Return what makes Δψ of [ΔA; ΔC]: rows (n, l, n + l) from the left, eigenvectors (n, n) from the right.

    A row an eigenvector. Rows are NaN where A has no full set of eigenvectors, or the reference does not move.
    """
    n, outputs = len(model.A), len(model.C)
    values, right = (part.astype(complex) for part in np.linalg.eig(model.A))
    shapes = model.C @ right  # (l, n)
    at = reference_outputs(shapes, reference)
    psi = scaled_to(shapes, at)
    rows = np.full((n, outputs, n + outputs), np.nan, dtype=complex)
    try:
        left = np.linalg.inv(right)  # rows wᴴ
    except np.linalg.LinAlgError:
        return rows, right.T
    for i, value in enumerate(values):
        apart = value - values
        weight = np.divide(1.0, apart, where=apart != 0, out=np.full(n, np.nan, dtype=complex))
        weight[i] = 0.0
        L = np.hstack([(shapes * weight) @ left, np.eye(outputs)])  # (l, n + l)
        rows[i] = (L - psi[:, i : i + 1] * L[at[i]]) / shapes[at[i], i]
    return rows, right.T
