"""Dry friction: a force of constant size against the motion."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import EDGE, force_on, say
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex

_SHARPEST, _SOFTEST = 0.003, 0.2  # of the typical velocity: where the force turns over


def _attach(site: Site) -> list[Attachment]:
    known = len(site.motions)  # a linear model's noise absorbs what a body's friction does, all but the finite step
    return [_on(motion, i, stepped=i >= known) for i, motion in enumerate((*site.motions, *site.bodies))]


def _on(motion: Motion, number: int, *, stepped: bool) -> Attachment:
    """Return friction that turns over within a free velocity: contacts give before they slide, filters round the edge.

    A positioning stage (EMPS) gains 33 nats by it, a damper behind anti-alias filters 66. Where only the sign of the
    velocity is known, there is none to free.
    """
    force, edge = f"friction_{number + 1}", f"friction_{number + 1}_edge"
    size, pace = motion.force_size, motion.velocity_size
    turns = f"tanh({{v}}/{edge})" if motion.direction is None else ex.to_text(motion.direction)
    slot = Slot(force, motion.force_name, motion.force_unit, 0.0, 0.0, 100 * size, 1e-2 * size)
    soft = Slot(edge, None, "", EDGE * pace, _SHARPEST * pace, _SOFTEST * pace, EDGE * pace, local=False)
    return force_on(
        motion, number, "coulomb_friction", (slot, soft) if motion.direction is None else (slot,),
        f"-{force}*{turns}",
        starts=({}, {force: 0.1 * size}, {force: size}), stepped=stepped,
        equation=f"F = -{motion.force_name}*sign(v), v at {motion.location}",
        statement=say(
            f"dry (Coulomb) friction of {{{motion.force_name}:.3g}} {{unit}} at {{at}} opposes the motion and is"
            " missing from the model", unit=motion.force_unit, at=motion.location,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="coulomb_friction",
    family="friction",
    name="Coulomb friction",
    equation="F = -force_N*sign(v)",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); smoothed as tanh(v/v_s)",
    quantities=(Quantity("force_N", "N (m/s^2 without a mass)", 0.0, 1e7, 0.0, "friction force"),),
    attaches_to="every velocity with an equation of motion, every oscillatory mode and driven body of a linear model, "
    "every recorded velocity of a static law",
    signature="a force that flips with the sign of the velocity and does not grow with it; odd harmonics",
    confused_with=(
        ("viscous_friction_change", "size against speed: Coulomb is flat, viscous grows in proportion"),
        ("stiction", "pre-sliding spring and break-away peak at reversal"),
        ("backlash", "loop area independent of rate; backlash width independent of amplitude"),
    ),
    attach=_attach,
    rank=120,
    settings=(
        Setting(OPENFAST, "ElastoDyn: YawFrctMod for the yaw bearing; ElastoDyn: GBoxEff for the drive train"),
        Setting(BLADED, "Pitch and yaw bearings: friction"),
    ),
)
