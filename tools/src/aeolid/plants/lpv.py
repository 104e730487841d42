"""Simulate the scheduled systems of paper 001: fourth order, flapping blade, bilinear."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from aeolid.models.lpv import LpvStateSpace, apply_at, run_scheduled
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
BLADE_PERIOD = 10  # samples of one turn of the flapping blade
BLADE_NOISE = 0.1  # variance of its process noise in closed loop, paper 001 section 7.2


def scheduled_system(
    A: Sequence[Array], B: Sequence[Array], C: Array, K: Sequence[Array] | None = None
) -> LpvStateSpace:
    """Return a model from its matrices; a list shorter than A is constant in what it lacks."""
    m, n = len(A), len(A[0])
    r, outputs = np.shape(B[0])[1], len(C)
    stacks = []
    for given, shape in ((A, (n, n)), (B, (n, r)), ([C], (outputs, n)), (K or [], (n, outputs))):
        stack = np.zeros((m, *shape))
        for i, matrix in enumerate(given):
            stack[i] = matrix
        stacks.append(stack)
    u, y, x = (tuple(Signal(f"{c}{i + 1}") for i in range(k)) for c, k in (("u", r), ("y", outputs), ("x", n)))
    return LpvStateSpace(
        stacks[0], stacks[1], stacks[2], np.zeros((m, outputs, r)), stacks[3], np.zeros((m, n)), np.zeros(n), None, 1.0,
        u, y, x, tuple(Signal(f"mu{i + 1}") for i in range(1, m)),
    )  # fmt: skip


def benchmark() -> LpvStateSpace:
    """Return the open-loop fourth-order benchmark of paper 001 section 7.1: m = 4, two inputs, three outputs."""
    a1, a2 = (np.vstack([row, np.eye(4)[:3]]) for row in
              ([-1.3, -0.6325, -0.1115, 0.0596], [-0.51, -0.1075, -0.007275, -6.25e-05]))  # fmt: skip
    b1 = np.array([[0.0, 1.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    other = np.zeros((4, 2))
    other[3] = 0.3
    return scheduled_system(
        [a1, a2, np.diag([0.2, 0.4, 0.0, 0.0]), np.diag([0.0, 0.0, 0.3, 0.3])], [b1, other, other, other], np.eye(4)[:3]
    )


def flapping_blade(identity_output: bool = True) -> LpvStateSpace:
    """Return the flapping dynamics of a wind turbine's blade, paper 001 section 7.2; y is both states or the first."""
    A = [np.array([[0.0, 0.0734], [-6.5229, -0.4997]]), np.array([[-0.0021, 0.0], [-0.0138, 0.5196]])]
    C = np.eye(2) if identity_output else np.eye(2)[:1]
    return scheduled_system(A, [np.array([[-0.7221], [-9.6277]])], C)


def bilinear_system() -> LpvStateSpace:
    """Return the second-order bilinear system of paper 001 section 7.3; its scheduling is the input."""
    A = [np.array([[0.5, 0.5], [-0.5, 0.5]]), np.array([[0.2, 0.2], [-0.2, 0.2]])]
    model = scheduled_system(A, [np.array([[1.0], [0.0]])], np.ones((1, 2)))
    return LpvStateSpace(**(model.__dict__ | {"scheduling": (Signal("u1"),)}))


def blade_scheduling(samples: int) -> Array:
    """Return cos(2πk/10) + 0.2, (N, 1)."""
    return np.cos(2 * np.pi * np.arange(samples) / BLADE_PERIOD)[:, None] + 0.2


def benchmark_signals(samples: int, random: np.random.Generator, most: float = 0.65) -> tuple[Array, Array]:
    """Return white inputs (N, 2) and the scheduling (N, 3) of the benchmark, ρ uniform in 0 … most.

    [ρ, ρ/2 sin(2πk/100), ρ/2 cos(2πk/100)]; for ρ above 0.65 the frozen first two models are hardly stable.
    """
    rho = random.uniform(0.0, most, samples)
    angle = 2 * np.pi * np.arange(samples) / 100
    return random.standard_normal((samples, 2)), np.column_stack(
        [rho, 0.5 * np.sin(angle) * rho, 0.5 * np.cos(angle) * rho]
    )


def bilinear_input(samples: int, random: np.random.Generator) -> Array:
    """Return white noise under a fourth-order Butterworth low-pass at 0.8 of the Nyquist frequency, (N, 1)."""
    b, a = butter(4, 0.8)
    return np.asarray(lfilter(b, a, random.standard_normal(samples)))[:, None]


