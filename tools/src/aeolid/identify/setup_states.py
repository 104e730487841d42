"""Restrict the model of a set-up to its modes, in coordinates of its outputs that set-ups share, with its spread.

With A V = V Λ over the modes that stay and A W = W Ω over what is left out, [V W]⁻¹ = [L; N],
    A' = Λ,   C' = C V,   ΔA' = L ΔA V,   ΔC' = ΔC V + C W X,   X_ab = (N ΔA V)_ab/(λ_b − ω_a),
first order, in a basis that moves by W alone (Stewart and Sun 1990, chapter V). Poles of noise, and of what colours the
excitation of one set-up, are left out so. Another sample time makes λ^(h/h') of λ, and of ΔA' what the divided
differences of this function say (Daleckii and Krein 1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.diagram import Pole
from aeolid.identify.global_basis import Part, observability
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
    root = None
    if known:
        spread = matrix_spread(source.whole, source.basis, model, source.estimate, ())
        root = spread.root.reshape(len(spread.root), -1, order)
        root = np.concatenate([root[:, :order], root[:, [order + p for p in places]] * unit], axis=1)
        root = root if np.isfinite(root).all() else None
    part = Part(model.A, model.C[places] * unit, np.eye(order), root)
    return restricted(part, [p.eigenvalue for p in poles], step / diagram.sample_time_s)


def balanced(part: Part, weights: Sequence[float], references: int, blocks: int) -> Part:
    """Return a part whose pairs of states count by weights, whatever excites them: S of the size of O S in each."""
    seen = observability(part.A, part.C[:references], blocks).reshape(-1, len(weights), 2)
    sizes = np.linalg.norm(seen, axis=(0, 2))
    return replace(part, S=np.diag(np.repeat(np.array(weights) / np.maximum(sizes, np.finfo(float).tiny), 2)))


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
    A = _real(np.linalg.inv(real) @ (powers[:, None] * real))
    C, S = _real(part.C @ V @ real), np.eye(len(kept))
    if part.root is None:
        return Part(A, C, S)
    dA, dC = np.split(part.root, [len(values)], axis=1)
    X = (N @ dA @ V) / (inner - outer[:, None])
    of_A = np.linalg.inv(real) @ ((L @ dA @ V) * _divided(inner, powers, power)) @ real
    moved = [_real(of_A), _real((dC @ V + part.C @ W @ X) @ real)]
    return Part(A, C, S, np.concatenate(moved, axis=1))


def _real(matrix: ComplexArray | Array) -> Array:
    out: Array = np.ascontiguousarray(matrix.real)
    return out


def _divided(values: ComplexArray, powers: ComplexArray, power: float) -> ComplexArray:
    """Return the divided differences (n, n) of λ^power, on the diagonal its derivative."""
    apart = values[:, None] - values
    near = abs(apart) < 1e-9 * abs(values)
    out: ComplexArray = np.where(
        near, power * powers / values, (powers[:, None] - powers) / np.where(near, 1.0, apart)
    )  # fmt: skip
    return out
