"""Guess roles and units: which of the known channels to use, what each is called, and in what unit it must be.

A unit that the file does not give is taken from the values: the sizes that the quantities of a turbine have in one
unit and the next are a factor of 9.5 (rpm, rad/s), 57 (deg, rad) or 1,000 apart. With a baseline, the unit in which
both have about the same size is taken. Whatever was guessed is marked so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aeolid.begin.survey import Survey
from aeolid.formats.meanings import KINDS, Meaning
from aeolid.formats.table import Array
from aeolid.units import alike, factor

_ALIKE_BLADES = 0.02  # of the deviation of a blade's pitch, within which the others turn with it
_INSTEAD = (("generator_speed", "rotor_speed"), ("tower_acc_fore_aft", "tower_fore_aft"),
            ("tower_acc_side_side", "tower_side_side"))  # fmt: skip
_NOT_BY_ITSELF = ("edge_moment", "tower_moment_fore_aft", "tower_moment_side_side", "shaft_torque", "thrust", "power")


@dataclass(frozen=True)
class Guess:
    """Hold what one channel of a file is taken for; why: what the unit was read from, where it was not the file."""

    heading: str
    name: str
    unit: str
    role: str
    meaning: Meaning
    why: str = ""


@dataclass(frozen=True)
class Guesses:
    """Hold the channels to use, and those to leave out with the reason."""

    used: tuple[Guess, ...]
    left: tuple[tuple[str, str], ...]

    def of(self, name: str) -> Guess | None:
        """Return the channel of a name."""
        return next((g for g in self.used if g.name == name), None)


def guess(found: Survey) -> Guesses:
    """Choose among the known channels of a file."""
    left: list[tuple[str, str]] = []
    groups: dict[str, dict[int, list[str]]] = {}
    for heading, meaning in found.meanings.items():
        values = found.values(heading)
        if len(values) < 2 or np.ptp(values) == 0:
            left.append((heading, f"{KINDS[meaning.kind][2]}, but it never changes"))
            continue
        groups.setdefault(meaning.kind, {}).setdefault(meaning.blade, []).append(heading)
    for kind, other in _INSTEAD:
        if kind in groups and other in groups:
            left += [(h, f"{KINDS[other][2]}: {kind} says the same") for hs in groups.pop(other).values() for h in hs]
    for kind in _NOT_BY_ITSELF:
        text = f"{KINDS[kind][2]}: an output if you want it"
        left += [(h, text) for hs in groups.pop(kind, {}).values() for h in hs]
    used: list[Guess] = []
    for kind in KINDS:
        if kind in groups:
            chosen, doubled = _chosen(found, kind, groups[kind])
            used += chosen
            left += [(h, f"{KINDS[kind][2]}: {chosen[0].heading} is used") for h in doubled]
    return Guesses(tuple(_with_units(found, used)), tuple(left))


def _chosen(found: Survey, kind: str, blades: Mapping[int, Sequence[str]]) -> tuple[list[Guess], list[str]]:
    """Choose the headings of one kind: demands before measurements, one for all blades that turn together."""
    firsts: dict[int, str] = {}
    doubled: list[str] = []
    demanded = any(found.meanings[h].demand for hs in blades.values() for h in hs)
    for blade, headings in sorted(blades.items()):
        fitting = (
            [h for h in headings if found.meanings[h].demand == demanded] if kind in ("pitch", "torque") else headings
        )
        doubled += [h for h in headings if h not in fitting[:1]]
        if fitting:
            firsts[blade] = fitting[0]
    together = kind == "pitch" and _together([found.table.columns[h] for h in firsts.values()])
    if 0 in firsts or together:
        kept = 0 if 0 in firsts else min(firsts)
        doubled += [h for blade, h in firsts.items() if blade != kept]
        firsts = {0: firsts[kept]}
    role = KINDS[kind][0]
    names = {blade: f"{kind}_{blade}" if blade else kind for blade in firsts}
    return [Guess(h, names[b], "", role, found.meanings[h]) for b, h in firsts.items()], doubled


def _together(columns: Sequence[Array]) -> bool:
    """Tell whether all blades turn alike: collective pitch."""
    if len({len(c) for c in columns}) > 1:
        return False
    first = columns[0]
    spread = float(np.nanstd(first))
    return all(float(np.nanstd(c - first)) <= _ALIKE_BLADES * spread for c in columns[1:])


def _with_units(found: Survey, used: Sequence[Guess]) -> list[Guess]:
    speed = next((_middle(found, g) for g in used if g.name == "generator_speed"), 100.0)
    done = []
    for g in used:
        said = found.unit(g.heading) or _ending(g.heading)
        unit, why = (said, "") if said else (by_size(g.meaning.kind, found.values(g.heading), speed), "by its values")
        done.append(replace(g, unit=unit, why=why))
    return done


def _middle(found: Survey, g: Guess) -> float:
    return float(np.median(np.abs(found.values(g.heading))))


_ENDINGS = {"deg": "deg", "rad": "rad", "rpm": "rpm", "rads": "rad/s", "degs": "deg/s", "nm": "N m", "knm": "kN m",
            "mnm": "MN m", "ms2": "m/s^2", "mps2": "m/s^2", "ms": "m/s", "mps": "m/s", "kw": "kW", "mw": "MW", "w": "W",
            "g": "g"}  # fmt: skip


def _ending(heading: str) -> str:
    """Return the unit that the last word of a heading is, such as pitch_deg or GenTrq_kNm."""
    word = heading.strip().replace("-", "_").rpartition("_")
    return _ENDINGS.get(word[2].lower(), "") if word[1] else ""


def by_size(kind: str, values: Array, speed: float) -> str:
    """Return the unit in which a quantity of a turbine has such values; speed: of the generator, as it stands there."""
    size, most = float(np.median(np.abs(values))), float(np.max(np.abs(values)))
    if kind != "azimuth" and abs(float(np.mean(values))) < float(np.std(values)):
        return KINDS[kind][1]  # about zero: a deviation from an operating point says nothing of its unit
    if kind in ("pitch", "pitch_excitation"):
        return "rad" if most < 1.75 and kind == "pitch" else "deg"
    if kind == "azimuth":
        return "rev" if most <= 1.001 else "rad" if most < 6.5 else "deg"
    if kind == "generator_speed":
        return "rpm" if size > 250 or 3.2 < size < 25 else "rad/s"
    if kind == "rotor_speed":
        return "rpm" if size > 3.2 else "rad/s"
    if kind == "torque":
        geared = speed > 30
        return "N m" if size > (1e3 if geared else 1e5) else "kN m"
    if kind.endswith("moment") or "moment" in kind or kind == "shaft_torque":
        return "N m" if size > 2e5 else "kN m"
    if kind == "power":
        return "W" if size > 1e5 else "MW" if size < 30 else "kW"
    return KINDS[kind][1]


def paired(found: Survey, mine: Guesses, other: Survey, others: Guesses) -> tuple[Guesses, Guesses]:
    """Keep what both files have, by name, and settle units that one of them does not give by the other's sizes."""
    names = [g.name for g in mine.used if others.of(g.name) is not None]
    here = [_settled(found, g, other, others.of(g.name)) for g in mine.used if g.name in names]
    there = [_settled(other, g, found, mine.of(g.name)) for g in others.used if g.name in names]
    return (
        Guesses(tuple(here), (*mine.left, *_alone(mine, names, other))),
        Guesses(tuple(there), (*others.left, *_alone(others, names, found))),
    )


def _alone(side: Guesses, names: Sequence[str], other: Survey) -> list[tuple[str, str]]:
    text = f"{other.path.name} has none of it"
    return [(g.heading, f"{KINDS[g.meaning.kind][2]}: {text}") for g in side.used if g.name not in names]


def _settled(found: Survey, g: Guess, other: Survey, twin: Guess | None) -> Guess:
    """Take the unit in which a channel without one is nearest to its twin in size, where the twin has one."""
    if not g.why or twin is None or twin.why:
        return g
    here, there = _middle(found, g), _middle(other, twin)
    if here <= 0 or there <= 0:
        return g
    far = {u: abs(math.log(here * f / there)) for u in alike(g.unit) if (f := factor(u, twin.unit)) is not None}
    best = min(far, key=lambda u: (round(far[u], 6), u != g.unit), default=g.unit)
    return replace(g, unit=best, why=f"by its size beside {twin.heading} of {other.path.name}")
