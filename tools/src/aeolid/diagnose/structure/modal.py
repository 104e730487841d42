"""Write a linear model in modal coordinates, each independent entry a parameter with a name."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
PREFIX = "sim_"  # of the parameters' names


@dataclass(frozen=True, eq=False)
class ModalForm:
    """Hold a model whose A is block diagonal ([a] or [a b; −b a]) and the names of its n (r + l) free entries.

    names: entry of A, B or C as (matrix, row, column) → coefficient as text, "sim_…" or "-sim_…"; what is not listed
    is fixed: zeros of A, and one entry (one pair) of C a block, which sets the scale of its coordinates.
    """

    model: StateSpace
    names: dict[tuple[str, int, int], str]

    @property
    def values(self) -> dict[str, float]:
        """Return the parameters' values by name."""
        return {
            name: float(getattr(self.model, m)[i, j])
            for (m, i, j), name in self.names.items()
            if not name.startswith("-")
        }


def modal_form(model: StateSpace, spreads: Array) -> ModalForm:
    """Return the model in modal coordinates, each block scaled by the output that shows it most (spreads (l,)).

    Needs distinct poles, which identified models have. A real pole gives one coordinate, a pair of complex poles two.
    """
    values, right = np.linalg.eig(model.A)
    columns, blocks = [], []
    for k in np.argsort(-abs(values), kind="stable"):
        if values[k].imag < 0:
            continue
        pair = values[k].imag > 0
        shape = model.C @ right[:, k]
        j = int(np.argmax(abs(shape) / spreads))
        vector = right[:, k] * (spreads[j] / shape[j])  # this output then reads the first coordinate of the block
        columns += [vector.real, vector.imag] if pair else [vector.real]
        blocks.append((j, 2 if pair else 1))
    T = np.column_stack(columns)
    inverse = np.linalg.inv(T)
    A, B, C = inverse @ model.A @ T, inverse @ model.B, model.C @ T
    K = None if model.K is None else inverse @ model.K
    mask = np.zeros_like(A)
    names: dict[tuple[str, int, int], str] = {}
    first = 0
    for number, (j, width) in enumerate(blocks, 1):
        span = slice(first, first + width)
        mask[span, span] = 1
        _name_block(names, number, first, width, j, C.shape[0], B.shape[1])
        C[j, span] = [spreads[j], 0][:width]
        first += width
    states = tuple(Signal(f"x{i + 1}") for i in range(len(A)))
    return ModalForm(replace(model, A=A * mask, B=B, C=C, K=K, x0=inverse @ model.x0, states=states), names)


def _name_block(
    names: dict[tuple[str, int, int], str], number: int, first: int, width: int, fixed: int, outputs: int, inputs: int
) -> None:
    names[("A", first, first)] = f"{PREFIX}a{number}"
    if width == 2:
        names[("A", first + 1, first + 1)] = f"{PREFIX}a{number}"
        names[("A", first, first + 1)] = f"{PREFIX}w{number}"
        names[("A", first + 1, first)] = f"-{PREFIX}w{number}"
    for i in range(first, first + width):
        names |= {("B", i, c): f"{PREFIX}b{i + 1}_{c + 1}" for c in range(inputs)}
        names |= {("C", j, i): f"{PREFIX}c{j + 1}_{i + 1}" for j in range(outputs) if j != fixed}
