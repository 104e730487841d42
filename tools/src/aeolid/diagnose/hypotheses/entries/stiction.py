"""Stiction: dry friction that is larger when nearly at rest (the Stribeck curve of the LuGre model)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import EDGE, force_on, say
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in enumerate((*site.motions, *site.bodies))]


def _on(motion: Motion, number: int) -> Attachment:
    """Blend in a whole Stribeck curve; what names it is the part above the sliding friction."""
    tag = f"stiction_{number + 1}"
    share, force, excess, speed = (f"{tag}_{what}" for what in ("share", "force", "excess", "speed"))
    size, pace, unit = motion.force_size, motion.velocity_size, motion.force_unit
    pace_unit = f"{motion.position_unit or '1'}/s"
    made = force_on(
        motion, number, "stiction",
        (
            Slot(share, None, "1", 0.0, 0.0, 1.0, 1e-2),
            Slot(force, motion.force_name, unit, 0.1 * size, 0.0, 100 * size, 1e-2 * size, local=False),
            Slot(excess, "breakaway_excess", unit, 0.0, 0.0, 100 * size, 1e-2 * size),
            Slot(speed, "stribeck_speed", pace_unit, 0.1 * pace, 3 * EDGE * pace, 2 * pace, 0.1 * pace, local=False),
        ),
        f"-{share}*({force} + {excess}*exp(-({{v}}/{speed})**2))*tanh({{v}}/{EDGE * pace!r})",
        fixed={share: 1.0}, share=share,
        grid=({force: 0.03 * size}, {force: 0.3 * size}),
        starts=({excess: 0.03 * size}, {excess: 0.3 * size}, {force: size, excess: size}),
        equation=f"F = -({motion.force_name} + breakaway_excess*exp(-(v/stribeck_speed)^2))*sign(v)",
        statement=say(
            f"dry friction at {{at}} sticks: {{{motion.force_name}:.3g}} {{unit}} in motion and"
            " {breakaway_excess:.3g} {unit} more near rest (below {stribeck_speed:.3g} {pace})",
            at=motion.location, unit=unit, pace=pace_unit,
        ),
    )  # fmt: skip
    return replace(made, essential=(excess,), credible=partial(_sticks, motion.force_name))


def _sticks(force: str, values: Mapping[str, float]) -> str:
    """Return what objects to an excess that is no larger than constants are off by: the friction is dry, no more."""
    if values["breakaway_excess"] > in_force().conclusion.known_share * values[force]:
        return ""
    share = values["breakaway_excess"] / max(values[force], 1e-300)
    return f"sticks by {share:.2g} of its friction, which dry friction may do"


ENTRY = Entry(
    id="stiction",
    family="friction",
    name="stiction (Stribeck friction)",
    equation="F = -(force_N + breakaway_excess*exp(-(v/stribeck_speed)^2))*sign(v)",
    source="Canudas de Wit, Olsson, Åström, Lischinsky 1995 (LuGre), steady sliding, sign smoothed as tanh(v/v_s)",
    quantities=(
        Quantity("force_N", "N (m/s^2 without a mass)", 0.0, 1e7, 0.0, "friction in motion"),
        Quantity("breakaway_excess", "N (m/s^2 without a mass)", 0.0, 1e7, 0.0, "how much more at rest"),
        Quantity("stribeck_speed", "m/s", 0.0, 1e3, float("nan"), "speed over which the excess dies away"),
    ),
    attaches_to="every velocity with an equation of motion, every oscillatory mode and driven body of a linear model, "
    "every recorded velocity of a static law",
    signature="the force falls as motion begins; slow motion jerks",
    confused_with=(("coulomb_friction", "Coulomb friction is the same at every speed: excess not above zero"),),
    attach=_attach,
    rank=130,
)
