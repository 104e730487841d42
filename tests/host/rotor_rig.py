"""Recordings of a rotor whose truth is known: blades that swing by themselves, a tower, and lines of the rotor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.1
FORE_AFT, SIDE_SIDE, DRIVE_TRAIN = (0.33, 0.03), (0.46, 0.012), (1.75, 0.02)  # Hz, damping
BLADE_HZ, BLADE_DAMPING, STIFFENING = 1.05, 0.01, 1.6  # standing still; ω² grows by so many Ω²
UNITS = {"deg": 360.0, "rad": 2 * np.pi, "rev": 1.0}


def blade_hz(rotor_hz: float) -> float:
    """Return the blades' own frequency in Hz on a rotor that turns: ω² = ω₀² + B Ω² (Southwell)."""
    return float(np.sqrt(BLADE_HZ**2 + STIFFENING * rotor_hz**2))


def swing(rng: np.random.Generator, count: int, hertz: float, damping: float) -> Array:
    """Return samples of a mode that white noise drives, of deviation 1: poles exp((−ζ ± i √(1 − ζ²)) 2π f h)."""
    pole = np.exp(2 * np.pi * hertz * STEP * (-damping + 1j * np.sqrt(1 - damping**2)))
    x = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(count + 2000))[2000:]
    return np.asarray(x / x.std(), dtype=np.float64)


def rotor(
    seed: int, rpm: float, count: int = 4000, unit: str = "deg", uneven: float = 0.0, lines: float = 0.5,
    wind: float | None = None,
) -> Record:  # fmt: skip
    """Return a recording of a tower, a shaft and three equal blades that do not shake each other.

    Such blades all swing at `blade_hz`: in the fixed frame the collective part at that, cosine and sine part at that
    less and plus 1P, as a backward and a forward whirl. uneven: relative deviation of the speed, which wanders; lines:
    size of 1P on the blades (gravity) and of 2P, 3P, 6P on the tower.
    """
    rng = np.random.default_rng(seed)
    slow = swing(rng, count, 0.01, 0.7)
    speed = rpm / 60 * (1 + uneven * slow)
    turned = np.cumsum(speed) * STEP + 0.1
    psi = 2 * np.pi * turned
    own = blade_hz(rpm / 60)
    blades = [
        swing(rng, count, own, BLADE_DAMPING) + 6 * lines * np.cos(psi + 2 * np.pi * b / 3) for b in range(3)
    ]  # fmt: skip
    driven = sum(lines * np.cos(k * psi + k) for k in (2, 3, 6))
    outputs = [
        swing(rng, count, *DRIVE_TRAIN), swing(rng, count, *FORE_AFT) + driven,
        swing(rng, count, *SIDE_SIDE) + 0.5 * driven, *blades,
    ]  # fmt: skip
    named = ["generator_speed", "tower_acc_fore_aft", "tower_acc_side_side", *(f"edge_moment_{b}" for b in (1, 2, 3))]
    units = ["rpm", "m/s^2", "m/s^2", *3 * ["kN m"]]
    channels = [Channel(n, u, "output") for n, u in zip(named, units, strict=True)]
    noisy = np.column_stack(outputs) + 0.02 * rng.standard_normal((count, 6))
    beside, more = [np.mod(turned, 1.0) * UNITS[unit], 60 * speed], [
        Channel("azimuth", unit, "azimuth"), Channel("rotor_speed", "rpm", "scheduling"),
    ]  # fmt: skip
    if wind is not None:
        beside, more = [*beside, wind * (1 + 0.1 * slow)], [*more, Channel("wind", "m/s", "scheduling")]
    values = np.column_stack([noisy, *beside])
    return Record(STEP * np.arange(count), values, (*channels, *more), STEP, f"rotor at {rpm:g} rpm", "")


def without(record: Record, *names: str) -> Record:
    """Return a recording without these channels."""
    kept = [i for i, c in enumerate(record.channels) if c.name not in names]
    channels = tuple(record.channels[i] for i in kept)
    return Record(record.time_s, record.values[:, kept], channels, record.sample_time_s, record.source, record.sha256)
