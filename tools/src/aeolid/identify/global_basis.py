"""Bring the models of several set-ups to one basis by the references, and join them to one realisation (PreGER).

Set-up j has A_j (n_j), C_j = [C_ref; C_mov,j] in a basis of its own, and the structure is one: the observability
matrices O_j = [C_ref; C_ref A_j; …] of the references span one space. With S_j S_jᵀ the covariance of the states and
g_j the root of the samples over the level of the references, M_j = g_j O_j S_j,
    [M_1 … M_J] ≈ U Σ Vᵀ of rank n,     T_j = g_j S_j Z_j⁺,  Z_j = Uᵀ M_j,     O_j T_j ≈ U:
T_j, which regresses the states of set-up j on the common ones, takes what excites each set-up out of it. Then
    A = U↑⁺ U↓,      C = [the first rows of U; C_mov,1 T_1; …; C_mov,J T_J]
(Döhler, Andersen and Mevel 2010, "Data merging for multi-setup operational modal analysis with data-driven SSI"; Mevel,
Basseville, Benveniste and Goursat 2002), with models in place of their Hankel matrices. A comes from the references'
rows, to which every set-up gives its part; those of moved sensors would count the set-ups with many of them twice.

First-order spread: ΔO_{k+1} = ΔO_k A_j + O_k ΔA_j, and for the leading left singular vectors, b beyond n,
    u_bᵀ ΔU = (u_bᵀ ΔM V Σ + σ_b v_bᵀ ΔMᵀ U)(Σ² − σ_b²)⁻¹;
turns within the n columns change the basis only. S_j is held fixed: a weight of what agrees. Set-ups add.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq, pinv, svd
from aeolid.errors import NotIdentifiable
from aeolid.identify.subspace import ScaledModel
from aeolid.identify.uncertainty import MatrixSpread

Array = NDArray[np.float64]
RANK = 1e-10  # of the references' observability, beside its largest singular value: below is rounding
CHUNK_NUMBERS = 4_000_000  # held at a time where spreads are pushed through


@dataclass(frozen=True, eq=False)
class Part:
    """Hold the model of a set-up: A (n_j, n_j), C (l, n_j) references first, S (n_j, k) that weights the states.

    root (d, n_j + l, n_j): what white noise moves [A; C] by, None where that is not known.
    """

    A: Array
    C: Array
    S: Array
    root: Array | None = None


@dataclass(frozen=True, eq=False)
class Joint:
    """Hold the realisation of all set-ups: A (n, n), C (L, n), references first, and what its spread needs.

    observed: O_j (i, l, n_j); weighted: g_j S_j; U (i r, q), sigma (q,), V (Σ k, q); maps: T_j (n_j, n).
    """

    A: Array
    C: Array
    references: int
    observed: tuple[Array, ...]
    weights: tuple[Array, ...]
    U: Array
    sigma: Array
    V: Array
    maps: tuple[Array, ...]

    @property
    def model(self) -> ScaledModel:
        """Return A and C as a model without inputs."""
        n, outputs = len(self.A), len(self.C)
        none, gain = np.zeros((n + outputs, 0)), np.zeros((n, outputs))
        return ScaledModel(self.A, none[:n], self.C, none[n:], gain, np.zeros((outputs, outputs)), "none")


def observability(A: Array, C: Array, blocks: int) -> Array:
    """Return C, C A, … C A^(i−1), (i, l, n)."""
    out = np.empty((blocks, *C.shape))
    out[0] = C
    for k in range(1, blocks):
        out[k] = out[k - 1] @ A
    return out


def join(parts: Sequence[Part], references: int, order: int, blocks: int) -> Joint:
    """Return one realisation of the order n from models of n_j states, by i blocks of observability.

    Raises NotIdentifiable where the references observe fewer than n states. Cost: (i r)² Σ n_j operations.
    """
    observed = tuple(observability(p.A, p.C, blocks) for p in parts)
    seen = [o[:, :references].reshape(blocks * references, -1) for o in observed]
    weights = tuple(p.S for p in parts)
    U, sigma, Vt = svd(np.hstack([o @ w for o, w in zip(seen, weights, strict=True)]))
    rank = int(np.count_nonzero(sigma > RANK * sigma[0]))
    if rank < order or (blocks - 1) * references < order:
        raise NotIdentifiable(
            f"the references observe {min(rank, (blocks - 1) * references)} states of all set-ups together, and "
            f"{order} are needed: a mode does not move them; choose references away from its nodes, or a lower --order"
        )
    basis = U[:, :order]
    maps = tuple(
        w @ pinv(basis.T @ o @ w, rcond=RANK) for o, w in zip(seen, weights, strict=True)
    )  # fmt: skip
    up, down = basis[:-references], basis[references:]
    A = lstsq(up, down)
    C = np.vstack([basis[:references], *(p.C[references:] @ T for p, T in zip(parts, maps, strict=True))])
    return Joint(A, C, references, observed, weights, U, sigma, Vt.T, maps)


def spreads(parts: Sequence[Part], joint: Joint) -> Iterator[MatrixSpread]:
    """Give the first-order spread of [A; C] of the realisation in pieces, all independent of each other.

    Cost: some d i r n (n_j + n) operations a set-up; memory of CHUNK_NUMBERS and one piece.
    """
    for j, part in enumerate(parts):
        if part.root is None:
            continue
        size = joint.observed[j].size + len(joint.U) * (len(joint.A) + len(joint.weights[j].T)) + joint.C.size
        step = max(1, CHUNK_NUMBERS // (2 * size))
        for first in range(0, len(part.root), step):
            rows = _moved(parts, joint, j, part.root[first : first + step])
            yield MatrixSpread(rows.reshape(len(rows), -1), len(joint.A), 0)


def _moved(parts: Sequence[Part], joint: Joint, j: int, moved: Array) -> Array:
    """Return Δ[A; C] (d, n + L, n) of the realisation where [A; C] of one set-up moves, (d, n_j + l, n_j)."""
    r, n = joint.references, len(joint.A)
    dA, dC = np.split(moved, [len(parts[j].A)], axis=1)
    steps = [dC]
    for block in joint.observed[j][:-1]:
        steps.append(steps[-1] @ parts[j].A + block @ dA)
    seen = np.stack([s[:, :r] for s in steps], axis=1).reshape(len(dA), len(joint.U), -1)  # of O_j
    dM = seen @ joint.weights[j]
    dU = _turned(joint, j, dM)
    basis = joint.U[:, :n]
    up, rest = basis[:-r], basis[r:] - basis[:-r] @ joint.A
    inverse = pinv(up)
    rows = [inverse @ (dU[:, r:] - dU[:, :-r] @ joint.A) + inverse @ inverse.T @ dU[:, :-r].transpose(0, 2, 1) @ rest]
    rows.append(dU[:, :r])
    for k, part in enumerate(parts):
        M = joint.observed[k][:, :r].reshape(len(basis), -1) @ joint.weights[k]
        dZ = dU.transpose(0, 2, 1) @ M + (basis.T @ dM if k == j else 0.0)
        own = part.C[r:] @ (joint.weights[k] @ _inverse_moved(basis.T @ M, dZ))
        rows.append(own + dC[:, r:] @ joint.maps[k] if k == j else own)
    return np.concatenate(rows, axis=1)


def _turned(joint: Joint, j: int, dM: Array) -> Array:
    """Return ΔU (d, i r, n) of the leading singular vectors where M_j moves by dM (d, i r, k), but for turns."""
    n = len(joint.A)
    first = sum(w.shape[1] for w in joint.weights[:j])
    V = joint.V[first : first + joint.weights[j].shape[1]]
    U, rest, sigma, tail = joint.U[:, :n], joint.U[:, n:], joint.sigma[:n], joint.sigma[n:]
    forward = dM @ V[:, :n] * sigma  # (d, i r, n): ΔM V Σ
    back = (V[:, n:].T @ dM.transpose(0, 2, 1)) @ U * tail[:, None]  # (d, q − n, n)
    gap = np.maximum(sigma**2 - tail[:, None] ** 2, RANK**2 * sigma[0] ** 2)
    within = rest @ ((rest.T @ forward + back) / gap)
    beyond = forward - joint.U @ (joint.U.T @ forward)
    out: Array = within + beyond / sigma**2
    return out


def _inverse_moved(Z: Array, dZ: Array) -> Array:
    """Return ΔZ⁺ (d, k, n) where Z (n, k) moves by dZ (d, n, k) and keeps its rank.

    Its derivative is that of Golub and Pereyra (1973).
    """
    plus = pinv(Z, rcond=RANK)
    turned = dZ.transpose(0, 2, 1)
    left, right = turned @ (plus.T @ plus), plus @ plus.T @ turned
    moved: Array = left - plus @ (Z @ left) + right - right @ Z @ plus - plus @ (dZ @ plus)
    return moved
