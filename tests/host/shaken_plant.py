"""Make outputs of a turbine that noise shakes: two modes with known poles, and a force three times a turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

STEP_S = 0.1
TOWER, DRIVE_TRAIN = (0.33, 0.02), (1.67, 0.03)  # Hz, damping
ROTOR_RPM, THRICE_HZ = 12.0, 0.6
UNITS = {"tower_fore_aft": "m/s^2", "generator_speed": "rpm"}


def swing(mode: tuple[float, float], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a mode (N,) of deviation 1 driven by white noise (N,): poles exp(2 pi f h (-z + i sqrt(1 - z^2)))."""
    hertz, damping = mode
    pole = np.exp(2 * np.pi * hertz * STEP_S * (-damping + 1j * np.sqrt(1 - damping**2)))
    moved = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], noise)
    out: NDArray[np.float64] = moved / moved.std()
    return out


def shake(samples: int, seed: int, force: float = 0.0) -> NDArray[np.float64]:
    """Return fore-aft acceleration and generator speed (N, 2); force: amplitude of the line at THRICE_HZ in both."""
    random = np.random.default_rng(seed)
    tower, shaft = (swing(mode, random.standard_normal(samples)) for mode in (TOWER, DRIVE_TRAIN))
    line = force * np.sin(2 * np.pi * THRICE_HZ * STEP_S * np.arange(samples) + 0.5)
    slow = lfilter([0.1], [1.0, -0.99], random.standard_normal(samples))
    noise = 0.02 * random.standard_normal((samples, 2))
    return np.column_stack([tower + 0.1 * shaft + line, shaft + slow + 0.5 * line]) + noise
