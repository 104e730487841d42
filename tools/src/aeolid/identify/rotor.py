"""Find how fast the rotor turns, and how evenly, from its azimuth or its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.models.rotor_angle import azimuth_of, speed_channel, turns_a_second
from aeolid.record import Record

Array = NDArray[np.float64]
STANDS = 1e-4  # Hz; slower than a turn in three hours is standing still


@dataclass(frozen=True)
class Rotation:
    """Hold the rotor's mean frequency in Hz and the standard deviation of its speed, taken over whole turns, in Hz."""

    frequency_hz: float
    deviation_hz: float


def rotation(record: Record) -> Rotation | None:
    """Return how the rotor turns: by the azimuth, else by a rotor speed; None where neither is there, or it stands."""
    azimuth = azimuth_of(record)
    if azimuth is not None:
        return _turning(np.mod(np.diff(azimuth) + 0.5, 1.0) - 0.5, record.sample_time_s)
    channel = speed_channel(record)
    if channel is None:
        return None
    turned = record.column(channel.name)[1:] * (turns_a_second(channel.unit) or 1.0) * record.sample_time_s
    return _turning(turned, record.sample_time_s)


def rotation_by_parts(cosine: Array, sine: Array, sample_time_s: float) -> Rotation | None:
    """Return how an angle turns by cosine and sine (N,), the frequency below 0 where it falls; None if it stands."""
    steps = np.mod(np.diff(np.arctan2(sine, cosine)) / (2 * np.pi) + 0.5, 1.0) - 0.5
    found = _turning(steps, sample_time_s)
    falls = found is not None and np.nanmean(steps) < 0
    return Rotation(-found.frequency_hz, found.deviation_hz) if found is not None and falls else found


def rotor_frequency(record: Record) -> float | None:
    """Return the mean rotor speed in Hz, None where it is not known."""
    found = rotation(record)
    return None if found is None else found.frequency_hz


def _turning(steps: Array, sample_time_s: float) -> Rotation | None:
    """Return the rotation of steps (N,) in turns a sample, NaN where one is not known."""
    known = steps[np.isfinite(steps)]
    mean = abs(float(known.mean())) if len(known) else 0.0
    if mean <= STANDS * sample_time_s:
        return None
    length = max(min(round(1 / mean), len(known)), 1)  # a turn: an azimuth that is uneven within it says nothing
    total = np.concatenate([[0.0], np.cumsum(known)])
    speed = (total[length:] - total[:-length]) / length
    return Rotation(mean / sample_time_s, float(speed.std()) / sample_time_s)
