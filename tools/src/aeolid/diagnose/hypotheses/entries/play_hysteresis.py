"""Hysteresis with corners: a spring in series with a dry slider (play and stop operators)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, place, say, with_spring
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models.equations import Equations, Memory

_LEAST, _MOST = 0.03, 5.0  # of the typical position: less is a dry friction, more is a spring


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in with_spring(site)]


def _remembering(motion: Motion, slider: str, width: str) -> Callable[[Equations], Equations]:
    """Return what adds the slider: it stays where it is until the position has moved `width` away from it.

    It is renewed once a sample; in between, the spring is stretched no further than `width`, so that only a reversal
    within a sample is seen late.
    """
    follow = place(f"min(max({slider}, {{q}} - {width}), {{q}} + {width})", motion)

    def add(model: Equations) -> Equations:
        slid = Memory(slider, motion.position_unit, follow, place("{q}", motion))
        return replace(model, memories=(*model.memories, slid))

    return add


def _on(motion: Motion, number: int) -> Attachment:
    slider, stiff, width = (f"slider_{number + 1}{what}" for what in ("", "_stiffness", "_width"))
    unit, natural_size, size = per(motion, 1), natural(motion), motion.position_size
    return force_on(
        motion, number, "play_hysteresis",
        (
            Slot(stiff, "stiffness", unit, 0.0, 0.0, 1e3 * natural_size, 1e-3 * natural_size),
            Slot(width, "half_width", motion.position_unit, size, _LEAST * size, _MOST * size, size, local=False),
        ),
        f"-{stiff}*min(max({{q}} - {slider}, -{width}), {width})", states=_remembering(motion, slider, width),
        grid=tuple({width: share * size} for share in (2.0, 1.0, 0.5, 0.25, 0.12)),
        starts=({}, {stiff: 0.1 * natural_size}, {stiff: natural_size}),
        equation="F = -stiffness*(q - p), p follows q with a play of +-half_width",
        statement=say(
            "a spring with a dry slider acts at {at}: {stiffness:.3g} {unit} within {half_width:.3g} {length} after"
            " each reversal, then it slips (play hysteresis)",
            unit=unit, length=motion.position_unit, at=motion.location,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="play_hysteresis",
    family="hysteresis",
    name="play hysteresis (spring with a dry slider)",
    equation="F = -stiffness*(q - p), p = min(max(p, q - half_width), q + half_width)",
    source="Jenkins 1922; Visintin 1994, Differential Models of Hysteresis, play and stop operators",
    quantities=(
        Quantity("stiffness", "N/m (1/s^2 without a mass)", 0.0, 1e12, 0.0, "stiffness until it slips"),
        Quantity("half_width", "m", 0.0, 1e3, float("nan"), "deflection at which it slips"),
    ),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="a parallelogram of force over position, its width independent of amplitude and rate",
    confused_with=(
        ("bouc_wen_hysteresis", "sharp corners against round shoulders"),
        ("coulomb_friction", "friction flips at once, a slider takes up its spring first"),
        ("backlash", "backlash lies between the command and the drive, the slider acts on the motion itself"),
    ),
    attach=_attach,
    rank=200,
    at_least=(("half_width", "coulomb_friction"),),
)
