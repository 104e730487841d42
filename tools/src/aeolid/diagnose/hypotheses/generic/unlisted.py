"""Forces of a form that no entry of the catalogue has: where one fits far better, the nearest entry gets no name."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts import operating_point
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import force_on, say, with_parameters
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.baseline import noisy_states, with_force
from aeolid.diagnose.structure.forces import FORCE
from aeolid.diagnose.structure.passing import Passing, passings
from aeolid.models import expressions as ex
from aeolid.models.equations import TIME, Equations, State

ID = "unlisted"
MODES = 3  # of a linear model; one with more was identified, and each form would cost every mode a fit
_FORMS = (
    ("v*v", "{v}*{v}", "the square of the speed, whatever its direction"),
    ("q*q*v", "{q}*{q}*{v}", "the speed, by an amount that changes with the square of the deflection"),
)
_LOSSES = (
    ("", "{x}*abs({x})/{scale}", "{x}^2", "grows with its square"),
    ("_linear", "{x}", "{x}", "grows in proportion to it"),
)


def _attach(site: Site) -> list[Attachment]:
    found = [_bent(site, i) for i, name in enumerate(site.input_names) if name != TIME]
    if site.linear is None or len(site.motions) <= MODES:
        found += [a for i, m in enumerate(site.motions) for a in _on(m, i)]
    if site.linear is not None:
        return found
    found += [_lost(site, s, *form) for s in _holding(site) for form in _LOSSES]
    exchanged = passings(site.model, [s.name for s in stores(site)])
    return found + [_passed(site, p, i) for p in exchanged for i in range(len(site.input_names))]


def stores(site: Site) -> list[State]:
    """List the states of equations that store something and lose it: levels, temperatures."""
    return [s for s in _holding(site) if s.name in ex.names_in(s.derivative)]


def _holding(site: Site) -> list[State]:
    """List the states of equations that store something, whether the model lets any of it go or not.

    What a model keeps for good may leak: without that form a cylinder's pressure, which oil passes the piston, was a
    mode of 34.7 Hz in stroke and pressure (353 sealed nats), where the model's own resonance is damped by the leak.
    """
    moving = {n.id for m in site.motions for n in (m.velocity, m.position) if isinstance(n, ast.Name)}
    forces = {s.name for s in site.model.states if s.name.startswith(FORCE)}
    others = [site.model.states[i] for i in noisy_states(site.model)]
    storing = [s for s in others if s.name not in moving | forces and f"{FORCE}{s.name}" in forces]
    return [s for s in storing if not _alone(site, s)]


def _on(motion: Motion, number: int) -> list[Attachment]:
    position, velocity = max(motion.position_size, 1e-60), max(motion.velocity_size, 1e-60)
    sizes = {"v*v": motion.force_size / velocity**2, "q*q*v": motion.force_size / position**2 / velocity}
    found = []
    for k, (form, force, says) in enumerate(_FORMS):
        if "{q}" in force and motion.position is None:
            continue
        name, size = f"unlisted_{number + 1}_{k + 1}", sizes[form]
        found.append(
            force_on(
                motion, number, ID, (Slot(name, "factor", "", 0.0, -100 * size, 100 * size, 1e-4 * size),),
                f"-{name}*{force}", kind=f"_{k + 1}", starts=({}, {name: 0.1 * size}, {name: -0.1 * size}),
                equation=f"F = -factor*{form} at {motion.location}",
                statement=say("a force at {at} that follows {says}", at=motion.location, says=says),
            )
        )  # fmt: skip
    return found


def _bent(site: Site, i: int) -> Attachment:
    """Return an input whose action bends evenly to either side of its mean: a valve's curve."""
    name, symbol, u = site.input_names[i], site.symbols[i], site.u[:, i]
    mean, reach = float(np.nanmean(u)), float(np.nanmax(np.abs(u - np.nanmean(u)))) or 1.0
    slots = (Slot(f"unlisted_bent_{i + 1}", "factor", "1", 0.0, -10.0, 10.0, 1e-3),)
    term = f"{slots[0].name}*({symbol} - {mean!r})*({symbol} - {mean!r})/{reach!r}"
    return Attachment(
        ID, f"{ID} input:{name} bent", location(f"input:{name}", inputs=(name,)),
        partial(operating_point.acting, symbol, term, slots), slots,
        equation=f"what acts is {name} + factor*({name} - mean)^2/{reach:.4g}",
        statement=lambda v: f"what acts like {name} bends: {v['factor']:+.1%} where it is farthest from its mean",
    )  # fmt: skip


