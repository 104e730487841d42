"""Keep what a recording says of its rotor's speed until modes are found, or say that it is not read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aeolid.models.rotor_angle import speed_channel, unread_speed
from aeolid.record import Record


def turning_as_recorded(seen: Sequence[Record], raw: Sequence[Record]) -> list[Record]:
    """Return the recordings as used, a rotor speed among their outputs at its mean again, which was taken off.

    raw: the recordings before. By its deviations alone no rotor turns, and by a mean of several another one.
    """
    found = []
    for record, before in zip(seen, raw, strict=True):
        channel = speed_channel(record)
        if channel is not None and channel.role == "output":
            values, place = record.values.copy(), record.channels.index(channel)
            values[:, place] += np.nanmean(before.column(channel.name)) - np.nanmean(values[:, place])
            record = replace(record, values=values)
        found.append(record)
    return found


def unread(record: Record) -> tuple[str, ...]:
    """Say that harmonics are not marked because the unit of the rotor's speed is none."""
    channel = unread_speed(record)
    if channel is None:
        return ()
    return (
        f"the rotor speed {channel.name!r} is in {channel.unit or 'no unit'!r}, no unit of a speed: harmonics of the"
        " rotor are not marked; name rpm, rad/s, deg/s or Hz in the roles file",
    )
