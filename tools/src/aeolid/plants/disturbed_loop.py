"""Simulate the example of paper 002: a second-order plant under PI control with a measured disturbance."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
RUN_IN = 500  # samples dropped: the loop forgets in some 60, its slow integrator in 700 and moves little


def disturbed_plant() -> StateSpace:
    """Return the plant of section 7.1: poles 0.9 ± 0.2 j, inputs u (delayed) and r, innovations of variance 0.36."""
    A = np.array([[1.8, -0.85], [1.0, 0.0]])
    B = np.array([[1.0, 0.0], [0.0, 0.5]])
    C, D = np.array([[-0.3, 1.0]]), np.array([[0.0, 1.0]])
    K = np.array([[0.1], [0.1]])
    states = (Signal("x1"), Signal("x2"))
    return StateSpace(
        A, B, C, D, K, np.zeros(2), np.array([[0.36]]), 1.0, (Signal("u"), Signal("r")), (Signal("y"),), states
    )


def simulate_disturbed_loop(
    samples: int, seed: int, *, noise: float = 0.6, dither: float = 0.2, forward: float = 0.0, back: float = 0.0
) -> Record:
    """Simulate u = −C(z) y + forward · r + η, C = 0.04 [1 + z/(30 (z − 1))], r white with standard deviation 0.5.

    noise, dither: standard deviations of v and η, those of the paper by default. forward: feedforward of r. back: r is
    white + back · y_{k−1}, a disturbance that is not free of feedback.

    >>> simulate_disturbed_loop(3, 0).names("input", "disturbance", "output")
    ('u', 'r', 'y')
    """
    m, random = disturbed_plant(), np.random.default_rng(seed)
    assert m.K is not None
    white = random.standard_normal((samples + RUN_IN, 3)) * [0.5, noise, dither]
    x, total, last = np.zeros(2), 0.0, 0.0
    values = np.empty((samples + RUN_IN, 3))
    for k, (r, v, eta) in enumerate(white):
        r += back * last
        y = float(m.C[0] @ x) + r + v
        total += y
        u = -0.04 * (y + total / 30) + forward * r + eta
        values[k] = u, r, y
        x = m.A @ x + m.B @ np.array([u, r]) + m.K[:, 0] * v
        last = y
    values = values[RUN_IN:]
    channels = (Channel("u", "", "input"), Channel("r", "", "disturbance"), Channel("y", "", "output"))
    digest = hashlib.sha256(values.tobytes()).hexdigest()
    time = np.arange(samples, dtype=np.float64)
    return Record(time, values, channels, 1.0, f"disturbed loop, seed {seed}", digest)


def numerators(model: StateSpace) -> Array:
    """Return a_1, a_2, b_u1, b_u2, b_r0, b_r1, b_r2 of a second-order model: d = 1 + a_1 z⁻¹ + a_2 z⁻², Table 1."""
    a = np.poly(model.A)[1:].real
    g = [model.D[0], model.C[0] @ model.B, model.C[0] @ model.A @ model.B]  # impulse responses of u and r
    b = np.array([g[0], g[1] + a[0] * g[0], g[2] + a[0] * g[1] + a[1] * g[0]])
    return np.array([*a, b[1, 0], b[2, 0], *b[:, 1]])
