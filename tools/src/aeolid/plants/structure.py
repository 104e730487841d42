"""Simulate structures that random forces shake, with and without rotor harmonics, for operational modal analysis.

M q″ + D q′ + K q = B f, y = C q (+ sensor noise): f is white, or coloured by a first-order lag. The samples of the
states are those of the continuous system exactly: x_{k+1} = Φ x_k + w_k with Φ = exp(A h) and cov(w) by the integral of
Van Loan (1978). Harmonics are sines of multiples of the rotor's azimuth in the outputs, as a steady periodic force
leaves them there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_lyapunov

from aeolid.models.recursion import run_states
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Structure:
    """Hold a structure: mass, damping, stiffness (q, q), forces B (q, f), sensors C (l, q), names of the sensors."""

    mass: Array
    damping: Array
    stiffness: Array
    forces: Array
    sensors: Array
    names: tuple[str, ...]

    def state_space(self) -> tuple[Array, Array, Array]:
        """Return A (2q, 2q), B (2q, f), C (l, 2q) of the states [q; q′]."""
        q, inverse = len(self.mass), np.linalg.inv(self.mass)
        A = np.block([[np.zeros((q, q)), np.eye(q)], [-inverse @ self.stiffness, -inverse @ self.damping]])
        B = np.vstack([np.zeros((q, self.forces.shape[1])), inverse @ self.forces])
        return A, B, np.hstack([self.sensors, np.zeros_like(self.sensors)])

    def modes(self) -> tuple[Array, Array, ComplexArray]:
        """Return frequencies in Hz, damping ratios and shapes (l, modes) of the pairs of poles, by frequency."""
        A, _, C = self.state_space()
        s, v = np.linalg.eig(A)
        keep = np.flatnonzero(s.imag > 0)
        keep = keep[np.argsort(abs(s[keep]))]
        hertz = np.asarray(abs(s[keep]) / (2 * np.pi), dtype=np.float64)
        ratio = np.asarray(-s[keep].real / abs(s[keep]), dtype=np.float64)
        return hertz, ratio, (C @ v[:, keep]).astype(complex)


@dataclass(frozen=True)
class Harmonics:
    """Hold what a rotor adds: multiples of its speed with their rms beside each output's, and how the speed varies.

    rotor_hz: mean speed; orders, sizes: multiples and rms in units of the outputs' standard deviations; uneven: the
    relative standard deviation of the speed, slow beside a turn.
    """

    rotor_hz: float
    orders: tuple[int, ...]
    sizes: tuple[float, ...]
    uneven: float = 0.0


def shear_building() -> Structure:
    """Return four storeys, 0.6 … 3.2 Hz, damped 1 % in proportion and by a dashpot at the third: complex shapes."""
    q = 4
    K = 65.0 * (2 * np.eye(q) - np.eye(q, k=1) - np.eye(q, k=-1))
    K[-1, -1] = 65.0
    D = 0.0015 * K + 0.02 * np.eye(q)
    D[2, 2] += 0.25
    return Structure(np.eye(q), D, K, np.eye(q), np.eye(q), ("floor_1", "floor_2", "floor_3", "floor_4"))


def mass_chain(count: int = 7) -> Structure:
    """Return a chain of masses between the ground and a free end, a sensor on each: 0.5 … 4.8 Hz, damped 1 to 2 %.

    Stiffness falls by a fifth along it, so that no two shapes are alike on any two sensors.
    """
    springs = 240.0 * np.linspace(1.0, 0.8, count)
    K = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    D = 0.0008 * K + 0.06 * np.eye(count)
    names = tuple(f"level_{i + 1}" for i in range(count))
    return Structure(np.eye(count), D, K, np.eye(count), np.eye(count), names)


def tower_and_shaft() -> Structure:
    """Return five modes near those of a turbine, two of them at 0.31 and 0.335 Hz, seen by three sensors."""
    hertz, ratio = np.array([0.31, 0.335, 0.9, 1.31, 1.67]), np.array([0.008, 0.05, 0.02, 0.012, 0.025])
    omega = 2 * np.pi * hertz
    sensors = np.array([[1.0, 0.3, 0.6, -0.4, 0.2], [-0.2, 1.0, 0.3, 0.5, 0.3], [0.1, 0.3, -0.3, 0.2, 1.0]])
    forces = np.diag(omega)  # what white forces leave in each: of one order
    return Structure(
        np.eye(5), np.diag(2 * ratio * omega), np.diag(omega**2), forces, sensors, ("fore_aft", "side_side", "shaft")
    )


def shaken(
    structure: Structure, samples: int, sample_time_s: float, seed: int, *, colour_hz: float | None = None,
    noise: float = 0.03, harmonics: Harmonics | None = None, azimuth: bool = True,
) -> Record:  # fmt: skip
    """Return a recording of the sensors under random forces, from a state of its own distribution.

    colour_hz: corner of the lag that colours the forces, None for white ones; noise: of the sensors, in standard
    deviations of each output; harmonics: what the rotor adds; azimuth: whether its angle is recorded then, in degrees.
    """
    random = np.random.default_rng(seed)
    A, B, C = structure.state_space()
    if colour_hz is not None:
        A, B, C = _coloured(A, B, C, 2 * np.pi * colour_hz)
    Phi, Q = _sampled(A, B, sample_time_s)
    P = solve_continuous_lyapunov(A, -B @ B.T)
    x0 = _root(P) @ random.standard_normal(len(A))
    y = run_states(Phi, random.standard_normal((samples, len(A))) @ _root(Q).T, x0)[:-1] @ C.T
    size = np.sqrt(np.diag(C @ P @ C.T))
    y = y + noise * size * random.standard_normal(y.shape)
    t = np.asarray(np.arange(samples) * sample_time_s, dtype=np.float64)
    names = structure.names
    channels = [Channel(name, "m", "output") for name in names]
    if harmonics is not None:
        angle = _azimuth(harmonics, samples, sample_time_s, random)
        y = y + size * _lines(harmonics, angle, len(names), random)
        if azimuth:
            y = np.column_stack([y, np.mod(np.degrees(angle), 360.0)])
            channels.append(Channel("azimuth", "deg", "azimuth"))
    return Record(t, y, tuple(channels), sample_time_s, "simulated structure", "")


def _coloured(A: Array, B: Array, C: Array, corner: float) -> tuple[Array, Array, Array]:
    """Return the system with forces that are first-order lags of white noise of the same power at low frequencies."""
    n, f = B.shape
    whole = np.block([[A, B], [np.zeros((f, n)), -corner * np.eye(f)]])
    return whole, np.vstack([np.zeros((n, f)), corner * np.eye(f)]), np.hstack([C, np.zeros((len(C), f))])


def _sampled(A: Array, B: Array, step: float) -> tuple[Array, Array]:
    """Return exp(A h) and the covariance of what white forces of unit intensity add within a sample."""
    n = len(A)
    blocks = expm(np.block([[-A, B @ B.T], [np.zeros((n, n)), A.T]]) * step)
    Phi = blocks[n:, n:].T
    Q = Phi @ blocks[:n, n:]
    return Phi, (Q + Q.T) / 2


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    out: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return out


def _azimuth(harmonics: Harmonics, samples: int, step: float, random: np.random.Generator) -> Array:
    """Return the angle (N,) in rad: a speed that wanders within some ten turns."""
    memory = np.exp(-harmonics.rotor_hz * step / 10)
    pushed = np.sqrt(1 - memory**2) * random.standard_normal((samples, 1))
    wander = run_states(np.array([[memory]]), pushed, random.standard_normal(1))[:-1, 0]
    speed = 2 * np.pi * harmonics.rotor_hz * (1 + harmonics.uneven * wander)
    out: Array = random.uniform(0, 2 * np.pi) + np.cumsum(speed) * step
    return out


def _lines(harmonics: Harmonics, angle: Array, outputs: int, random: np.random.Generator) -> Array:
    """Return the sines (N, l), each output's with a size within a factor of two and a phase of its own."""
    out = np.zeros((len(angle), outputs))
    for order, size in zip(harmonics.orders, harmonics.sizes, strict=True):
        sizes = size * np.sqrt(2) * random.uniform(0.5, 1.0, outputs)
        out += sizes * np.cos(order * angle[:, None] + random.uniform(0, 2 * np.pi, outputs))
    return out
