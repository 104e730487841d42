"""Replace an angle that wraps by its cosine and its sine: a channel that jumps by a turn is no number to a model.

At the jump from 359° to 0° nothing happens on the machine, and every model that is linear in the angle says otherwise.
What depends on an angle has the same value after a turn, and cosine and sine are the first two of its Fourier series.
A model that was identified so names its channels `azimuth_cos` and `azimuth_sin`; recordings that hold the angle under
its own name serve it as they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
TURNS = {
    "deg": 360.0, "°": 360.0, "degree": 360.0, "degrees": 360.0, "rad": 2 * np.pi, "radian": 2 * np.pi,
    "radians": 2 * np.pi, "rev": 1.0, "turn": 1.0,
}  # fmt: skip
PARTS = (("_cos", np.cos), ("_sin", np.sin))
SMOOTH = 0.25  # of a turn a sample, below which the motion behind a jump must be to be one of an angle
TWO_TURNS = 4 * np.pi  # rad
MOSTLY = 0.9  # of the jumps for which that must hold
ROLES = ("input", "scheduling", "disturbance")


def turn_of(unit: str) -> float | None:
    """Return a whole turn in this unit, None where it is not one of angles."""
    return TURNS.get(unit.strip().lower())


def radians_a_unit(unit: str, values: Array) -> float:
    """Return rad a unit of an angle (N,): by the unit where it is one of angles, else by the values.

    What jumps by one is in turns; what goes beyond two turns in rad is in degrees.
    """
    turn, known = turn_of(unit), values[np.isfinite(values)]
    if turn is None and wraps(values, 1.0):
        turn = 1.0
    if turn is None:
        turn = 360.0 if len(known) and float(np.ptp(known)) > TWO_TURNS else 2 * np.pi
    return 2 * np.pi / turn


def wraps(values: Array, turn: float) -> bool:
    """Return whether an angle (N,) jumps by a turn while its motion is slow: values stay within one turn.

    A turn that is not wrapped goes beyond; samples that scatter over the whole turn are no motion.

    >>> angle = np.arange(100.0) * 7.0
    >>> wraps(angle % 360.0, 360.0), wraps(angle, 360.0), wraps(angle % 200.0, 360.0)
    (True, False, False)
    """
    known = values[np.isfinite(values)]
    if len(known) < 2 or np.ptp(known) > turn * 1.001:
        return False
    steps = np.diff(values)
    jumps = steps[np.isfinite(steps) & (np.abs(steps) > turn * (1 - SMOOTH))]
    others = steps[np.isfinite(steps) & (np.abs(steps) <= turn * (1 - SMOOTH))]
    slow = np.mean(np.abs(others) < SMOOTH * turn) if len(others) else 0.0
    return len(jumps) > 0 and bool(slow >= MOSTLY)


def part_names(name: str) -> tuple[str, str]:
    """Return what the cosine and the sine of an angle are called."""
    return name + PARTS[0][0], name + PARTS[1][0]


def find_angles(records: Sequence[Record], names: Iterable[str]) -> tuple[str, ...]:
    """List those of the named channels that wrap in any of the recordings, by their unit."""
    found = []
    for name in names:
        turn = turn_of(records[0].unit(name))
        if turn is not None and any(wraps(r.column(name), turn) for r in records):
            found.append(name)
    return tuple(found)


def split_angles(
    records: Sequence[Record], names: Sequence[str] | None = None, scheduling: Sequence[str] = ()
) -> tuple[list[Record], tuple[str, ...], tuple[str, ...]]:
    """Return the recordings with angles as cosine and sine, which angles those are, and a sentence for each.

    names: channels to split; none of them for an empty list; None finds those of the roles input, scheduling and
    disturbance that wrap, and those of `scheduling` whatever their role. An output that wraps stays and is told of.
    Raises UsageError on a channel that is missing or whose unit is none of an angle.
    """
    if not records:
        return [], (), ()
    first = records[0]
    if names is None:
        wanted = dict.fromkeys([*first.names(*ROLES), *(n for n in scheduling if n in first.names("azimuth"))])
        angles = find_angles(records, wanted)
    else:
        angles = tuple(dict.fromkeys(names))
        _require_angles(first, angles)
    why = "wraps" if names is None else "is an angle"
    notes = [
        f"channel {name!r} {why}: its cosine and sine, {' and '.join(part_names(name))}, take its place "
        "(--angle none leaves it as it is)"
        for name in angles
    ]
    if names is None:
        notes += [
            f"output {name!r} wraps: no linear model follows its jumps; give it the role 'azimuth' or 'ignore', or "
            "record its rate"
            for name in find_angles(records, first.names("output"))
        ]
    return [_split(r, angles) for r in records], angles, tuple(notes)


def renamed(names: Sequence[str], angles: Sequence[str]) -> list[str]:
    """Return a list of channels with each angle replaced by its two parts."""
    return [part for name in names for part in (part_names(name) if name in angles else (name,))]


def with_parts(record: Record, wanted: Iterable[str]) -> Record:
    """Return the recording with the cosines and sines that are asked for and that its angles give.

    A channel that has the name already stays what it is.
    """
    have = {c.name: c for c in record.channels}
    missing = [n for n in wanted if n not in have]
    for name in missing:
        for suffix, function in PARTS:
            angle = name.removesuffix(suffix)
            turn = turn_of(have[angle].unit) if name != angle and angle in have else None
            if turn is not None:
                column = function(record.column(angle) * (2 * np.pi / turn))
                channels = (*record.channels, Channel(name, "", "ignore"))
                record = replace(record, values=np.column_stack([record.values, column]), channels=channels)
    return record


def _require_angles(record: Record, names: Sequence[str]) -> None:
    for name in names:
        role = {c.name: c.role for c in record.channels}.get(name)
        if role is None or role in ("output", "ignore"):
            raise UsageError(
                f"--angle {name}: "
                + ("no such channel" if role is None else f"the role {role!r} has no cosine and sine here")
                + f"; {record.source} has {', '.join(c.name for c in record.channels)}"
            )
        if turn_of(record.unit(name)) is None:
            raise UsageError(
                f"--angle {name}: the unit {record.unit(name)!r} is not one of an angle; name deg or rad in the roles "
                "file"
            )


def _split(record: Record, angles: Sequence[str]) -> Record:
    """Return the recording with each angle's channel replaced by two, in its place and role."""
    if not angles:
        return record
    columns, channels = [], []
    for i, channel in enumerate(record.channels):
        turn = turn_of(channel.unit) if channel.name in angles else None
        if turn is None:
            columns.append(record.values[:, i])
            channels.append(channel)
            continue
        phase = record.values[:, i] * (2 * np.pi / turn)
        for name, (_, function) in zip(part_names(channel.name), PARTS, strict=True):
            columns.append(function(phase))
            channels.append(Channel(name, "", channel.role))
    return replace(record, values=np.column_stack(columns), channels=tuple(channels))
