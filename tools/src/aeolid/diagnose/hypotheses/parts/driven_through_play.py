"""A body that its drive moves through play: teeth or a coupling with clearance between the two."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import travel, with_parameters
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, State

_CONTACT = 2.5  # rad a row, the frequency of a contact: near what rows show at most, stable in one step of integration
_LOSS = 0.5  # of critical damping, of a contact: teeth hardly bounce
_EDGE = 0.02  # of the width, over which the contact's damper comes in
_DEFLECTIONS = 3.0  # of that contact under what moves the body, up to which it stands for a play
_LEAST_WIDTH = 0.02  # of the half travel: what is narrower, filters and a lateness of parts of a row stand for
_LEAST_SHARE, _MOST_SHARE = 0.02, 0.98  # of the inertia, on either side
_WIDTHS, _SHARES, _FILMS, _DRAG = (0.03, 0.12, 0.35), (0.3, 0.6), (0.1, 1.0), 1.0  # that fits start from


def driven_through_play(site: Site) -> list[Attachment]:
    """Return, for each body that an input moves, that its drive and what the outputs read have play between them.

    Two inertias with a dead zone between them (Nordin and Gutman 2002, Automatica 38(10), section 2), the model's
    inertia J divided: the body has share s, its drive the rest. With q the body's position, q + x the drive's, and
    R = w² (x − min(max(x, −width/2), width/2)) + (film + contact) x' what pulls them together, over the inertia s (1 −
    s) J: s q'' = s (1 − s) R − s drag q' and (1 − s)(q + x)'' = a(q + x) − s (1 − s) R + s drag (q + x)', where J a are
    the model's forces. They act on the drive: a servo holds its own shaft. The contact's frequency w lies beyond what
    rows show. Of first-principles equations in continuous time whose body has a position; not of turbines, where the
    torque of the wind keeps the flanks together.
    """
    if site.linear is not None or site.model.sample_time_s or is_turbine(site.context):
        return []
    inputs = set(site.symbols)
    return [
        _on(site, motion, number)
        for number, motion in enumerate(site.motions)
        if motion.recorded is None and inputs & ex.names_in(motion.forces) and _is_read(site, motion)
    ]


def _is_read(site: Site, motion: Motion) -> bool:
    """Tell whether a motion has a state for its position and one for its speed, of which an output reads one."""
    if not isinstance(motion.velocity, ast.Name) or not isinstance(motion.position, ast.Name):
        return False
    return any({motion.velocity.id, motion.position.id} & ex.names_in(o.equation) for o in site.model.outputs)


def _on(site: Site, motion: Motion, number: int) -> Attachment:
    tag, half, fastest = f"play_{number + 1}", travel(site, motion)[1], _CONTACT / site.step
    blend, width, share, film, drag = (f"{tag}_{n}" for n in ("blend", "width", "share", "film", "drag"))
    slots = (
        Slot(blend, None, "", 0.0, 0.0, 1.0, SHARE_SIZE),
        Slot(width, "width", motion.position_unit, _WIDTHS[0] * half, 0.0, half, 0.01 * half, local=False),
        Slot(share, "share", "1", 0.5, _LEAST_SHARE, _MOST_SHARE, 0.05, local=False),
        Slot(film, None, "1/s", 0.0, 0.0, fastest, 0.1 / site.step, local=False),
        Slot(drag, None, "1/s", 0.0, 0.0, fastest, 1.0, local=False),
    )
    own = tuple(
        {width: w * half, share: s, film: f / site.step, drag: _DRAG} for w in _WIDTHS for s in _SHARES for f in _FILMS
    )
    return Attachment(
        "backlash", f"backlash {motion.location}", location(motion.location),
        partial(_driven, motion, tag, slots, fastest), slots, start_states=(f"{tag}_x", f"{tag}_rate"),
        fixed={blend: 1.0}, share=blend, grid=own, starts=({}, *own), stepped=True, rugged=True, essential=(width,),
        equation="share*(1 - share)*R between the body and its drive, R = w^2*(x - min(max(x, -width/2), width/2))"
        " + c*x', x the drive's position less the body's",
        statement=partial(_statement, motion),
        credible=partial(_wider_than, max(_DEFLECTIONS * _deflection(motion, fastest), _LEAST_WIDTH * half)),
    )  # fmt: skip


def _deflection(motion: Motion, contact: float) -> float:
    """Return by how much a contact of this frequency, in rad/s, gives way under the motion's typical acceleration."""
    inertia = abs(motion.mass.value) if motion.mass is not None else 1.0
    return motion.force_size / max(inertia, 1e-300) / contact**2


def _wider_than(least: float, p: Mapping[str, float]) -> str:
    """Object to a play that a contact which gives way, or a filter, stands for.

    A complete model of a gear, its constants 3 % off, had one of 0.05 mrad, or of 1.9 where it moves by 370 (217 sealed
    nats); gears that have play have 6 to 20 % of their half travel.
    """
    return "" if p["width"] > least else f"a play no wider than {least:.2g}, for which a filter may stand"


def _statement(motion: Motion, p: Mapping[str, float]) -> str:
    width = f"{p['width']:.3g} {motion.position_unit}".strip()
    return (
        f"what the model moves at {motion.location} is driven through {width} of play (backlash): {p['share']:.2g} of"
        " the inertia lies behind it; the model has the drive and the body in one"
    )


def _driven(motion: Motion, tag: str, slots: tuple[Slot, ...], contact: float, model: Equations) -> Equations:
    """Add the drive's motion against the body, and give the body what pulls it after the drive in place of a.

    One more state stands still and is as fast as the contact: the integration takes its steps from where a stretch
    begins, and one that began in the gap stepped over the contact (3,447 nats on the fit data, -770 on the sealed).
    """
    assert motion.position is not None
    blend, width, share, film, drag = (s.name for s in slots)
    x, rate, q, v = f"{tag}_x", f"{tag}_rate", ex.to_text(motion.position), ex.to_text(motion.velocity)
    known = next(s.derivative for s in model.states if s.name == v)
    own = ex.to_text(known)
    at_drive = ex.to_text(ex.substitute(known, {q: ex.parse(f"{q} + {x}", tag), v: ex.parse(f"{v} + {rate}", tag)}))
    touching = f"max(min((abs({x}) - {width}/2)/({_EDGE}*{width} + 1e-9), 1), 0)"
    pull = (
        f"({contact**2!r}*({x} - min(max({x}, -{width}/2), {width}/2))"
        f" + ({2 * _LOSS * contact!r}*{touching} + {film})*{rate})"
    )
    body = f"(1 - {share})*{pull} - {drag}*{v}"
    apart = f"(({at_drive}) + {share}*{drag}*({v} + {rate}))/(1 - {share}) - {pull} + {drag}*{v}"
    mass = motion.mass.name if motion.mass is not None else "1"
    force = ex.parse(f"{mass}*{blend}*({body} - ({own}))", tag)
    extended = motion.inject(with_parameters(model, slots), force, f"{tag}_acts")
    unit = motion.position_unit
    added = (
        State(x, unit, ex.parse(rate, tag), 0.0, True),
        State(rate, f"{unit}/s", ex.parse(apart, tag), 0.0, True),
        State(f"{tag}_pace", "1", ex.parse(f"-{contact!r}*{tag}_pace", tag), 0.0),  # stays 0: steps as fine in the gap
    )
    return replace(extended, states=(*extended.states, *added))
