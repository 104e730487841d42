"""Smooth hysteresis: a force with a memory that yields (Bouc and Wen)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, place, say, with_travel
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models.equations import Equations, State

_LEAST, _MOST = 0.03, 5.0  # of the typical position: less is a dry friction, more is a spring
# Ratio of gamma to beta: 1 has straight ways back, below it the loop is slimmer, below -1 it hardens as it is driven
# on (the benchmark of Noel and Schoukens 2016 has -1.4). Beyond 2 loops swell on their way back.
_SHAPES = (-2.0, 2.0)


def _attach(site: Site) -> list[Attachment]:
    return [form(motion, i) for i, motion in with_travel(site) for form in (_classic, _shaped)]


def _remembering(motion: Motion, loop: str, length: str, shape: str) -> Callable[[Equations], Equations]:
    """Return what adds z' = (v - |v| z/2 - shape v |z|/2)/d; its slope over q is 1/d where it is 0.

    With shape 1 z lies in -1 … 1; with shape > -1 it ends at 2/(1 + shape).
    """

    def add(model: Equations) -> Equations:
        turn = f"({{v}} - 0.5*abs({{v}})*{loop} - 0.5*{shape}{{v}}*abs({loop}))/{length}"
        if model.sample_time_s:
            most = 1 if not shape else 100
            turn = f"min(max({loop} + {model.sample_time_s!r}*{turn}, -{most}), {most})"
        return replace(model, states=(*model.states, State(loop, "1", place(turn, motion), 0.0)))

    return add


def _slots(motion: Motion, loop: str) -> tuple[Slot, Slot]:
    force, length = f"{loop}_force", f"{loop}_length"
    top, size = 100 * motion.force_size, motion.position_size
    return (
        Slot(force, motion.force_name, motion.force_unit, 0.0, 0.0, top, 1e-2 * motion.force_size),
        Slot(length, "yield_length", motion.position_unit, size, _LEAST * size, _MOST * size, size, local=False),
    )


def _classic(motion: Motion, number: int) -> Attachment:
    loop = f"loop_{number + 1}"
    force, length = _slots(motion, loop)
    unit, size = motion.force_unit, motion.position_size
    return force_on(
        motion, number, "bouc_wen_hysteresis", (force, length), f"-{force.name}*{loop}",
        states=_remembering(motion, loop, length.name, ""),
        grid=tuple({length.name: share * size} for share in (2.0, 1.0, 0.5, 0.25, 0.12)),
        starts=({}, {force.name: 0.1 * motion.force_size}, {force.name: motion.force_size}),
        equation=f"F = -{motion.force_name}*z, z' = (v - |v|*z/2 - v*|z|/2)/yield_length",
        statement=say(
            f"a hysteretic (Bouc-Wen) force of up to {{{motion.force_name}:.3g}} {{unit}} acts at {{at}}; it yields"
            " over {yield_length:.3g} {length} after each reversal, however slowly",
            unit=unit, length=motion.position_unit, at=motion.location,
        ),
    )  # fmt: skip


def _shaped(motion: Motion, number: int) -> Attachment:
    loop = f"shaped_loop_{number + 1}"
    force, length = _slots(motion, loop)
    shape, size = Slot(f"{loop}_shape", "shape", "1", 1.0, *_SHAPES, 1.0, local=False), motion.position_size
    return force_on(
        motion, number, "bouc_wen_hysteresis", (force, length, shape), f"-{force.name}*{loop}", kind="_with_shape",
        states=_remembering(motion, loop, length.name, f"{shape.name}*"),
        grid=tuple({length.name: d * size, shape.name: s} for s in (0.0, -1.2) for d in (2.0, 1.0, 0.5, 0.25)),
        starts=({}, {force.name: 0.1 * motion.force_size}, {force.name: motion.force_size}),
        stepped=True,  # free springs and dampers hide a slim loop that hardens: their best has no slope towards it
        equation=f"F = -{motion.force_name}*z, z' = (v - |v|*z/2 - shape*v*|z|/2)/yield_length",
        statement=say(
            f"a hysteretic (Bouc-Wen) force {{{motion.force_name}:.3g}} {{unit}} z acts at {{at}}, z' = (v - |v| z/2"
            " - {shape:.3g} v |z|/2)/d with d = {yield_length:.3g} {length}",
            unit=motion.force_unit, length=motion.position_unit, at=motion.location,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="bouc_wen_hysteresis",
    family="hysteresis",
    name="Bouc-Wen hysteresis",
    equation="F = -force_N*z, z' = (v - |v|*z/2 - shape*v*|z|/2)/yield_length",
    source="Wen 1976, J. Eng. Mech. 102(2), n = 1, shape = gamma/beta; Ikhouane and Rodellar 2007",
    quantities=(
        Quantity("force_N", "N (m/s^2 without a mass)", 0.0, 1e9, 0.0, "yield force"),
        Quantity("yield_length", "m", 0.0, 1e3, float("nan"), "deflection over which it yields"),
        Quantity("shape", "1", *_SHAPES, 1.0, "ratio of gamma to beta; 1 unless the loop shows another"),
    ),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="a loop of force over position with round shoulders, the same at every rate",
    confused_with=(
        ("coulomb_friction", "friction flips at once, hysteresis over the yield length"),
        ("play_hysteresis", "sharp corners against round shoulders"),
        ("viscous_friction_change", "the loop's area grows with the rate for a viscous force only"),
    ),
    attach=_attach,
    rank=190,
    at_least=(("yield_length", "coulomb_friction"),),
)
