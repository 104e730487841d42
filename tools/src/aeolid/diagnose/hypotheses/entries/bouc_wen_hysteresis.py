"""Smooth hysteresis: a force with a memory that yields (Bouc and Wen)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, place, say, with_travel
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models.equations import Equations, State

_LEAST, _MOST = 0.03, 5.0  # of the typical position: less is a dry friction, more is a spring


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in with_travel(site)]


def _remembering(motion: Motion, loop: str, length: str) -> Callable[[Equations], Equations]:
    """Return what adds z' = (v - |v| z/2 - v |z|/2)/d: z lies in -1 … 1, its slope over q is 1/d at reversal."""

    def add(model: Equations) -> Equations:
        turn = f"({{v}} - 0.5*abs({{v}})*{loop} - 0.5*{{v}}*abs({loop}))/{length}"
        if model.sample_time_s:
            turn = f"min(max({loop} + {model.sample_time_s!r}*{turn}, -1), 1)"
        return replace(model, states=(*model.states, State(loop, "1", place(turn, motion), 0.0)))

    return add


def _on(motion: Motion, number: int) -> Attachment:
    loop, force, length = (f"loop_{number + 1}{what}" for what in ("", "_force", "_length"))
    unit, top, size = motion.force_unit, 100 * motion.force_size, motion.position_size
    return force_on(
        motion, number, "bouc_wen_hysteresis",
        (
            Slot(force, motion.force_name, unit, 0.0, 0.0, top, 1e-2 * motion.force_size),
            Slot(length, "yield_length", motion.position_unit, size, _LEAST * size, _MOST * size, size, local=False),
        ),
        f"-{force}*{loop}", states=_remembering(motion, loop, length),
        grid=tuple({length: share * size} for share in (2.0, 1.0, 0.5, 0.25, 0.12)),
        starts=({}, {force: 0.1 * motion.force_size}, {force: motion.force_size}),
        equation=f"F = -{motion.force_name}*z, z' = (v - |v|*z/2 - v*|z|/2)/yield_length",
        statement=say(
            f"a hysteretic (Bouc-Wen) force of up to {{{motion.force_name}:.3g}} {unit} acts at {motion.location}; it"
            f" yields over {{yield_length:.3g}} {motion.position_unit} after each reversal, however slowly"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="bouc_wen_hysteresis",
    family="hysteresis",
    name="Bouc-Wen hysteresis",
    equation="F = -force_N*z, z' = (v - |v|*z/2 - v*|z|/2)/yield_length",
    source="Wen 1976, J. Eng. Mech. 102(2), n = 1, beta = gamma = A/2; Ikhouane and Rodellar 2007",
    quantities=(
        Quantity("force_N", "N (m/s^2 without a mass)", 0.0, 1e9, 0.0, "yield force"),
        Quantity("yield_length", "m", 0.0, 1e3, float("nan"), "deflection over which it yields"),
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
)
