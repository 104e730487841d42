"""Tell the angle of each shaft whose speed alone is recorded, up to where it began: weight on it goes by the angle."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.models import expressions as ex
from aeolid.models.angles import turn_of
from aeolid.models.equations import Equations, State
from aeolid.models.rotor_angle import TURNS, integrated
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
ROLE = "shaft angle"  # of a channel that nobody recorded
UNITS = ("rpm", "1/min", "rad/s", "deg/s")  # of speeds that are surely of something that turns


def with_shaft_angles(records: Sequence[Record], model: Equations) -> tuple[Record, ...]:
    """Return the recording with the angle in rad of each shaft by its recorded speed, at the middle of each row.

    There is none where an azimuth is recorded, where more samples of the speed are missing in a row than may be bridged
    (rule `bridged_rows`), and where there are several recordings: nobody knows how their angles lie to each other.
    """
    if len(records) != 1 or any(c.role == "azimuth" for c in records[0].channels):
        return tuple(records)
    (record,) = records
    known = {c.name: c for c in record.channels}
    for output in turning_outputs(model):
        unit = _plain(known[output].unit) if output in known and name_of(output) not in known else ""
        if unit not in UNITS or _longest_gap(record.column(output)) > in_force().data.bridged_rows:
            continue
        speed = radians(unit) * record.column(output)
        angle = integrated(speed, record.sample_time_s) + 0.5 * record.sample_time_s * np.nan_to_num(speed)
        channel = Channel(name_of(output), "rad", ROLE)
        record = replace(record, values=np.column_stack([record.values, angle]), channels=(*record.channels, channel))
    return (record,)


def radians(unit: str) -> float:
    """Return rad/s a unit, one of UNITS."""
    return 2 * np.pi * TURNS[unit]


def name_of(output: str) -> str:
    """Return what the angle of the shaft with this output's speed is called."""
    return f"angle of {output}"


def turning_outputs(model: Equations) -> dict[str, tuple[ast.expr, str]]:
    """Return the speed, with its unit, that each output shows of something that turns and whose angle no model has.

    In continuous time a speed is a state that no other one integrates; in discrete time any output, where none is an
    angle.
    """
    if model.sample_time_s:
        angles = any(turn_of(o.unit) is not None for o in model.outputs)
        return {o.name: (o.equation, o.unit) for o in model.outputs if not angles and _plain(o.unit) in UNITS}
    had = {s.derivative.id for s in model.states if isinstance(s.derivative, ast.Name)}
    units = {s.name: s.unit for s in model.states if s.name not in had and _plain(s.unit) in UNITS}
    shown = [(o.name, o.equation) for o in model.outputs]
    return {name: (read, units[read.id]) for name, read in shown if isinstance(read, ast.Name) and read.id in units}


def by_own_angles(model: Equations, channels: Sequence[tuple[str, str]]) -> Equations:
    """Return a model that has its shafts' angles as states where it went by the channels, which no recording has.

    channels: name and symbol of each. An angle begins at zero, as the channel does.
    """
    turns, step = turning_outputs(model), model.sample_time_s or 0.0
    for name, symbol in channels:
        output = next((o for o in turns if name_of(o) == name), None)
        if output is None or symbol not in model.names_used():
            continue
        speed = f"{radians(_plain(turns[output][1]))!r}*({ex.to_text(turns[output][0])})"
        rate = f"{symbol} + {step!r}*{speed}" if step else speed
        if step:  # the trapezoidal rule and half a row ahead: but for where it began the channel is that
            model = _substituted(model, {symbol: ex.parse(f"{symbol} + {step!r}*{speed}", symbol)})
        kept = [(s, n) for s, n in zip(model.inputs, model.symbols, strict=True) if s.name != name]
        state = State(symbol, "rad", ex.parse(rate, symbol), 0.0)
        model = replace(
            model, inputs=tuple(s for s, _ in kept), symbols=tuple(n for _, n in kept), states=(*model.states, state)
        )
    return model


def _substituted(model: Equations, by: dict[str, ast.expr]) -> Equations:
    return replace(
        model,
        states=tuple(replace(s, derivative=ex.substitute(s.derivative, by)) for s in model.states),
        auxiliaries=tuple(replace(a, equation=ex.substitute(a.equation, by)) for a in model.auxiliaries),
    )


def _longest_gap(values: Array) -> int:
    known = np.concatenate([[-1], np.flatnonzero(np.isfinite(values)), [len(values)]])
    return int(np.max(np.diff(known))) - 1


def _plain(unit: str) -> str:
    return unit.replace(" ", "")
