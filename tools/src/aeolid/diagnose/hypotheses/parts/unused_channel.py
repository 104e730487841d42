"""Let a recorded channel that the model has no use for act on its motions or poles, and an input where it acts not."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.exogenous import Exogenous, identifiers
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.structure.anatomy import ACCELERATION_UNITS, LEAST_MODULUS, in_digits
from aeolid.diagnose.structure.baseline import with_force
from aeolid.diagnose.structure.forces import FORCE
from aeolid.diagnose.structure.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State
from aeolid.models.intersample import PREFIX
from aeolid.models.state_space import StateSpace
from aeolid.units import same_unit

Array = NDArray[np.float64]
_MOST_CHANNELS, _MOST_PLACES = 3, 4


@dataclass(frozen=True, eq=False)
class Entrance:
    """Hold a place where a channel may enter: how, and the typical size of what acts there."""

    location: str
    size: float
    add: Callable[[Equations, ast.expr, str], Equations]


def attach(site: Site, entry: str, channels: list[Exogenous], says: str) -> list[Attachment]:
    """Offer one hypothesis a channel (at most 3): a free gain into each place (at most 4)."""
    places = entrances(site)
    chosen = channels[:_MOST_CHANNELS] if places else []
    return [_on(site, entry, (c.name, c.symbol), rotor.samples(site, c), places, says) for c in chosen]


def within_states(site: Site, entry: str, channels: list[Exogenous], says: str) -> list[Attachment]:
    """Offer each channel (at most 3) as a part of what the equations leave to chance: a wind that nobody measures.

    Such a state moves by its own rate and by noise alone, and the others and the outputs read it. Where the channel is
    a part of it, one gain says what the channel does everywhere, at once; with a gain for each place of its own it
    would have to be large to be worth them, and what outputs read at once would stay hidden.
    """
    if site.linear is not None:
        return []
    return [
        _as(site, entry, channel, state, says)
        for channel in channels[:_MOST_CHANNELS] for state in _left_to_chance(site.model)
        if float(np.nanstd(rotor.samples(site, channel))) > 0
    ]  # fmt: skip


def _left_to_chance(model: Equations) -> list[State]:
    """Return the states that noise drives, no other state and no input, and that others or outputs read."""
    others = {s.name for s in model.states} | set(model.symbols)
    needs = {s.name: ex.names_in(written_out(s.derivative, model)) for s in model.states}
    read = {o.name: ex.names_in(written_out(o.equation, model)) for o in model.outputs} | needs
    forces = {s.name for s in model.states if s.name.startswith(FORCE)}
    return [
        s for s in model.states
        if f"{FORCE}{s.name}" in forces and needs[s.name] & (others - forces) <= {s.name}
        and any(s.name in names for reader, names in read.items() if reader != s.name)
    ]  # fmt: skip


def _as(site: Site, entry: str, channel: Exogenous, state: State, says: str) -> Attachment:
    """Add gain*(channel - mean) to a state wherever it is read, but in its own rate."""
    values = rotor.samples(site, channel)
    mean, alike = float(np.nanmean(values)), same_unit(channel.unit, state.unit)
    scale = 1.0 if alike else max(abs(state.initial), 1.0) / float(np.nanstd(values))
    tag = identifiers([*site.input_names, *(c.name for c in site.exogenous)])[channel.name]
    slot = Slot(
        f"{entry}_{tag}_as_{state.name}", "gain", "1" if alike else "", 0.0, -1e6, 1e6, 1e-3,
        show=partial(operator.mul, scale),
    )  # fmt: skip
    whole = {state.name: ex.parse(f"{state.name} + {slot.name}*{scale!r}*({channel.symbol} - {mean!r})", entry)}

    def edit(model: Equations) -> Equations:
        model = _sampled_alike(model, channel.name)
        own = ex.names_in(next(s.derivative for s in model.states if s.name == state.name))
        return replace(
            model,
            parameters=(*model.parameters, Parameter(slot.name, 0.0, "", slot.low, slot.high)),
            states=tuple(
                s if s.name == state.name else replace(s, derivative=ex.substitute(s.derivative, whole))
                for s in model.states
            ),
            auxiliaries=tuple(
                a if a.name in own else replace(a, equation=ex.substitute(a.equation, whole)) for a in model.auxiliaries
            ),
            outputs=tuple(replace(o, equation=ex.substitute(o.equation, whole)) for o in model.outputs),
        )

    return Attachment(
        entry, f"{entry} {channel.name}, in {state.name}", location(f"input:{channel.name}", inputs=(channel.name,)),
        edit, (slot,), equation=f"{state.name} -> {state.name} + gain*({channel.name} - mean)",
        statement=lambda v: f"{channel.name} {says}: {v['gain']:.3g} of it is part of {state.name}",
    )  # fmt: skip


def _sampled_alike(model: Equations, name: str) -> Equations:
    """Read a channel between its rows as the inputs are read that one logger writes beside it."""
    known = [f for f in model.filters if f.kind.startswith(PREFIX)]
    if not known or name in {f.channel for f in model.filters}:
        return model
    late = max(known, key=lambda f: len(f.parameters))  # of outputs that passed a filter, if any is read so
    return replace(model, filters=(*model.filters, replace(late, channel=name)))


def across(site: Site, entry: str, says: str) -> list[Attachment]:
    """Offer each input (at most 3) of equations where the model lets it reach nothing: another body, another axis.

    What it reaches by any way has a place of its own already, and a further one could stand for a lag on that way.
    """
    if site.linear is not None:
        return []
    every, found = entrances(site), []
    for i, (name, symbol) in enumerate(zip(site.input_names, site.symbols, strict=False)):
        reached = _reached(site.model, symbol)
        places = [e for e in every if e.location.removeprefix("state:") not in reached]
        if reached and places and float(np.nanstd(site.u[:, i])) > 0:
            found.append(_on(site, entry, (name, symbol), site.u[:, i], places, says, " across"))
    return found[:_MOST_CHANNELS]


def _reached(model: Equations, symbol: str) -> set[str]:
    """Return the states that an input acts on, at once or through others."""
    needs = {s.name: ex.names_in(s.derivative) for s in model.states}
    reached: set[str] = set()
    while new := {n for n, names in needs.items() if n not in reached and names & {symbol, *reached}}:
        reached |= new
    return reached


def _on(
    site: Site, entry: str, channel: tuple[str, str], values: Array, places: list[Entrance], says: str, kind: str = ""
) -> Attachment:  # fmt: skip
    (name, symbol), mean, spread = channel, float(np.nanmean(values)), float(np.nanstd(values))
    tag = identifiers([*site.input_names, *(c.name for c in site.exogenous)])[name] + kind.replace(" ", "_")
    scales = [p.size / spread for p in places]  # slots of order one: the places differ by units
    slots = [
        Slot(
            f"{entry}_{tag}_{k + 1}", f"gain_{p.location}", "", 0.0, -1e6, 1e6, 1e-3, show=partial(operator.mul, scale),
        )
        for k, (p, scale) in enumerate(zip(places, scales, strict=True))
    ]  # fmt: skip

    def edit(model: Equations) -> Equations:
        model = _sampled_alike(model, name)
        extra = (Parameter(s.name, 0.0, "", s.low, s.high) for s in slots)
        model = replace(model, parameters=(*model.parameters, *extra))
        for slot, p, scale in zip(slots, places, scales, strict=True):
            term = ex.parse(f"{slot.name}*{scale!r}*({symbol} - {mean!r})", entry)
            model = rotor.push(model, p.add, term, f"{slot.name}_term")
        return model

    return Attachment(
        entry, f"{entry} {name}{kind}", location(f"input:{name}", inputs=(name,)), edit,
        tuple(slots), equation=f"dx/dt = f(x, u) + gain*({name} - mean)",
        statement=lambda v: f"{name} {says}",
    )  # fmt: skip


def entrances(site: Site) -> list[Entrance]:
    """List where a force may act: motions first, then the other states (equations) or the real poles (linear)."""
    if site.linear is not None:
        moving = [Entrance(m.location, m.force_size, m.inject) for m in site.motions]
        return (moving + _real_poles(site, site.linear))[:_MOST_PLACES]
    pushed = [s for s in site.model.states if f"{FORCE}{s.name}" in {x.name for x in site.model.states}]
    sizes = {m.location: m.force_size for m in site.motions}
    found = [Entrance(f"state:{s.name}", sizes.get(f"state:{s.name}", _rate(site, s)), _on_state(s)) for s in pushed]
    return sorted(found, key=lambda e: e.location not in sizes)[:_MOST_PLACES]


def _on_state(state: State) -> Callable[[Equations, ast.expr, str], Equations]:
    return lambda model, force, _: with_force(model, state.name, force)


def _rate(site: Site, state: State) -> float:
    """Return a typical rate of a state: from an output that reads it alone, else from its start value."""
    for j, name in enumerate(site.output_names):
        read = next(o.equation for o in site.model.outputs if o.name == name)
        if isinstance(read, ast.Name) and read.id == state.name:
            return float(np.nanstd(np.diff(site.y[:, j]))) / site.row_step or 1.0
    return max(abs(state.initial), 1.0) / (10 * site.row_step)


def _real_poles(site: Site, linear: StateSpace) -> list[Entrance]:
    """Push along each real pole's own direction, in units of the output that shows it most, slowest first."""
    values, right = np.linalg.eig(linear.A)
    spreads = np.maximum(np.nanstd(site.y, axis=0), 1e-300)
    found: list[tuple[float, float, Callable[[Equations, ast.expr, str], Equations]]] = []
    for k in np.argsort(-abs(values)):
        pole = float(values[k].real)
        if abs(values[k].imag) > 1e-9 or pole <= LEAST_MODULUS:
            continue
        shape = np.real(linear.C @ right[:, k])
        j = int(np.argmax(abs(shape) / spreads))
        if not shape[j]:
            continue
        rate = float(np.log(min(pole, 1 - 1e-9)) / linear.sample_time_s)
        direction = np.real(right[:, k]) / shape[j]
        gap = abs(rate) * float(spreads[j])
        feels = {
            s.name: float(c) / rate
            for s, c in zip(linear.outputs, shape / shape[j], strict=True)
            if s.unit.replace(" ", "") in ACCELERATION_UNITS
        }
        add = _along(direction * linear.sample_time_s, feels)
        found.append((abs(rate) / (2 * np.pi), gap, add))
    hertz = in_digits(np.array([rate for rate, _, _ in found]))
    return [Entrance(f"pole:{f} Hz", gap, add) for f, (_, gap, add) in zip(hertz, found, strict=True)]


def _along(
    direction: np.ndarray[tuple[int], np.dtype[np.float64]], feels: dict[str, float]
) -> Callable[[Equations, ast.expr, str], Equations]:
    def add(model: Equations, force: ast.expr, _: str) -> Equations:
        states = list(model.states)
        for i, share in enumerate(direction.tolist()):
            if share:
                term = ex.combine("*", ast.Constant(share), force)
                states[i] = replace(states[i], derivative=ex.combine("+", states[i].derivative, term))
        model = replace(model, states=tuple(states))
        for name, share in feels.items():
            model = rotor.on_output(model, name, ex.combine("*", ast.Constant(share), force))
        return model

    return add
