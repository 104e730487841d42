"""Choose how many Runge–Kutta steps a sample needs: from where a run starts, and from the states that it has passed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.models.march import eigenvalues_at_most, fastest_at_most, state_jacobian

Array = NDArray[np.float64]
_RATE = 0.5  # fastest eigenvalue times step: local error of the fourth-order rule below 3e-4 of that mode (step^5/120)
MOST_AT_START = (
    200  # steps a sample that the start of a run asks for at most: dry friction is steep beyond measure there
)
MOST = 20_000  # steps a sample that a free run takes at most; beyond that the model is stiff
_WORK = 200_000_000  # steps of a whole free run at most: some ten seconds of a small model
_PLACES = 64  # rows of a run that are looked at, beside those where a state is largest or smallest


class Runs(Protocol):
    """What is asked of a compiled model (`integrate.Compiled`)."""

    @property
    def step_s(self) -> float:
        """Return the sample time in discrete time, 0 in continuous time."""

    @property
    def order(self) -> int:
        """Return the number of states, memories not among them."""

    @property
    def flow(self) -> int:
        """Return where the function lies that gives the states' derivatives."""

    @property
    def velocities(self) -> Sequence[int]:
        """Return the places of the states v where some dq/dt = v."""

    def settled(self, x: Array, u: Array, theta: Array, step: float = 1.0) -> Array:
        """Return x (n + memories,) with the memories settled for it."""


def substeps(compiled: Runs, middle: Array, theta: Array, x0: Array, step: float) -> int:
    """Return how many Runge–Kutta steps a sample needs: fastest eigenvalue times step at most 0.5.

    Looked at where the run starts and, because dry friction is steepest there, at rest: otherwise two stretches of one
    recording, one that starts at rest and one in motion, would be integrated as two different models. middle (r,): the
    typical input.
    """
    if compiled.step_s > 0 or not len(x0):
        return 1
    u, th = np.ascontiguousarray(middle, dtype=np.float64), np.ascontiguousarray(theta, dtype=np.float64)
    n, places = compiled.order, [x0]
    if x0[list(compiled.velocities)].any():
        rest = x0.copy()
        rest[list(compiled.velocities)] = 0.0
        places.append(rest)
    settled = np.array([compiled.settled(x, u, th) for x in places])
    if fastest_at_most(compiled.flow, n, settled, u, th) * step <= _RATE:
        return 1
    jacobians = np.stack([state_jacobian(compiled.flow, n, x, u, th) for x in settled])
    if not all(math.isfinite(float(j.sum())) for j in jacobians):
        return 4
    fastest = float(np.max(np.abs(np.linalg.eigvals(jacobians)), initial=0.0))
    return int(min(MOST_AT_START, _steps(fastest, step)))


def substeps_along(compiled: Runs, X: Array, U: Array, theta: Array, step: float) -> int:
    """Return how many steps the fastest eigenvalue at the states of a run needs: a drag is none at its start.

    X (N + 1, n + memories): the states as `Compiled.predict` returns them; U (N, at least r): the inputs, the states'
    columns first. Looked at: some rows all through the run, and those where a state is largest or smallest; rows that
    are not finite are left out. 1 in discrete time. Cost: 2n evaluations of the equations a row that is looked at.
    """
    n = compiled.order
    if compiled.step_s > 0 or not n:
        return 1
    th, fastest = np.ascontiguousarray(theta, dtype=np.float64), 0.0
    for row in _rows(X[: len(U)], n):
        J = state_jacobian(compiled.flow, n, np.ascontiguousarray(X[row]), np.ascontiguousarray(U[row]), th)
        if eigenvalues_at_most(J) > fastest and np.all(np.isfinite(J)):
            fastest = max(fastest, float(np.max(np.abs(np.linalg.eigvals(J)))))
    return _steps(fastest, step)


def most_steps(samples: int) -> int:
    """Return how many steps a sample a free run of so many samples may take."""
    return max(MOST_AT_START, min(MOST, _WORK // max(samples, 1)))


def _rows(X: Array, n: int) -> NDArray[np.int64]:
    """Return the rows to look at."""
    known = np.flatnonzero(np.all(np.isfinite(X), axis=1))
    if not len(known):
        return known
    spread = known[np.unique(np.linspace(0, len(known) - 1, min(_PLACES, len(known))).astype(np.int64))]
    states = X[known, :n]
    return np.unique(np.concatenate([spread, known[np.argmax(states, axis=0)], known[np.argmin(states, axis=0)]]))


def _steps(fastest: float, step: float) -> int:
    """Return the steps a sample for a fastest eigenvalue in 1/s, bounded to what a whole number holds."""
    wanted = fastest * step / _RATE
    return max(1, math.ceil(wanted)) if wanted < 1e9 else 1_000_000_000
