"""Restrict the model of a set-up to its modes, in coordinates of its outputs that set-ups share, with its spread.

With A V = V Λ over the modes that stay and A W = W Ω over what is left out, [V W]⁻¹ = [L; N],
    A' = Λ,  C' = C V,  S' = L S,
    ΔA' = L ΔA V,   ΔC' = ΔC V + C W X,   ΔS' = L ΔS + Y N S,
    X_ab = (N ΔA V)_ab/(λ_b − ω_a),   Y_ab = (L ΔA W)_ab/(λ_a − ω_b),
first order, in a basis that moves by W alone (Stewart and Sun 1990, chapter V). Poles of noise, and of what colours the
excitation of one set-up, are left out so. Another sample time makes λ^(h/h') of λ, and of ΔA' what the divided
differences of this function say (Daleckii and Krein 1965).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.diagram import Pole
from aeolid.identify.global_basis import Part
from aeolid.identify.setup_matching import Setup
from aeolid.identify.uncertainty import matrix_spread

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def chosen_model(setup: Setup, modes: Sequence[int], window: int) -> tuple[int, list[Pole | None]]:
    """Return the order of the model of a window that has most of the modes, and the pole that it has of each.

    modes: places among those of the set-up. Of models that have as many, the smallest counts.
    """
    clusters = [setup.modal.stability[i] for i in modes]
    orders = sorted(n for w, n in setup.modal.diagram.counting if w == window)
    mine = {
        n: [next((p for p in c.counted if (p.past, p.order) == (window, n)), None) for c in clusters] for n in orders
    }
    order = max(orders, key=lambda n: sum(p is not None for p in mine[n]))
    return order, mine[order]


def part_of(setup: Setup, window: int, order: int, poles: Sequence[Pole], step: float, known: bool) -> Part:
    """Return the part that a set-up has in a realisation: its model of these poles, at a sample time in seconds.

    known: with its spread.
    """
    diagram = setup.modal.diagram
    source = diagram.sources[window]
    model = diagram.model(window, order).model
    places = [diagram.outputs.index(n) for n in setup.outputs]
    unit = (diagram.scaling.scale[places] / setup.scale)[:, None]
    size = np.sqrt(source.basis.singular_values[:order] * np.sqrt(source.whole.windows))  # of the rows of X = S ΓK Z
    root = None
    if known:
        spread = matrix_spread(source.whole, source.basis, model, source.estimate, (), states=True)
        of_A, of_C, of_X = np.split(
            spread.root.reshape(len(spread.root), -1, order), [order, order + len(places)], axis=1
        )
        root = np.concatenate([of_A, of_C[:, places] * unit, of_X / size], axis=1)  # ΔS Sᵀ = ΔX Xᵀ
        root = root if np.isfinite(root).all() else None
    part = Part(model.A, model.C[places] * unit, np.diag(size), source.whole.windows, root)
    return restricted(part, [p.eigenvalue for p in poles], step / diagram.sample_time_s)


def restricted(part: Part, eigenvalues: Sequence[complex], power: float = 1.0) -> Part:
    """Return a part of the modes of these eigenvalues, one of each pair; A to a power: at another sample time."""
    values, right = (m.astype(complex) for m in np.linalg.eig(part.A))
    kept: list[int] = []
    for value in eigenvalues:
        kept += [int(np.argmin(abs(values - value))), int(np.argmin(abs(values - np.conj(value))))]
    rest = [i for i in range(len(values)) if i not in kept]
    inverse = np.linalg.inv(right)
    V, W, L, N = right[:, kept], right[:, rest], inverse[kept], inverse[rest]
    real = np.kron(np.eye(len(kept) // 2), np.array([[0.5, -0.5j], [0.5, 0.5j]]))  # [v v̄] real = [Re v, Im v]
    inner, outer = values[kept], values[rest]
    powers = inner**power
    S = _real(np.linalg.inv(real) @ L @ part.S)
    square = _root(S @ S.T)
    A = _real(np.linalg.inv(real) @ (powers[:, None] * real))
    if part.root is None:
        return Part(A, _real(part.C @ V @ real), square, part.samples)
    n = len(values)
    dA, dC, dS = np.split(part.root, [n, n + len(part.C)], axis=1)
    X = (N @ dA @ V) / (inner - outer[:, None])
    Y = (L @ dA @ W) / (inner[:, None] - outer)
    of_A = np.linalg.inv(real) @ ((L @ dA @ V) * _divided(inner, powers, power)) @ real
    of_S = _real(np.linalg.inv(real) @ (L @ dS + Y @ (N @ part.S)))
    moved = [_real(of_A), _real((dC @ V + part.C @ W @ X) @ real), of_S @ S.T @ np.linalg.inv(square).T]
    return Part(A, _real(part.C @ V @ real), square, part.samples, np.concatenate(moved, axis=1))


def _real(matrix: ComplexArray | Array) -> Array:
    out: Array = np.ascontiguousarray(matrix.real)
    return out


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    out: Array = vectors * np.sqrt(np.maximum(values, np.finfo(float).eps * values[-1]))
    return out


def _divided(values: ComplexArray, powers: ComplexArray, power: float) -> ComplexArray:
    """Return the divided differences (n, n) of λ^power, on the diagonal its derivative."""
    apart = values[:, None] - values
    near = abs(apart) < 1e-9 * abs(values)
    out: ComplexArray = np.where(
        near, power * powers / values, (powers[:, None] - powers) / np.where(near, 1.0, apart)
    )  # fmt: skip
    return out
