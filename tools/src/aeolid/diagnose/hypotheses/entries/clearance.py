"""Clearance: a spring that does not act until some free play is taken up."""

from __future__ import annotations

import ast
import math

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import place, travel, with_parameters, with_spring
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

_EDGE = 0.1  # of the gap, over which the damper comes into contact


def _attach(site: Site) -> list[Attachment]:
    """Attach where the model has a spring that the clearance can interrupt."""
    found = []
    for i, motion in with_spring(site):
        if site.linear is not None or ex.to_text(_behind(motion, "0")) != ex.to_text(motion.forces):
            found.append(_on(site, motion, i))
            if (damper := _damper(motion)) is not None:
                found.append(_on(site, motion, i, damper))
    return found


def _damper(motion: Motion) -> ast.expr | None:
    """Return the force of the damper between two bodies, beside their spring; None where the model has none."""
    if motion.frequency_hz is not None or not isinstance(motion.velocity, ast.BinOp):
        return None
    rest = ex.swap(motion.forces, motion.velocity, ast.Constant(0.0))
    return None if ex.to_text(rest) == ex.to_text(motion.forces) else ex.combine("-", motion.forces, rest)


def _position(motion: Motion) -> ast.expr:
    assert motion.position is not None  # of those with a spring
    return motion.position


def _lacking(motion: Motion, gap: str) -> ast.expr:
    """Return what the model's spring exerts too much: its force less its force behind the clearance."""
    if motion.frequency_hz is not None:
        return place(f"{(2 * math.pi * motion.frequency_hz) ** 2!r}*min(max({{q}}, -{gap}), {gap})", motion)
    return ex.combine("-", _behind(motion, f"{{q}} - min(max({{q}}, -{gap}), {gap})"), motion.forces)


def _behind(motion: Motion, form: str) -> ast.expr:
    """Return the motion's forces with its position replaced, also where that is a difference of two."""
    position, behind = _position(motion), place(form, motion)
    if isinstance(position, ast.Name):
        return ex.substitute(motion.forces, {position.id: behind})
    forces = ex.swap(motion.forces, position, behind)
    if isinstance(position, ast.BinOp) and isinstance(position.op, ast.Sub):
        reverse = ex.combine("-", position.right, position.left)
        forces = ex.swap(forces, reverse, ex.combine("-", ast.Constant(0.0), behind))
    return forces


def _on(site: Site, motion: Motion, number: int, damper: ast.expr | None = None) -> Attachment:
    """Return a clearance of the spring alone, or of what is in contact: spring and damper, as between teeth.

    With a damper that acts within the gap a gear's play of 0.25 degrees gained 382 nats on the fit data and lost 34 on
    the selection data, so that stops and a slider had the names; without it 334 and 81 nats.
    """
    kind = "" if damper is None else " with damper"
    gap, half = f"clearance_{number + 1}{kind[:1] and '_d'}", travel(site, motion)[1]
    slots = (Slot(gap, "half_gap", motion.position_unit, 0.0, 0.0, 2 * half, 1e-3 * half),)
    force = _lacking(motion, gap)
    if damper is not None:
        inside = place(f"max(min(({gap} - abs({{q}}))/({_EDGE}*{gap} + {1e-6 * half!r}), 1), 0)", motion)
        force = ex.combine("-", force, ex.combine("*", damper, inside))

    def edit(model: Equations) -> Equations:
        return motion.inject(with_parameters(model, slots), force, f"{gap}_force")

    return Attachment(
        "clearance", f"clearance{kind} {motion.location}", location(motion.location), edit, slots,
        starts=({}, {gap: 0.05 * half}, {gap: 0.2 * half}, {gap: 0.5 * half}),
        equation="q acts on the spring as q - min(max(q, -half_gap), half_gap)",
        statement=lambda v: (
            f"the spring at {motion.location} has a clearance: within {v['half_gap']:.3g} {motion.position_unit} to"
            " either side it does not act"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="clearance",
    family="nonlinear_stiffness",
    name="clearance in a spring",
    equation="F = -k*(q - min(max(q, -half_gap), half_gap))",
    source="Shaw and Holmes 1983, J. Sound Vib. 90(1); Comparin and Singh 1989, J. Sound Vib. 134(2)",
    quantities=(Quantity("half_gap", "m", 0.0, 1e6, 0.0, "free play to either side"),),
    attaches_to="every position, recorded ones too, that a spring of the model acts on, every oscillatory mode; between"
    " two bodies also of the spring with its damper",
    signature="soft for small motion, as modelled for large; a resonance that rises with amplitude",
    confused_with=(
        ("end_stop", "a stop adds force at the ends, a clearance lacks it in the middle"),
        ("cubic_stiffness", "smooth hardening against a corner at the end of the gap"),
        ("backlash", "a play in the drive delays reversals, a clearance leaves the middle without a spring"),
    ),
    attach=_attach,
    rank=180,
)
