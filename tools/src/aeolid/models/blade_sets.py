"""Find the channels that stand for one quantity on each blade, and bring them into the frame that does not turn."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.models.multiblade import FEWEST, blade_angles, part_names, to_fixed, without_part
from aeolid.models.rotor_angle import rotor_angle
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
MOST = 9  # blades
AUTO, NONE = "auto", "none"
WITH_THE_ROTOR = 3.0  # times what runs the other way, that 1P of a set whose blades are in order cannot fall below
TOLD = 0.02  # of a set's power that 1P must have before it says anything of the order


@dataclass(frozen=True)
class BladeSet:
    """Hold one set: what its channels have in common in their names, and the names in the order of the blades."""

    stem: str
    names: tuple[str, ...]


def numbered(names: Iterable[str]) -> dict[str, dict[int, str]]:
    """Return the names that end in a number of a blade, by what stands before it and by that number.

    >>> numbered(["flap_1", "flap_2", "speed"])
    {'flap': {1: 'flap_1', 2: 'flap_2'}}
    """
    found: dict[str, dict[int, str]] = {}
    for name in names:
        match = re.fullmatch(r"(.*?)_?([1-9])", name)
        if match:
            found.setdefault(match[1], {})[int(match[2])] = name
    return found


def stem_of(name: str) -> str:
    """Return the name of a blade's channel without the blade's number or letter at its end.

    >>> stem_of("RootMyb1"), stem_of("flap_moment_2"), stem_of("flap B"), stem_of("flap")
    ('RootMyb', 'flap_moment', 'flap', 'flap')
    """
    return re.sub(r"[_ ]*([1-9]|(?<![a-z])[A-Ca-c])$", "", name) or name


def find_sets(record: Record, asked: Sequence[str] | str | None = None) -> tuple[BladeSet, ...]:
    """Return the sets of blade channels that are asked for.

    asked: None for those that the roles file gives by `blade = 1` …; "none"; "auto" for inputs and outputs called alike
    but for 1, 2, 3 at the end; or sets, each as "RootMyb1..3" or as names in the order of the blades, "A,B,C". Raises
    UsageError on a name that is no channel and on fewer than three blades, DataError where channels of a set differ in
    role or unit, and where one of a set is missing.
    """
    told = [asked] if isinstance(asked, str) else asked
    if told is None:
        sets = _of_roles(record)
    elif list(told) == [NONE]:
        return ()
    elif list(told) == [AUTO]:
        sets = _by_name(record)
    else:
        sets = tuple(_of_text(record, text) for text in told)
    for one in sets:
        _check(record, one)
    twice = [n for i, one in enumerate(sets) for n in one.names if any(n in other.names for other in sets[:i])]
    if twice:
        raise UsageError(f"--blades: {twice[0]!r} is in two sets; name it once")
    return sets


def _of_roles(record: Record) -> tuple[BladeSet, ...]:
    found: dict[str, dict[int, str]] = {}
    for c in record.channels:
        if c.blade:
            mine = found.setdefault(stem_of(c.name), {})
            if c.blade in mine:
                raise DataError(f"{record.source}: {mine[c.blade]!r} and {c.name!r} both have blade = {c.blade}")
            mine[c.blade] = c.name
    return tuple(BladeSet(stem, _complete(record, stem, mine)) for stem, mine in found.items())


def _by_name(record: Record) -> tuple[BladeSet, ...]:
    sets = []
    for stem, mine in numbered(c.name for c in record.of("input", "output")).items():
        if max(mine) == FEWEST and len(mine) > 1:
            sets.append(BladeSet(stem, _complete(record, stem, mine)))
    if not sets:
        raise DataError(
            f"{record.source}: no inputs or outputs are called alike but for 1, 2, 3 at the end; name the blades' "
            "channels, as in --blades RootMyb1..3"
        )
    return tuple(sets)


def _complete(record: Record, stem: str, mine: dict[int, str]) -> tuple[str, ...]:
    missing = [b for b in range(1, max(mine) + 1) if b not in mine]
    if missing:
        raise DataError(
            f"{record.source}: of the blades of {stem!r} number {missing[0]} is missing, there are "
            f"{', '.join(mine[b] for b in sorted(mine))}; without it there is no fixed frame, leave the set out"
        )
    return tuple(mine[b] for b in sorted(mine))


def _of_text(record: Record, text: str) -> BladeSet:
    match = re.fullmatch(r"(.*?)([1-9])\.\.([1-9])", text.strip())
    if match:
        names = tuple(f"{match[1]}{b}" for b in range(int(match[2]), int(match[3]) + 1))
    else:
        names = tuple(part.strip() for part in text.split(","))
    if len(names) < FEWEST:
        raise UsageError(
            f"--blades {text}: {len(names)} blade{'s' if len(names) != 1 else ''}; a fixed frame takes three or more, "
            "as in RootMyb1..3"
        )
    have = [c.name for c in record.channels]
    for name in names:
        if name not in have:
            raise UsageError(f"--blades {text}: {record.source} has no channel {name!r}; it has {', '.join(have)}")
    stem = match[1].rstrip("_") if match else _common(names)
    return BladeSet(stem or names[0], names)


def _common(names: Sequence[str]) -> str:
    """Return what names have in common before their ends."""
    size = next((i for i, letters in enumerate(zip(*names, strict=False)) if len(set(letters)) > 1), 0)
    return names[0][:size].rstrip("_ ")


def _check(record: Record, one: BladeSet) -> None:
    channels = {c.name: c for c in record.channels}
    mine = [channels[n] for n in one.names]
    if not FEWEST <= len(mine) <= MOST or len(set(one.names)) < len(mine):
        raise UsageError(
            f"the blades of {one.stem!r} are {', '.join(one.names)}; a fixed frame takes {FEWEST} to {MOST} different "
            "channels"
        )
    for what in ("role", "unit"):
        if len({getattr(c, what) for c in mine}) > 1:
            each = ", ".join(f"{c.name} {getattr(c, what)!r}" for c in mine)
            raise DataError(f"{record.source}: blades of one set need one {what}, here are {each}; bring them to one")
    clash = [n for n in part_names(one.stem) if n in channels]
    if clash:
        raise DataError(f"{record.source}: {clash[0]!r} would be made of the blades, and is a channel; rename it")


def to_multiblade(record: Record, sets: Sequence[BladeSet]) -> Record:
    """Return the recording with each set of blades as collective, cosine and sine channels, behind all others.

    Raises DataError where neither azimuth nor speed of the rotor is recorded, and where the set's own 1P runs through
    the blades against the rotor, so that their order is not that of the set.
    """
    if not sets:
        return record
    angle = rotor_angle(record)
    if angle is None:
        raise DataError(
            f"{record.source}: neither the rotor's azimuth nor its speed is recorded; blades have no fixed frame "
            "without: give a channel the role azimuth, or call one rotor_speed"
        )
    for one in sets:
        _check_order(record, one, angle)
    parts = [to_fixed(record.columns(one.names), angle) for one in sets]
    return replaced(record, sets, parts)


def in_fixed_frame(records: Sequence[Record], asked: Sequence[str] | str | None = None) -> list[Record]:
    """Return recordings of one layout with the sets that are asked for in the fixed frame, as they are without any.

    asked: as in `find_sets`. Raises as `find_sets` and `to_multiblade`.
    """
    sets = find_sets(records[0], asked) if records else ()
    return [to_multiblade(record, sets) for record in records]


def replaced(record: Record, sets: Sequence[BladeSet], parts: Sequence[Array]) -> Record:
    """Return the recording with the channels of each set replaced by its first parts (N, 1 … 3), behind all others."""
    dropped = {name for one in sets for name in one.names}
    kept = [i for i, c in enumerate(record.channels) if c.name not in dropped]
    first = {c.name: c for c in record.channels}
    added = [
        Channel(name, first[one.names[0]].unit, first[one.names[0]].role, hold=first[one.names[0]].hold)
        for one, columns in zip(sets, parts, strict=True) for name in part_names(one.stem)[: columns.shape[1]]
    ]  # fmt: skip
    values = np.hstack([record.values[:, kept], *parts])
    return replace(record, values=values, channels=(*(record.channels[i] for i in kept), *added))


def _check_order(record: Record, one: BladeSet, angle: Array) -> None:
    """Refuse a set whose blades stand in another order than the rotor's angle says, as far as its 1P tells.

    Gravity, shear, tilt and yaw stand still in space: they load blade b as cos(ψ_b + φ). Through blades in the wrong
    order this runs the other way round; what differs between blades by itself runs both ways alike.
    """
    values = record.columns(one.names)
    good = np.isfinite(values).all(axis=1) & np.isfinite(angle)
    if np.count_nonzero(good) < 10 or np.ptp(np.unwrap(angle[good])) < 2 * np.pi:
        return
    y = values[good] - values[good].mean(axis=0)
    wave = (2 / len(y)) * (np.exp(-1j * angle[good]) @ y)  # (B,) complex amplitude of 1P of each blade
    along = np.exp(-1j * blade_angles(np.zeros(1), len(one.names))[0])
    right, wrong = abs(wave @ along), abs(wave @ along.conj())
    strong = wrong**2 / len(one.names) ** 2 / 2 > TOLD * np.mean(y**2)
    if strong and wrong > WITH_THE_ROTOR * right:
        turned = ",".join((one.names[0], *one.names[:0:-1]))
        raise DataError(
            f"{record.source}: what stands still in space passes through {', '.join(one.names)} against the rotor: the "
            f"blades stand in another order or the azimuth runs backwards; try --blades {turned}"
        )


def with_multiblade(record: Record, wanted: Iterable[str]) -> Record:
    """Return the recording with the fixed-frame channels that are asked for and that its blades give, as "ignore".

    A channel that has the name already stays what it is. Raises as `to_multiblade`.
    """
    have = {c.name for c in record.channels}
    stems = dict.fromkeys(stem for n in wanted if n not in have for stem, part in [without_part(n)] if part)
    if not stems:
        return record
    told = {one.stem: one for one in _of_roles(record)}
    for stem, mine in numbered(have).items():
        if sorted(mine) == list(range(1, len(mine) + 1)) and len(mine) >= FEWEST:
            told.setdefault(stem, BladeSet(stem, _complete(record, stem, mine)))
    sets = [told[stem] for stem in stems if stem in told and not {*part_names(stem)} & have]
    turned = to_multiblade(record, sets)
    new = [i for i, c in enumerate(turned.channels) if c.name not in have]
    channels = (*record.channels, *(replace(turned.channels[i], role="ignore", hold="auto") for i in new))
    return replace(record, values=np.hstack([record.values, turned.values[:, new]]), channels=channels)
