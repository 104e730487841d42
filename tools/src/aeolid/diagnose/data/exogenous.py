"""Offer the catalogue what the model does not use: time, rotor angle, operating point, other recorded channels."""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.shaft_angle import ROLE as SHAFT_ANGLE
from aeolid.models.equations import TIME, Equations
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

ROLES = ("input", "disturbance", "scheduling", "azimuth", SHAFT_ANGLE)


@dataclass(frozen=True)
class Exogenous:
    """Name a recorded channel that the model has no use for; equations call it `symbol`. Time has the role time."""

    name: str
    symbol: str
    unit: str
    role: str


def exogenous_channels(records: Sequence[Record], model: Equations) -> tuple[Exogenous, ...]:
    """List time and the channels of input, disturbance, scheduling and azimuth role that the model does not use.

    Left out: channels with a sample missing where the model's inputs have theirs (it would cut the recording there) and
    those that never change. A row that a logger lost lacks everything, and cuts the recording in any case.
    """
    used = {s.name for s in model.inputs} | {o.name for o in model.outputs}
    taken = {*model.symbols, *(n.name for group in (model.parameters, model.states) for n in group)}
    whole = np.concatenate([_whole(r, [s.name for s in model.inputs]) for r in records])
    found = [Exogenous(TIME, _symbol(TIME, taken), "s", "time")] if TIME not in used else []
    for channel in records[0].channels:
        if channel.role not in ROLES or channel.name in used or channel.name == TIME:
            continue
        values = np.concatenate([r.column(channel.name) for r in records])[whole]
        if len(values) and np.all(np.isfinite(values)) and np.ptp(values) > 0:
            found.append(Exogenous(channel.name, _symbol(channel.name, taken), channel.unit, channel.role))
    return tuple(found)


def _whole(record: Record, inputs: Sequence[str]) -> NDArray[np.bool_]:
    """Tell in which rows (N,) of a recording no input of the model is missing."""
    names = {c.name for c in record.channels}
    rows = np.ones(len(record.values), dtype=bool)
    for name in inputs:
        if name in names:
            rows &= np.isfinite(record.column(name))
    return rows


def _symbol(name: str, taken: set[str]) -> str:
    symbol = identifier(f"ch_{name}", taken)
    taken.add(symbol)
    return symbol


def identifier(name: str, taken: Container[str]) -> str:
    """Return a channel's name as equations may have it: ASCII letters, digits and `_`, numbered where it is taken.

    Letters beyond ASCII would not do: some stand in no identifier, and others are read as a different one (NFKC).

    >>> identifier("temp_m²", ()), identifier("a b", {"a_b"}), identifier("µ temp", ("__temp", "__temp_2"))
    ('temp_m_', 'a_b_2', '__temp_3')
    """
    stem, number = re.sub(r"[^0-9A-Za-z_]", "_", name), 1
    found = stem
    while found in taken:
        number += 1
        found = f"{stem}_{number}"
    return found


def identifiers(names: Sequence[str]) -> dict[str, str]:
    """Return by name what equations may call each of these channels, no two alike."""
    found: dict[str, str] = {}
    for name in names:
        found[name] = identifier(name, set(found.values()))
    return found


def computed_inputs(model: Equations, channels: Sequence[Exogenous]) -> list[int]:
    """Return the places among a model's inputs of those channels that nobody recorded: angles by a shaft's speed."""
    names = {c.name for c in channels if c.role == SHAFT_ANGLE}
    return [i for i, s in enumerate(model.inputs) if s.name in names]


def with_time(record: Record) -> Record:
    """Return the recording with its time as a channel, unless it has one of that name."""
    if TIME in {c.name for c in record.channels}:
        return record
    values = np.column_stack([record.values, record.time_s])
    return replace(record, values=values, channels=(*record.channels, Channel(TIME, "s", "ignore")))


def with_exogenous(model: Equations, channels: Sequence[Exogenous]) -> Equations:
    """Return the model with these channels as further inputs."""
    return replace(
        model,
        inputs=(*model.inputs, *(Signal(c.name, c.unit) for c in channels)),
        symbols=(*model.symbols, *(c.symbol for c in channels)),
    )


def without_unused(model: Equations, channels: Sequence[Exogenous]) -> Equations:
    """Return the model without those of these channels that no equation and no filter uses."""
    used = model.names_used() | {s.name for s in model.inputs if s.name in {f.channel for f in model.filters}}
    extra = {c.symbol: c.name for c in channels}
    kept = [
        (signal, symbol)
        for signal, symbol in zip(model.inputs, model.symbols, strict=True)
        if symbol not in extra or symbol in used or signal.name in used
    ]
    return replace(model, inputs=tuple(s for s, _ in kept), symbols=tuple(n for _, n in kept))
