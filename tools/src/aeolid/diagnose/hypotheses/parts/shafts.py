"""Let weight pull on shafts of any machine: a load out of balance goes by the sine of its angle."""

from __future__ import annotations

import ast

import numpy as np

from aeolid.diagnose.data.shaft_angle import ROLE, UNITS, name_of, radians
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, location
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.angles import radians_a_unit, turn_of
from aeolid.models.equations import Equations, Output


def out_of_balance(site: Site, entry: str) -> list[Attachment]:
    """Offer a torque that is a sine of the angle, on every shaft whose angle is known.

    Where there are shafts that no input drives, those: a load is out of balance, a motor comes balanced, and behind a
    stiff shaft nothing tells one from the other. A model that has a sine of an angle in a shaft's equation knows of its
    weight already.
    """
    shafts = site.bodies if site.linear is not None else site.motions
    found = [(m, a) for m in shafts for a in _on(site, m, entry)]
    loads = [a for m, a in found if not ex.names_in(m.forces) & set(site.symbols)]
    return loads or [a for _, a in found]


def _on(site: Site, motion: Motion, entry: str) -> list[Attachment]:
    seen = angle_of(site, motion)
    if seen is None or any(isinstance(n, ast.Name) and n.id in ("sin", "cos") for n in ast.walk(motion.forces)):
        return []
    output, text = seen

    def act(model: Equations, force: ast.expr, label: str) -> Equations:
        return motion.inject(model, force, label)

    place = rotor.Place(motion.location, output, motion.force_name, motion.force_unit, motion.force_size, True, act)
    slots, terms = rotor.harmonic(entry, [(place, "")], rotor.Angle(text, text))

    def edit(model: Equations) -> Equations:
        return rotor.add_terms(model, slots, terms)

    return [
        Attachment(
            entry, f"{entry} {motion.location}", location(motion.location, outputs=(output,)), edit, tuple(slots),
            equation=f"{motion.force_name} = S*sin(angle of {motion.location.partition(':')[2]} + phase)",
            statement=lambda v: (
                f"weight out of balance turns {output} with up to"
                f" {rotor.amplitude(v, slots):.3g} {motion.force_unit}, once a turn; the model leaves it out"
            ),
        )
    ]  # fmt: skip


def angle_of(site: Site, motion: Motion) -> tuple[str, str] | None:
    """Return the output that tells a shaft's angle and the angle in rad as text; None where it hardly turns.

    It is the recorded azimuth where that turns as the shaft does, the model's own where an output shows it, else what
    the speed tells. Within a small arc a sine is a spring and a constant force, which have names of their own.
    """
    least = in_force().hypotheses.least_arc_rad
    for j, output in enumerate(site.model.outputs):
        if motion.recorded is None and _shows(output, motion.velocity, motion):
            if (text := _by_azimuth(site, j, motion)) is not None:
                return output.name, text
            channel = next((c for c in site.exogenous if c.role == ROLE and c.name == name_of(output.name)), None)
            if channel is not None and np.ptp(rotor.samples(site, channel)) > least:
                return output.name, channel.symbol
        turn = turn_of(motion.position_unit)
        if turn is not None and motion.position is not None and _shows(output, motion.position, motion):
            a_unit = 2 * np.pi / turn
            if a_unit * float(np.nanmax(site.y[:, j]) - np.nanmin(site.y[:, j])) > least:
                return output.name, f"({float(a_unit)!r}*{ex.to_text(motion.position)})"
    return None


def _by_azimuth(site: Site, j: int, motion: Motion) -> str | None:
    """Return the recorded azimuth at the middle of a row as text, None where output j is no speed of what it shows."""
    channel, unit = rotor.azimuth(site), site.model.outputs[j].unit.replace(" ", "")
    if channel is None or unit not in UNITS:
        return None
    a_unit, scale = radians(unit), radians_a_unit(channel.unit, rotor.samples(site, channel))
    speed = a_unit * float(np.nanmedian(site.y[:, j]))
    if not abs(rotor.turning(site) - speed) < in_force().hypotheses.shaft_pace_share * abs(speed):
        return None
    return f"({scale!r}*{channel.symbol} + {0.5 * site.step * a_unit!r}*{ex.to_text(motion.velocity)})"


def _shows(output: Output, of: ast.expr, motion: Motion) -> bool:
    """Tell whether an output shows nothing but this; a body of a linear model says itself which output shows it."""
    if motion.shown_by:
        return of is motion.velocity and motion.shown_by == output.name
    return motion.recorded is None and isinstance(of, ast.Name) and ex.to_text(output.equation) == of.id