def record_of(model: LpvStateSpace, u: Array, scheduling: Array, y: Array, source: str) -> Record:
    """Return a recording of a model's channels; a scheduling that is an input is not written twice."""
    own = [i for i, s in enumerate(model.scheduling) if s.name not in {i.name for i in model.inputs}]
    values = np.hstack([u, scheduling[:, own], y])
    channels = (
        *(Channel(s.name, s.unit, "input") for s in model.inputs),
        *(Channel(model.scheduling[i].name, model.scheduling[i].unit, "scheduling") for i in own),
        *(Channel(s.name, s.unit, "output") for s in model.outputs),
    )
    digest = hashlib.sha256(values.tobytes()).hexdigest()
    time_s: Array = np.arange(len(values)) * np.float64(model.sample_time_s)
    return Record(time_s, values, channels, model.sample_time_s, source, digest)


def run_in_loop(
    model: LpvStateSpace, scheduling: Array, reference: Array, feedback: Array, state_noise: Array,
    output_noise: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Run x⁺ = A(μ) x + B(μ) u + w, y = C x + v under u = r − F_k y, y of the same sample; returns u (N, r), y (N, l).

    reference (N, r), feedback F (N, r, l), state_noise w (N, n), output_noise v (N, l). The model has no feedthrough.
    """
    mu = np.hstack([np.ones((len(scheduling), 1)), scheduling])
    A, B, C = (np.tensordot(mu, matrix, axes=1) for matrix in (model.A, model.B, model.C))
    u, y, x = np.empty_like(reference), np.empty_like(output_noise), np.zeros(model.order)
    for k in range(len(mu)):
        y[k] = C[k] @ x + output_noise[k]
        u[k] = reference[k] - feedback[k] @ y[k]
        x = A[k] @ x + B[k] @ u[k] + state_noise[k]
    return u, y


def periodic_regulator(model: LpvStateSpace, scheduling: Array, weight: float = 1.0) -> Array:
    """Return the feedback (P, r, n) of the periodic Riccati equation over one period of scheduling (P, m − 1).

    Least Σ |x|² + weight |u|²: the equation is run backwards in time until the gains of successive periods agree.
    """
    mu = np.hstack([np.ones((len(scheduling), 1)), scheduling])
    A, B = (np.tensordot(mu, matrix, axes=1) for matrix in (model.A, model.B))
    period, (n, r) = len(mu), B.shape[1:]
    P, gains = np.eye(n), np.zeros((period, r, n))
    for _ in range(1000):
        before = gains.copy()
        for k in reversed(range(period)):
            gains[k] = np.linalg.solve(weight * np.eye(r) + B[k].T @ P @ B[k], B[k].T @ P @ A[k])
            P = np.eye(n) + A[k].T @ P @ (A[k] - B[k] @ gains[k])
            P = (P + P.T) / 2
        if np.abs(gains - before).max() < 1e-12:
            break
    return gains


def simulate_blade_in_loop(samples: int, seed: int, noise: float = BLADE_NOISE) -> Record:
    """Simulate the blade of section 7.2 in closed loop: u = r − F_k x, white r, process noise, period 10.

    noise: variance of the process noise of each state.
    """
    model, random = flapping_blade(), np.random.default_rng(seed)
    scheduling = blade_scheduling(samples)
    gains = periodic_regulator(model, scheduling[:BLADE_PERIOD])
    feedback = gains[np.arange(samples) % BLADE_PERIOD]
    reference = random.standard_normal((samples, 1))
    state_noise = random.standard_normal((samples, 2)) * np.sqrt(noise)
    u, y = run_in_loop(model, scheduling, reference, feedback, state_noise, np.zeros((samples, 2)))
    return record_of(model, u, scheduling, y, f"flapping blade, seed {seed}")


def simulate_open(
    model: LpvStateSpace, u: Array, scheduling: Array, random: np.random.Generator, variance_ratio: float = np.inf
) -> tuple[Record, Array]:
    """Return the recording of a free run with white noise on the outputs, and the noise-free outputs (N, l).

    variance_ratio: of signal to noise for each output (10^(dB/10)); infinite is no noise.
    """
    mu = np.hstack([np.ones((len(scheduling), 1)), scheduling])
    states = run_scheduled(model.A, mu, apply_at(model.B, mu, u), model.x0)[:-1]
    y = apply_at(model.C, mu, states)
    noise = random.standard_normal(y.shape) * y.std(axis=0) / np.sqrt(variance_ratio)
    return record_of(model, u, scheduling, y + noise, "simulated"), y
