"""Name modes as engineers do: tower fore-aft, drive train, 3P; by the outputs they show in and the rotor's speed.

A name is a reading of the channels' names, not a result of the data: a mode is called after the kind of output that it
moves most, in units of the outputs' deviations, and only where it swings (damping below a half); a steady sine, which
is forced, gets none. The modes of a tower and of blades that shake each other share outputs; then the larger share
decides. Cosine and sine part of blades are one motion in two directions, of the size √(c² + s²).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from aeolid.formats.meanings import meaning_of
from aeolid.models.modes import Mode
from aeolid.models.multiblade import without_part
from aeolid.wording import aligned, plus_minus

_SWINGS = 0.5  # damping below which a pair of poles is called a mode of something
_STRUCTURES = {
    "tower_acc_fore_aft": "tower fore-aft", "tower_fore_aft": "tower fore-aft",
    "tower_moment_fore_aft": "tower fore-aft", "tower_acc_side_side": "tower side-side",
    "tower_side_side": "tower side-side", "tower_moment_side_side": "tower side-side",
    "flap_moment": "blade flapwise", "edge_moment": "blade edgewise",
}  # fmt: skip
_TURNING = ("generator_speed", "rotor_speed", "shaft_torque")
TURNS_WITH = "turning"
_BESIDE, _CLEARER = 1.5, 3.0  # ratios of frequencies, and of their deviations: a pole of the noise beside a mode
_DRIVE_TRAIN_HZ, _DRIVE_TRAIN_P = 0.6, 2.5  # below, a swing of the speed is one of the rotor as a whole
_COUNTED = {*_STRUCTURES.values(), "drive train"}


def named(modes: Sequence[Mode], rotor_hz: float | None) -> tuple[Mode, ...]:
    """Return the modes with names: the slowest of those that would bear one, and the second where there are two.

    Of more, which one is the structure's second cannot be told by outputs alone, and those above the first stay without
    a name. A pole beside a better known one, at most a third below it, is more likely of the noise, and bears none
    either. rotor_hz: the rotor's mean speed, None where it is not known: then no mode is called after it.
    """
    names = [_name(m, rotor_hz) for m in modes]
    names = ["" if _is_beside(i, modes, names) else name for i, name in enumerate(names)]
    count, met = Counter(names), Counter[str]()
    found = []
    for mode, name in zip(modes, names, strict=True):
        met[name] += 1
        if name.partition(",")[0] in _COUNTED and met[name] > 1:
            name = f"2nd {name}" if count[name] == 2 else ""
        found.append(replace(mode, name=name))
    return tuple(found)


def _is_beside(place: int, modes: Sequence[Mode], names: Sequence[str]) -> bool:
    """Tell whether a pole that would bear a structure's name is one of the noise beside that structure's mode."""
    name, own = names[place], _looseness(modes[place])
    if name.partition(",")[0] not in _COUNTED or own is None:
        return False
    others = [m for m, other in zip(modes, names, strict=True) if other == name and m is not modes[place]]
    near = [_looseness(m) for m in others if 1 <= m.frequency_hz / modes[place].frequency_hz < _BESIDE]
    return any(other is not None and other * _CLEARER < own for other in near)


def _looseness(mode: Mode) -> float | None:
    """Return the relative deviation of the frequency, None where it is not known."""
    return None if mode.frequency_std_hz is None else mode.frequency_std_hz / mode.frequency_hz


def _name(mode: Mode, rotor_hz: float | None) -> str:
    if mode.is_real or abs(mode.damping) >= _SWINGS:
        return ""
    if mode.rotor_order:
        return f"{mode.rotor_order}P"
    if mode.tone:
        return ""
    weights: dict[str, float] = {}
    for output, share in in_the_fixed_frame(mode.shares).items():
        word = word_of(output)
        weights[word] = max(weights.get(word, 0.0), share)
    best = max(weights, key=lambda w: weights[w], default="")
    if best.startswith("blade") and mode.whirl is not None:
        return f"{best}, {mode.whirl.direction}"
    if best != TURNS_WITH:
        return best
    slow = mode.frequency_hz < (_DRIVE_TRAIN_HZ if rotor_hz is None else _DRIVE_TRAIN_P * rotor_hz)
    return "rotor speed" if slow else "drive train"


def in_the_fixed_frame(shares: Mapping[str, float]) -> dict[str, float]:
    """Return shares with the cosine and sine part of each set of blades as one, under the cosine's name."""
    found: dict[str, float] = {}
    for output, share in shares.items():
        stem, part = without_part(output)
        key = f"{stem}_cosine" if part in ("cosine", "sine") else output
        found[key] = float(np.hypot(found.get(key, 0.0), share))
    return found


