"""Simulate the linear systems of the papers: the fourth-order example, in open and closed loop."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]


def fourth_order() -> StateSpace:
    """Return the two-input, two-output fourth-order example, |poles| = 0.9475, with its Kalman gain, noise variance 1.

    It is the standard example of the closed-loop subspace literature (references [1], [2] of paper 000).
    """
    a = 0.67
    A = np.array([[a, a, 0, 0], [-a, a, 0, 0], [0, 0, -a, -a], [0, 0, a, -a]])
    B = np.array([[0.6598, -0.5256], [1.9698, 0.4845], [4.3171, -0.4879], [-2.6436, -0.3416]])
    C = np.array([[-0.3749, 0.0751, -0.5225, 0.583], [-0.8977, 0.7543, 0.1159, 0.0982]])
    K = np.array([[-0.6968, -0.1474], [0.1722, 0.5646], [0.6484, -0.466], [-0.94, 0.1032]])
    states = tuple(Signal(f"x{i + 1}") for i in range(4))
    inputs, outputs = (Signal("u1"), Signal("u2")), (Signal("y1"), Signal("y2"))
    return StateSpace(A, B, C, np.zeros((2, 2)), K, np.zeros(4), np.eye(2), 1.0, inputs, outputs, states)


def simulate_fourth_order(samples: int, seed: int, *, feedback: float = 0.0, noise_variance: float = 1.0) -> Record:
    """Simulate the fourth-order example under u = r − feedback · y with unit-variance white r.

    feedback: 0 is open loop, 0.25 the closed loop of the references; the loop then has direct feedthrough from the
    innovation of the very sample to the input, so D cannot be identified without bias.

    >>> simulate_fourth_order(2, 0).names("input", "output")
    ('u1', 'u2', 'y1', 'y2')
    """
    m = fourth_order()
    assert m.K is not None
    random = np.random.default_rng(seed)
    r = random.standard_normal((samples, 2))
    e = random.standard_normal((samples, 2)) * np.sqrt(noise_variance)
    x = np.zeros(4)
    values = np.empty((samples, 4))
    for k in range(samples):
        y = m.C @ x + e[k]
        u = r[k] - feedback * y
        values[k] = u[0], u[1], y[0], y[1]
        x = m.A @ x + m.B @ u + m.K @ e[k]
    channels = tuple(
        [Channel(s.name, "", "input") for s in m.inputs] + [Channel(s.name, "", "output") for s in m.outputs]
    )
    digest = hashlib.sha256(values.tobytes()).hexdigest()
    return Record(
        np.arange(samples, dtype=np.float64), values, channels, 1.0, f"fourth-order example, seed {seed}", digest
    )
