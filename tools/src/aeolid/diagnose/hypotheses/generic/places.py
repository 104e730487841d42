"""Find where something of any form may act on a model, and what it could follow there."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.generic.unlisted import ID, MODES, exchange, stores
from aeolid.diagnose.hypotheses.parts import operating_point
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.shafts import angle_of
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.baseline import with_force
from aeolid.diagnose.structure.passing import Passing, passings
from aeolid.models import expressions as ex
from aeolid.models.equations import TIME, Equations, State

Array = NDArray[np.float64]
Read = Callable[[ast.expr], Array]  # what an expression of the model is over the fit part


@dataclass(frozen=True, eq=False)
class Follows:
    """Hold a signal of the model that something may follow: tag and words, its text, its values over the fit part.

    unit and offset are for saying where on it something happens.
    """

    tag: str
    words: str
    text: str
    values: Array
    unit: str = ""
    offset: float = 0.0

    @property
    def mean(self) -> float:
        """Return its mean over the fit part."""
        return float(np.nanmean(self.values))

    @property
    def spread(self) -> float:
        """Return its standard deviation over the fit part."""
        return float(np.nanstd(self.values))


@dataclass(frozen=True, eq=False)
class Place:
    """Hold where something may act: acts(model, slots, term, name) adds a term, a text, to what acts there.

    size is the natural size of what acts there; follows are signals of the place itself. angles: of the shaft that it
    acts on, in rad, along which it may repeat a whole number of times a turn.
    """

    tag: str
    label: str
    words: str
    location: Mapping[str, Any]
    acts: Callable[[Equations, tuple[Slot, ...], str, str], Equations]
    size: float
    follows: tuple[Follows, ...]
    is_input: bool = False
    angles: tuple[Follows, ...] = ()

    @property
    def is_alive(self) -> bool:
        """Tell whether something of a size acts here, and every signal of the place moves."""
        sizes = [self.size, *(f.spread for f in self.follows)]
        return bool(self.follows) and all(np.isfinite(s) and s > 0 for s in sizes)

    def attach(
        self, kind: str, tag: str, slots: tuple[Slot, ...], term: str, *, equation: str,
        statement: Callable[[Mapping[str, float]], str],
        states: Callable[[Equations], Equations] = lambda model: model, **more: Any,
    ) -> Attachment:  # fmt: skip
        """Offer the hypothesis that a term acts here; `states` adds what it remembers."""
        return Attachment(
            ID, f"{ID} {kind} {self.label}", self.location,
            lambda model: self.acts(states(model), slots, term, f"{tag}_acts"), slots, equation=equation,
            statement=statement, **more,
        )  # fmt: skip


def places(site: Site, read: Read) -> list[Place]:
    """List inputs, motions (of a linear model with no more than three modes) and, of equations, stores and exchanges.

    What acts like an input of a linear model may follow what the outputs show. Left out: what never moves, and time.
    """
    found = [_input(site, i, read) for i, name in enumerate(site.input_names) if name != TIME]
    if site.linear is None or len(site.motions) <= MODES:
        found += [_motion(site, m, i, read) for i, m in enumerate(site.motions)]
    if site.linear is None:
        storing = stores(site)
        found += [_store(site, s, read) for s in storing]
        found += [_passing(p, read) for p in passings(site.model, [s.name for s in storing])]
    return [p for p in found if p.is_alive]


def _input(site: Site, i: int, read: Read) -> Place:
    name, symbol = site.input_names[i], site.symbols[i]
    own = Follows(f"u{i + 1}", name, symbol, read(ast.Name(id=symbol)), site.model.inputs[i].unit)
    shown = [f for j in range(len(site.output_names)) if (f := _shown(site, j, read)) is not None]

    def acts(model: Equations, slots: tuple[Slot, ...], term: str, _: str) -> Equations:
        return operating_point.acting(symbol, term, slots, model)

    return Place(
        f"u{i + 1}", f"input:{name}", f"what acts like {name}", location(f"input:{name}", inputs=(name,)), acts,
        own.spread, (own, *shown), True,
    )  # fmt: skip


def _shown(site: Site, j: int, read: Read) -> Follows | None:
    """Return what an output of a linear model shows of its states; None of equations, or where nothing moves."""
    if site.linear is None:
        return None
    signal = site.linear.outputs[j]
    row = [f"{float(c)!r}*{s.name}" for c, s in zip(site.linear.C[j], site.model.states, strict=False) if c]
    if not row:
        return None
    text = " + ".join(row)
    shown = Follows(f"y{j + 1}", signal.name, f"({text})", read(ex.parse(text, ID)), signal.unit, signal.offset)
    return shown if shown.spread > 0 else None


def _motion(site: Site, motion: Motion, number: int, read: Read) -> Place:
    pairs = ("q", "the position", motion.position), ("v", "the speed", motion.velocity)
    follows = tuple(
        Follows(f"{letter}{number + 1}", words, f"({ex.to_text(signal)})", read(signal))
        for letter, words, signal in pairs
        if signal is not None
    )

    seen = angle_of(site, motion)
    angles = () if seen is None else (
        Follows(f"a{number + 1}", f"the angle of {seen[0]}", seen[1], read(ex.parse(seen[1], ID)), "rad"),
    )  # fmt: skip

    def acts(model: Equations, slots: tuple[Slot, ...], term: str, name: str) -> Equations:
        return motion.inject(with_parameters(model, slots), ex.parse(term, ID), name)

    return Place(
        f"m{number + 1}", motion.location, f"a force at {motion.location}", location(motion.location), acts,
        motion.force_size, follows, angles=angles,
    )  # fmt: skip


def _store(site: Site, state: State, read: Read) -> Place:
    values, where = read(ast.Name(id=state.name)), f"state:{state.name}"

    def acts(model: Equations, slots: tuple[Slot, ...], term: str, _: str) -> Equations:
        return with_force(with_parameters(model, slots), state.name, ex.parse(term, ID))

    own = Follows(state.name, state.name, state.name, values, state.unit)
    return Place(
        state.name, where, f"a gain or loss at {where}", location(where), acts, 0.01 * own.spread / site.step, (own,)
    )


def _passing(passing: Passing, read: Read) -> Place:
    """Return what two stores exchange: what leaves one reaches the other."""
    where = f"state:{passing.giver}-{passing.taker}"

    def acts(model: Equations, slots: tuple[Slot, ...], term: str, _: str) -> Equations:
        return exchange(with_parameters(model, slots), passing, ex.parse(term, ID))

    driver = Follows(f"{passing.giver}_{passing.taker}", ex.to_text(passing.driver), f"({ex.to_text(passing.driver)})",
                     read(passing.driver))  # fmt: skip
    words = f"what passes from {passing.giver} to {passing.taker}"
    size = float(np.nanstd(read(passing.flow)))
    return Place(driver.tag, where, words, location(where), acts, size, (driver,))


def said(text: str, unit: str) -> str:
    """Return a value's text with its unit, if it has one."""
    return f"{text} {unit}".rstrip()
