"""Derive the prediction errors of a model in innovation form with respect to its matrices.

e = y − C x − D u, x⁺ = A x + B u + K e gives for a change (δA, δB, δK, δC, δD), with Ā = A − K C,

    ∂e = −C ∂x − δC x − δD u,     ∂x⁺ = Ā ∂x + (δA − K δC) x + (δB − K δD) u + δK e.

A change of the state's basis, T = I + εX, moves the matrices by (X A − A X, X B, X K, −C X, 0) and leaves e as it is.
Only the directions at right angles to those n² are followed (data-driven local coordinates: McKelvey, Helmersson and
Ribarits 2004), n (r + 2 l) and what D has free, so that the information is regular where the model is minimal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from aeolid.compiled import njit
from aeolid.identify.subspace import ScaledModel

Array = NDArray[np.float64]
CHUNK_NUMBERS = 4_000_000  # of the derivatives held at a time: 32 MB


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Hold the directions in which a model is moved.

    basis (npar, free): orthonormal, of θ = [A B K], [C D] row by row, D with its columns of `through` only.
    """

    basis: Array
    through: NDArray[np.int64]

    @property
    def free(self) -> int:
        """Return the number of directions."""
        return int(self.basis.shape[1])

    @classmethod
    def at(cls, model: ScaledModel, feedthrough: tuple[bool, ...]) -> Coordinates:
        """Find the directions at right angles to the changes of basis; cost npar³ operations at most."""
        through = np.flatnonzero(feedthrough)
        n = len(model.A)
        changes = np.empty((pack(model, through).size, n * n))
        zero = np.zeros((model.C.shape[0], len(model.B[0])))
        for i in range(n):
            for j in range(n):
                X = np.zeros((n, n))
                X[i, j] = 1.0
                A, B, K, C = X @ model.A - model.A @ X, X @ model.B, X @ model.K, -model.C @ X
                changes[:, i * n + j] = pack(replace(model, A=A, B=B, C=C, D=zero, K=K), through)
        Q = qr(changes, mode="full")[0]
        return cls(np.ascontiguousarray(Q[:, n * n :]), through)

    def move(self, model: ScaledModel, delta: Array) -> ScaledModel:
        """Return the model moved by delta (free,)."""
        theta = pack(model, self.through) + self.basis @ delta
        A, B, K, C, D = (part[..., 0] for part in unpack(model, self.through, theta[:, None]))
        return replace(model, A=A, B=B, K=K, C=C, D=D)

    def directions(self, model: ScaledModel) -> tuple[Array, Array]:
        """Return what the directions add: to the next state (n + r + l, n, free), to the error (n + r, l, free).

        They multiply [x; u; e] and [x; u].
        """
        A, B, K, C, D = unpack(model, self.through, self.basis)
        A, B = A - np.einsum("il,ljp->ijp", model.K, C), B - np.einsum("il,ljp->ijp", model.K, D)
        state = np.concatenate([A, B, K], axis=1).transpose(1, 0, 2)
        return state, -np.concatenate([C, D], axis=1).transpose(1, 0, 2)


def pack(model: ScaledModel, through: NDArray[np.int64]) -> Array:
    """Return θ (npar,): [A B K], then [C D], row by row; of D the columns of `through`."""
    state = np.hstack([model.A, model.B, model.K])
    return np.concatenate([state.ravel(), np.hstack([model.C, model.D[:, through]]).ravel()])


def unpack(
    model: ScaledModel, through: NDArray[np.int64], theta: Array
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Part columns of θ (npar, ·) into those of A, B, K, C and D (rows, columns, ·) of models like this one."""
    (n, r), outputs, count = model.B.shape, len(model.C), theta.shape[1]
    width = n + r + outputs
    state = theta[: n * width].reshape(n, width, count)
    output = theta[n * width :].reshape(outputs, n + len(through), count)
    D = np.zeros((outputs, r, count))
    D[:, through] = output[:, n:]
    return state[:, :n], state[:, n : n + r], state[:, n + r :], output[:, :n], D


def chunk_length(model: ScaledModel, coordinates: Coordinates) -> int:
    """Return how many samples' derivatives are held at a time."""
    return max(CHUNK_NUMBERS // (len(model.A) * (len(model.A) + coordinates.free)), 16)


def error_derivatives(
    model: ScaledModel, coordinates: Coordinates, weight: Array, x: Array, u: Array, e: Array, dx: Array
) -> Array:
    """Return Wᵀ ∂e (N, l, n + free) for the first state and the directions, and move dx on by N samples.

    weight W (l, l); x (N, n), u (N, r), e (N, l): states, inputs and errors along one stretch; dx (n, n + free): ∂x at
    its first sample, overwritten by that after the last. Cost: 2 N n (n + r + l) free operations, and 2 N n (n + l)
    (n + free) of the recursion.
    """
    state, error = coordinates.directions(model)
    error = np.ascontiguousarray(np.einsum("qlp,lw->qwp", error, weight))
    phi, n = np.hstack([x, u, e]), len(dx)
    forced = (phi @ state.reshape(len(state), -1)).reshape(len(x), n, -1)
    out = np.empty((len(x), len(model.C), dx.shape[1]))
    out[:, :, n:] = (phi[:, : len(error)] @ error.reshape(len(error), -1)).reshape(len(x), len(model.C), -1)
    out[:, :, :n] = 0.0
    closed = np.ascontiguousarray(model.A - model.K @ model.C)
    _accumulate(closed, np.ascontiguousarray(weight.T @ model.C), forced, dx, out)
    return out


@njit(fastmath=True, cache=True)
def _accumulate(A: Array, C: Array, forced: Array, dx: Array, out: Array) -> None:
    """Take C ∂x off out (N, l, n + free); ∂x⁺ = A ∂x, to whose last columns forced (N, n, free) adds, in dx."""
    n, width = dx.shape
    free = forced.shape[2]
    first = width - free
    following = np.empty((n, width))
    for k in range(forced.shape[0]):
        for i in range(C.shape[0]):
            for j in range(n):
                c = C[i, j]
                for p in range(width):
                    out[k, i, p] -= c * dx[j, p]
        for i in range(n):
            for p in range(first):
                following[i, p] = 0.0
            for p in range(free):
                following[i, first + p] = forced[k, i, p]
            for j in range(n):
                a = A[i, j]
                for p in range(width):
                    following[i, p] += a * dx[j, p]
        for i in range(n):
            for p in range(width):
                dx[i, p] = following[i, p]
