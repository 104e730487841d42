"""Write a designed signal as the settings of the wrapper for Bladed-style controllers, `port/discon`.

Its excitation is computed where it is played; the numbers here make it the same signal, one value a row, where the
controller is called once a row or more often (see `port/discon/excitation.h`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from aeolid.errors import UsageError
from aeolid.excitation.quantities import Bound
from aeolid.excitation.signals import Played, Signals
from aeolid.formats.controller_channels import factor_to
from aeolid.formats.meanings import meaning_of

SECTIONS = {"pitch": "pitch_command", "torque": "torque_command"}
MOST_LINES = 64
LONGEST_S = 1e9


def unplayable(signals: Signals, bounds: Sequence[Bound]) -> str:
    """Return why the wrapper cannot play a signal, empty where it can."""
    if signals.shape.kind == "filtered":
        return "the wrapper plays prbs and multisine, not a filtered sequence: --signal prbs or multisine"
    if signals.shape.kind == "multisine":
        if signals.shape.phases != "schroeder":
            return "the wrapper's multisine has Schroeder's phases: leave --phases out"
        if any(p.lines > MOST_LINES for p in signals.played):
            return f"the wrapper's multisine has at most {MOST_LINES} lines: leave --lines out"
    places = [_place(b) for b in bounds]
    for bound, place in zip(bounds, places, strict=True):
        if place is None:
            return f"the wrapper excites collective pitch and generator torque, {bound.name} ({bound.unit}) is neither"
    if len(set(places)) < len(places):
        return "two inputs are the same demand to the wrapper: excite one of them"
    return ""


def wrapper_text(signals: Signals, bounds: Sequence[Bound], start_s: float) -> str:
    """Return the sections [pitch excitation] and [torque excitation]; raises UsageError where it cannot be played.

    start_s: when the signal begins, in simulated seconds.
    """
    if reason := unplayable(signals, bounds):
        raise UsageError(f"--wrapper: {reason}")
    if not 0 <= start_s < LONGEST_S:
        raise UsageError(f"--start {start_s:g}: seconds of 0 or more are needed")
    parts = [_section(signals, bound, played, start_s) for bound, played in zip(bounds, signals.played, strict=True)]
    head = f"# {signals.shape.text(signals.step_s)}; put this behind the other lines of libaeolid_discon.cfg\n"
    return head + "\n".join(parts)


def _section(signals: Signals, bound: Bound, played: Played, start_s: float) -> str:
    if bound.demand is None:
        raise UsageError(
            f"--wrapper: the least and most of the whole demand are needed beside the excitation: "
            f"--demand {bound.name}=LOW..HIGH"
        )
    place = _place(bound)
    assert place is not None
    kind, unit = place, factor_to(SECTIONS[place], bound.unit)
    assert unit is not None
    # half a sample early, so that the rounding of a simulator's time moves no bit; a sum of cosines has no edges
    begin = start_s - 0.5 * signals.step_s if signals.shape.kind == "prbs" and start_s > 0 else start_s
    rate = bound.rate if math.isfinite(bound.rate) else 4 * played.amplitude / signals.step_s
    lines = [f"[{kind} excitation]", f"signal = {signals.shape.kind}"]
    if kind == "pitch":
        lines.append("form = collective")
    numbers: dict[str, float] = {
        "amplitude": played.amplitude * unit, "rate": rate * unit, "start": begin,
        "stop": start_s + (played.rows - 0.5) * signals.step_s, "minimum": bound.demand[0] * unit,
        "maximum": bound.demand[1] * unit,
    }  # fmt: skip
    if signals.shape.kind == "prbs":
        numbers |= {"hold": signals.shape.clock_rows * signals.step_s, "order": played.order}
    else:
        numbers |= {"low": played.low_hz, "high": played.high_hz, "lines": played.lines}
    numbers["seed"] = played.seed
    lines += [f"{key} = {value:.15g}" for key, value in numbers.items()]
    return "\n".join(lines) + "\n"


def _place(bound: Bound) -> str | None:
    """Return the section that an input belongs to, None where it is neither pitch nor torque in a known unit."""
    meaning = meaning_of(bound.name)
    kind = "" if meaning is None or meaning.blade else meaning.kind
    if kind not in SECTIONS or factor_to(SECTIONS[kind], bound.unit) is None:
        return None
    return kind
