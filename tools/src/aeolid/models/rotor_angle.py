"""Tell the angle of the rotor from its recorded azimuth, or up to where it began from its recorded speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.formats.meanings import meaning_of
from aeolid.models.angles import turn_of, wraps
from aeolid.record import Channel, Record
from aeolid.units import rightly, same_unit

Array = NDArray[np.float64]
TURNS = {"rpm": 1 / 60, "1/min": 1 / 60, "rad/s": 1 / (2 * np.pi), "deg/s": 1 / 360, "Hz": 1.0, "1/s": 1.0}


def azimuth_of(record: Record) -> Array | None:
    """Return the recorded azimuth (N,) in turns, NaN where it is missing; None where no channel has the role.

    Raises DataError where the unit is not one of angles, or where the values wrap at a turn of another unit.
    """
    for channel in record.of("azimuth"):
        turn, values = turn_of(channel.unit), record.column(channel.name)
        if turn is None:
            raise DataError(
                f"{record.source}: the azimuth {channel.name!r} is in {channel.unit or 'no unit'!r}, no unit of "
                "angles; name deg, rad or rev in the roles file"
            )
        for unit in ("deg", "rad", "rev"):
            other = turn_of(unit) or turn
            if other < 0.99 * turn and np.nanmax(values) > 0.9 * other and wraps(values, other):
                raise DataError(
                    f"{record.source}: the azimuth {channel.name!r} is in {channel.unit} by the roles file, and wraps "
                    f"at {other:.4g} as an angle in {unit} does; correct the unit"
                )
        return np.asarray(values / turn, dtype=np.float64)
    return None


def speed_channel(record: Record) -> Channel | None:
    """Return the channel that is called after the rotor's speed, in whatever role, None where there is none."""
    for channel in record.channels:
        meaning = meaning_of(channel.name)
        if (
            meaning is not None
            and meaning.kind == "rotor_speed"
            and not meaning.demand
            and turns_a_second(channel.unit)
        ):
            return channel
    return None


def unread_speed(record: Record) -> Channel | None:
    """Return the channel called after the rotor's speed whose unit is none, where no other tells how it turns."""
    if record.of("azimuth") or speed_channel(record) is not None:
        return None
    for channel in record.channels:
        meaning = meaning_of(channel.name)
        if meaning is not None and meaning.kind == "rotor_speed" and not meaning.demand:
            return channel
    return None


def turns_a_second(unit: str) -> float | None:
    """Return how many turns a second a rotor speed of 1 in this unit is, None where it is none of a speed.

    >>> turns_a_second("U/min") == turns_a_second("min^-1") == turns_a_second("rpm") == 1 / 60, turns_a_second("%")
    (True, None)
    """
    own = rightly(unit) or unit.strip()
    return TURNS.get(own) or next((turns for known, turns in TURNS.items() if same_unit(own, known)), None)


def integrated(speed: Array, sample_time_s: float) -> Array:
    """Return the integral (N,) of a speed (N,) from the first sample on, by the trapezoidal rule.

    Missing samples lie on straight lines between those about them. All zero where nothing is known.
    """
    good = np.isfinite(speed)
    if not good.any():
        return np.zeros(len(speed))
    full = np.interp(np.arange(len(speed)), np.flatnonzero(good), speed[good])
    return np.concatenate([[0.0], np.cumsum(0.5 * sample_time_s * (full[1:] + full[:-1]))])


def rotor_angle(record: Record) -> Array | None:
    """Return the rotor's angle (N,) in rad by its azimuth, else by its speed from anywhere on; None without both.

    Of an angle that began anywhere the cosine and sine parts are turned against each other by a constant: frequencies,
    dampings and senses of rotation stay. Raises as `azimuth_of`.
    """
    azimuth = azimuth_of(record)
    if azimuth is not None:
        return 2 * np.pi * azimuth
    channel = speed_channel(record)
    if channel is None:
        return None
    return (
        2
        * np.pi
        * integrated(record.column(channel.name) * (turns_a_second(channel.unit) or 1.0), record.sample_time_s)
    )