def _alone(site: Site, state: State) -> bool:
    """Tell whether a state's equation holds only itself, constants and its own force: a wind with memory."""
    known = {state.name, f"{FORCE}{state.name}", *(p.name for p in site.model.parameters)}
    return ex.names_in(state.derivative) <= known


def _lost(site: Site, state: State, kind: str, form: str, shown: str, says: str) -> Attachment:
    """Return a loss of what a state stores: of a level, a temperature."""
    name, scale = f"unlisted_{state.name}{kind}", max(abs(state.initial), 1.0)
    slots = (Slot(name, "factor", "", 0.0, -10.0 / site.step, 10.0 / site.step, 1e-6 / site.step),)
    force = ex.parse(f"-{name}*" + form.format(x=state.name, scale=repr(scale)), ID)

    def edit(model: Equations) -> Equations:
        return with_force(with_parameters(model, slots), state.name, force)

    where = f"state:{state.name}"
    return Attachment(
        ID, f"{ID} {where}{kind}", location(where), edit, slots,
        equation=f"d({state.name})/dt = ... - factor*{shown.format(x=state.name)}",
        statement=lambda values: f"a {'loss' if values['factor'] >= 0 else 'gain'} at {where} that {says}",
    )  # fmt: skip


def _passed(site: Site, passing: Passing, i: int) -> Attachment:
    """Return a flow between two stores that an input widens or narrows.

    Not one that is a share too small always: the factor of a sensor is the same by another name.
    """
    where, name = f"state:{passing.giver}-{passing.taker}", site.input_names[i]
    slots = (Slot(f"unlisted_{passing.giver}_{passing.taker}_{i + 1}", "factor", "", 0.0, -10.0, 10.0, 1e-3),)
    most = float(np.nanmax(np.abs(site.u[:, i]))) or 1.0
    more = ex.combine("*", ex.parse(f"{slots[0].name}*{site.symbols[i]}/{most!r}", ID), passing.flow)
    words = f"what passes from {passing.giver} to {passing.taker}"

    def says(values: Mapping[str, float]) -> str:
        way = "more" if values["factor"] > 0 else "less"
        return f"{words} is {way} than the model says, by {100 * abs(values['factor']):.2g} % where {name} is largest"

    return Attachment(
        ID, f"{ID} {where} with {name}", location(where),
        lambda model: exchange(with_parameters(model, slots), passing, more), slots,
        equation=f"{words}: flow*(1 + factor*{name}/{most:.4g})", statement=says,
    )  # fmt: skip


def exchange(model: Equations, passing: Passing, more: ast.expr) -> Equations:
    """Return the model in which more leaves one store and, its share, reaches the other."""
    model = with_force(model, passing.giver, ex.combine("*", ast.Constant(-1.0), more))
    return with_force(model, passing.taker, ex.combine("*", passing.share, more))


ENTRY = Entry(
    id=ID,
    family=ID,
    name="a form outside the catalogue",
    equation="F = -factor*v^2, -factor*q^2*v, -factor*x^2, -factor*x; flow*(1 + factor*u); u + factor*(u - mean)^2",
    source="of the library itself: the lowest powers that no entry has",
    quantities=(),
    attaches_to="every input; motions, what stores and what passes between two stores, of equations; modes of linear"
    " models that have no more than three",
    signature="fits far better than any entry",
    confused_with=(),
    attach=_attach,
)
