"""Simulate the third-order loop on which recursive identification was shown: poles that drift, or jump."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
CHANGE = 665  # sample from which the poles move
CHANGES = ("none", "drift", "jump")
FEEDBACK = 0.25  # u = r − 0.25 y: the published study is in closed loop, its controller is not printed
A = np.array([[0.8, -0.4, 0.2], [0.0, 0.3, -0.5], [0.0, 0.0, 0.5]])
B = np.array([[0.0, 0.0], [0.0, -0.6], [0.5, 0.0]])
C = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0]])
STATE_NOISE, OUTPUT_NOISE = np.array([0.055, 0.05, 0.045]), np.array([0.025, 0.03])


def poles_at(sample: int, change: str) -> Array:
    """Return the three poles (3,) in force at a sample: A is triangular, its diagonal moves.

    drift: diag(−0.3, −0.5, 0.2) times 0 → 1 with a time constant of 2000 samples; jump: the third from 0.5 to 0.65.
    """
    if change not in CHANGES:
        raise UsageError(f"change {change!r} is none of {', '.join(CHANGES)}")
    poles = np.diag(A).copy()
    if sample <= CHANGE or change == "none":
        return poles
    if change == "jump":
        poles[2] = 0.65
        return poles
    part = (np.exp(-(sample - CHANGE) / 2000) - 1) / (np.exp(-1.0) - 1)
    moved: Array = poles + np.array([-0.3, -0.5, 0.2]) * part
    return moved


def simulate_moving_poles(samples: int, seed: int, change: str, *, snr_db: float = 25.0) -> Record:
    """Simulate x⁺ = A_k x + B u + F w, y = C x + G v, u = r − 0.25 y, r white of unit variance.

    snr_db: mean over the outputs of 10 log₁₀ of the power that r causes in y over that of the rest; F and G are scaled
    together from their printed values, over a run before the change.

    >>> simulate_moving_poles(2, 0, "jump").names("input", "output")
    ('u1', 'u2', 'y1', 'y2')
    """
    size = 10 ** ((_ratio_db() - snr_db) / 20)
    random = np.random.default_rng(seed)
    r, w, v = (random.standard_normal((samples, k)) for k in (2, 3, 2))
    values, x = np.empty((samples, 4)), np.zeros(3)
    for k in range(samples):
        moving = A + np.diag(poles_at(k, change) - np.diag(A))
        y = C @ x + size * OUTPUT_NOISE * v[k]
        u = r[k] - FEEDBACK * y
        values[k] = *u, *y
        x = moving @ x + B @ u + size * STATE_NOISE * w[k]
    names = (("u1", "input"), ("u2", "input"), ("y1", "output"), ("y2", "output"))
    channels = tuple(Channel(name, "", role) for name, role in names)
    digest = hashlib.sha256(values.tobytes()).hexdigest()
    time = np.arange(samples, dtype=np.float64)
    return Record(time, values, channels, 1.0, f"moving poles ({change}), seed {seed}", digest)


def _ratio_db() -> float:
    """Return the signal-to-noise ratio with F and G as printed, from the impulse responses of the loop."""
    closed, signal, noise = A - FEEDBACK * B @ C, np.zeros(2), OUTPUT_NOISE**2
    into = np.hstack([np.diag(STATE_NOISE), -FEEDBACK * B @ np.diag(OUTPUT_NOISE)])
    power = np.eye(3)
    for _ in range(200):
        signal = signal + ((C @ power @ B) ** 2).sum(axis=1)
        noise = noise + ((C @ power @ into) ** 2).sum(axis=1)
        power = closed @ power
    return float(np.mean(10 * np.log10(signal / noise)))
