"""Dry friction: a force of constant size against the motion."""

from __future__ import annotations

import ast
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter

_SMOOTHING = 0.01  # of the typical velocity: narrow enough to act as a sign, wide enough to integrate


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in enumerate(site.motions)]


def _on(motion: Motion, number: int) -> Attachment:
    force = f"friction_{number + 1}"
    top = 100.0 * motion.force_size

    def edit(model: Equations) -> Equations:
        ratio = ex.combine("/", motion.velocity, ast.Constant(_SMOOTHING * motion.velocity_size))
        sign: ast.expr = ast.Call(func=ast.Name(id="tanh"), args=[ratio], keywords=[])
        sign = motion.direction or sign
        pull = ast.UnaryOp(op=ast.USub(), operand=ex.combine("*", ast.Name(id=force), sign))
        extended = replace(model, parameters=(*model.parameters, Parameter(force, 0.0, motion.force_unit, 0.0, top)))
        return motion.inject(extended, pull, f"{force}_force")

    return Attachment(
        "coulomb_friction", f"coulomb_friction {motion.location}", location(motion.location), edit,
        (Slot(force, motion.force_name, motion.force_unit, 0.0, 0.0, top, 1e-2 * motion.force_size),),
        starts=({}, {force: 0.1 * motion.force_size}, {force: motion.force_size}),
        equation=f"F = -{motion.force_name}*sign(v), v at {motion.location}",
        statement=lambda v: (
            f"dry (Coulomb) friction of {v[motion.force_name]:.3g} {motion.force_unit} at {motion.location}"
            " opposes the motion and is missing from the model"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="coulomb_friction",
    family="friction",
    name="Coulomb friction",
    equation="F = -force_N*sign(v)",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); smoothed as tanh(v/v_s)",
    quantities=(Quantity("force_N", "N (N m, m/s^2 without a mass)", 0.0, 1e7, 0.0, "friction force"),),
    attaches_to="every velocity with an equation of motion, every oscillatory mode, every recorded one of a static law",
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
