"""Choose the channels of a file that show a turbine's modes: tower, speed, blades, the rotor's angle, the wind."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aeolid.begin.guess import by_size
from aeolid.begin.survey import Survey, survey
from aeolid.errors import DataError
from aeolid.formats.headings import split_heading
from aeolid.formats.meanings import meaning_of
from aeolid.models.blade_sets import stem_of
from aeolid.models.multiblade import part_names
from aeolid.record import Channel, Roles

_OUTPUTS = (  # the first of each that there is
    ("generator_speed", "rotor_speed"), ("tower_acc_fore_aft", "tower_fore_aft", "tower_moment_fore_aft"),
    ("tower_acc_side_side", "tower_side_side", "tower_moment_side_side"),
)  # fmt: skip
_BLADES = ("flap_moment", "edge_moment")
_BESIDE = (("azimuth", "azimuth"), ("rotor_speed", "scheduling"), ("wind", "scheduling"))


def rotor_roles(path: str | Path) -> Roles:
    """Return roles for a file by its headings: what modes show in as outputs, blades with their numbers.

    Channels keep the names of their headings; blades whose headings are not alike but for the end are called after what
    they measure. Of a quantity that is there twice the first is taken; a set counts where three blades have it. Raises
    DataError where the file cannot be read or nothing of this is in it.
    """
    found = survey(path)
    by_kind: dict[str, dict[int, str]] = {}
    for heading, meaning in found.meanings.items():
        values = found.values(heading)
        if not meaning.demand and len(values) > 1 and np.ptp(values) > 0:
            by_kind.setdefault(meaning.kind, {}).setdefault(meaning.blade, heading)
    channels = []
    for kinds in _OUTPUTS:
        for first in [k for k in kinds if 0 in by_kind.get(k, {})][:1]:
            channels.append(_channel(found, by_kind[first][0], first, "output"))
    for kind in _BLADES:
        mine = by_kind.get(kind, {})
        if all(b in mine for b in (1, 2, 3)):
            alike = len({stem_of(split_heading(mine[b])[0]) for b in (1, 2, 3)}) == 1
            channels += [_channel(found, mine[b], kind, "output", b, alike) for b in (1, 2, 3)]
    if not channels:
        raise DataError(
            f"{path}: no speed, tower or blade channel is known by its heading; say what the channels are with --roles"
        )
    taken = {c.heading for c in channels}
    for kind, role in _BESIDE:
        beside = by_kind.get(kind, {}).get(0)
        if beside is not None and split_heading(beside)[0] not in taken:
            channels.append(_channel(found, beside, kind, role))
    return Roles(
        tuple(channels), found.sample_time_s, found.time, f"roles guessed for {path}", found.time_unit, found.resample
    )


def rotor_outputs(roles: Roles) -> list[str]:
    """Return which outputs of `rotor_roles` show modes once blades are in the fixed frame.

    Of flapwise moments the collective part alone: flapwise whirling is damped by more than a half while a turbine runs.
    """
    found = [c.name for c in roles.channels if c.role == "output" and not c.blade]
    for stem in dict.fromkeys(stem_of(c.name) for c in roles.channels if c.blade):
        meaning = meaning_of(stem)
        flapwise = meaning is not None and meaning.kind == _BLADES[0]
        found += part_names(stem)[:1] if flapwise else part_names(stem)
    return found


def _channel(found: Survey, heading: str, kind: str, role: str, blade: int = 0, alike: bool = True) -> Channel:
    unit = found.unit(heading) or by_size(kind, found.values(heading), 1000.0)
    name = split_heading(heading)[0]
    if alike and (not blade or stem_of(name) != name):
        return Channel(name, unit, role, blade=blade)
    return Channel(f"{kind}_{blade}", unit, role, name, blade=blade)