def word_of(output: str) -> str:
    """Return what a mode is called that an output moves in most; TURNS_WITH of the drive train, "" of others.

    Edgewise moments of all blades at once are a torque on the shaft.
    """
    stem, part = without_part(output)
    meaning = meaning_of(stem)
    kind = "" if meaning is None else meaning.kind
    if (kind, part) == ("edge_moment", "collective"):
        return TURNS_WITH
    return _STRUCTURES.get(kind, TURNS_WITH if kind in _TURNING else "")


def mode_lines(modes: Sequence[Mode], sample_time_s: float = 0.0) -> list[str]:
    """Return the modes as text: those that swing, the real poles as time constants, the rotor's harmonics apart.

    ± is one standard deviation where that is known. sample_time_s: of the model; poles beyond its Nyquist frequency
    are counted, not listed: no recording of that rate can show them. 0 for a model in continuous time.
    """
    beyond = [m for m in modes if sample_time_s > 0 and m.is_beyond(sample_time_s)]
    kept = [m for m in modes if m not in beyond]
    swinging = [m for m in kept if not m.is_real and not m.rotor_order and not m.tone]
    real = [m for m in kept if m.is_real]
    turning = [m for m in kept if m.rotor_order and not m.is_real]
    tones = [m for m in kept if m.tone and not m.is_real and not m.rotor_order]
    width = max([len("mode"), *(len(m.name) for m in [*swinging, *turning, *tones])])
    shown = [*swinging, *turning, *tones]
    hertz = ["frequency Hz", *aligned([plus_minus(m.frequency_hz, m.frequency_std_hz) for m in shown])]
    damping = ["damping", *aligned([plus_minus(m.damping, m.damping_std) for m in shown])]
    wide = [max(map(len, column)) for column in (hertz, damping)]
    cells = dict(zip([0, *map(id, shown)], zip(hertz, damping, strict=True), strict=True))
    rows = {key: f"{f.ljust(wide[0])}  {d.ljust(wide[1])}" for key, (f, d) in cells.items()}
    lines = [f"  {'mode':{width}s}  {rows[0]}  mostly in"] if shown else []
    lines += [_line(m, width, rows[id(m)]) for m in swinging]
    if turning:
        lines.append("  on multiples of the rotor's speed, more likely its harmonics than modes:")
        lines += [_line(m, width, rows[id(m)]) for m in turning]
    if tones:
        lines.append("  poles whose damping cannot be told from zero: a lightly damped mode or a periodic force;")
        lines.append("  record longer, or record the azimuth:")
        lines += [_line(m, width, rows[id(m)]) for m in tones]
    if real:
        lines.append(f"  real poles: {'; '.join(_constant(m) for m in real)}")
    if beyond:
        plural = "poles lie" if len(beyond) > 1 else "pole lies"
        lines.append(f"  {len(beyond)} {plural} beyond the Nyquist frequency ({0.5 / sample_time_s:.4g} Hz): no modes")
    return lines


def _line(mode: Mode, width: int, numbers: str) -> str:
    where = max(mode.shares, key=lambda n: mode.shares[n], default="")
    share = f"{where} ({mode.shares[where]:.0%})" if where else ""
    if mode.folded_from_hz is not None:
        share += f", perhaps the image of {mode.folded_from_hz:.4g} Hz"
    if mode.whirl is not None and where and without_part(where)[1]:
        share += f", {mode.whirl.text()}"
    return f"  {mode.name:{width}s}  {numbers}  {share}".rstrip()


def _constant(mode: Mode) -> str:
    """Return a real pole as a time constant, ± its deviation."""
    rate = 2 * np.pi * mode.frequency_hz
    where = max(mode.shares, key=lambda n: mode.shares[n], default="")
    place = f" in {where}" if where else ""
    if rate == 0:
        return f"an integrator{place}"
    relative = None if mode.frequency_std_hz is None else mode.frequency_std_hz / mode.frequency_hz
    spread = relative / rate if relative is not None and relative < 1 else None
    growing = "grows with " if mode.damping < 0 else ""
    return f"{growing}{plus_minus(1 / rate, spread, 3)} s{place}"
