"""Choose the channels of a file that show a turbine's modes: tower, speed, blades, the rotor's angle, the wind."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from aeolid.begin.guess import by_size
from aeolid.begin.survey import Survey, survey
from aeolid.errors import DataError
from aeolid.formats.meanings import BLADED
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

    Of a quantity that is there twice the first is taken; a blade set counts where three blades have it. Raises
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
        if all(b in mine for b in (1, 2, 3)) and kind in BLADED:
            channels += [_channel(found, mine[b], kind, "output", b) for b in (1, 2, 3)]
    if not channels:
        raise DataError(
            f"{path}: no speed, tower or blade channel is known by its heading; say what the channels are with --roles"
        )
    taken = {c.column or c.name for c in channels}
    for kind, role in _BESIDE:
        beside = by_kind.get(kind, {}).get(0)
        if beside is not None and beside not in taken:
            channels.append(_channel(found, beside, kind, role))
    return Roles(
        tuple(channels), found.sample_time_s, found.time, f"roles guessed for {path}", found.time_unit, found.resample
    )


def rotor_outputs(roles: Roles) -> list[str]:
    """Return which outputs of `rotor_roles` show modes once blades are in the fixed frame.

    Of flapwise moments the collective part alone: flapwise whirling is damped by more than a half while a turbine runs.
    """
    found = [c.name for c in roles.channels if c.role == "output" and not c.blade]
    for stem in dict.fromkeys(c.name.rpartition("_")[0] for c in roles.channels if c.blade):
        found += part_names(stem)[:1] if stem == _BLADES[0] else part_names(stem)
    return found


def _channel(found: Survey, heading: str, kind: str, role: str, blade: int = 0) -> Channel:
    unit = found.unit(heading) or by_size(kind, found.values(heading), 1000.0)
    name = f"{kind}_{blade}" if blade else kind
    return Channel(name, unit, role, re.sub(r"\s*[\[(].*", "", heading) if heading != name else None, blade=blade)
