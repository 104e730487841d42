"""Guess the facts of the machine that make names concrete: blades, rated speed of the rotor, gearbox ratio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aeolid.begin.guess import Guesses, by_size
from aeolid.begin.survey import Survey
from aeolid.formats.meanings import BLADED
from aeolid.units import factor

_PITCHING_DEG = 2.0  # median pitch from which a turbine is taken to run at its rated speed
_MOST_RATIO = 250.0  # of a gearbox


@dataclass(frozen=True)
class Fact:
    """Hold one entry of [context]: key, value, how it was come by, and whether it is sure enough to be used."""

    key: str
    value: str | int | float
    why: str
    sure: bool = True


def facts_of(sides: Sequence[tuple[Survey, Guesses]]) -> tuple[Fact, ...]:
    """Guess the facts from the first of the files that shows each; the recording comes before its baseline."""
    kinds = {m.kind for found, _ in sides for m in found.meanings.values()}
    if not kinds & {"pitch", "generator_speed", "rotor_speed", "azimuth", "flap_moment", "wind"}:
        return (Fact("machine", "rig", "no channel of a wind turbine was recognised"),)
    blades = max((m.blade for found, _ in sides for m in found.meanings.values() if m.kind in BLADED), default=0)
    known = [Fact("machine", "wind turbine", "by the names of its channels")]
    named = "by the names of its channels" if blades > 1 else "a guess: no two blades are named"
    known.append(Fact("blades", blades if blades > 1 else 3, named))
    rotor = next((r for found, _ in sides if (r := _rotor(found)) is not None), None)
    generator = next((g for found, _ in sides if (g := _speed(found, "generator_speed")) is not None), None)
    if rotor is not None:
        above = any(_pitches(found, guesses) for found, guesses in sides)
        text = "median of the rotor's speed" + (
            ", while it pitches" if above else "; it does not pitch: set the rated one"
        )
        known.append(Fact("rated_speed_rad_s", float(f"{rotor:.4g}"), text, sure=above))
        ratio = generator / rotor if generator else 0.0
        if 1.5 < ratio < _MOST_RATIO:
            known.append(Fact("gearbox_ratio", float(f"{ratio:.4g}"), "generator speed over rotor speed"))
    elif generator is not None:
        known.append(Fact("rated_speed_rad_s", 1.267, "not recorded: set the rotor's rated speed", sure=False))
    return tuple(known)


def _speed(found: Survey, kind: str) -> float | None:
    """Return the median of a speed in rad/s."""
    heading = next((h for h, m in found.meanings.items() if m.kind == kind and len(found.values(h))), None)
    if heading is None:
        return None
    values = found.values(heading)
    scale = factor(found.unit(heading) or by_size(kind, values, 100.0), "rad/s")
    middle = float(np.median(np.abs(values)))
    return middle * scale if scale is not None and middle > 0 else None


def _rotor(found: Survey) -> float | None:
    """Return the rotor's median speed in rad/s: recorded, or by its azimuth."""
    own = _speed(found, "rotor_speed")
    heading = next((h for h, m in found.meanings.items() if m.kind == "azimuth"), None)
    if own is not None or heading is None or len(found.seconds) != len(found.table.columns[heading]):
        return own
    values = found.table.columns[heading]
    most = float(np.nanmax(values))
    turn = 1.0 if most <= 1.001 else 2 * np.pi if most < 6.5 else 360.0
    steps = np.diff(values) / turn
    rates = np.abs(steps - np.rint(steps)) / np.diff(found.seconds) * 2 * np.pi
    middle = float(np.nanmedian(rates))
    return middle if np.isfinite(middle) and 0.05 < middle < 60 else None


def _pitches(found: Survey, guesses: Guesses) -> bool:
    pitch = next((g for g in guesses.used if g.meaning.kind == "pitch"), None)
    if pitch is None:
        return False
    scale = factor(pitch.unit, "deg")
    return scale is not None and float(np.median(found.values(pitch.heading))) * scale > _PITCHING_DEG
