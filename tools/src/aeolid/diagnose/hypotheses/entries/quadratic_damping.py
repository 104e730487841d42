"""Drag: a damping force that grows with the square of the velocity."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, say
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.structure.anatomy import Motion


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in enumerate((*site.motions, *site.bodies))]


def _on(motion: Motion, number: int) -> Attachment:
    name, size = f"drag_{number + 1}", natural(motion, 2, velocity=True)
    unit = per(motion, 2, velocity=True)
    return force_on(
        motion, number, "quadratic_damping",
        (Slot(name, "c2", unit, 0.0, 0.0, 100 * size, 1e-4 * size),),
        f"-{name}*{{v}}*abs({{v}})",
        starts=({}, {name: 0.01 * size}, {name: 0.1 * size}),
        equation=f"F = -c2*v*abs(v), v at {motion.location}",
        statement=say(
            "drag at {at} grows with the square of the speed (c2 = {c2:.3g} {unit}); the model's damping does not grow"
            " with amplitude", unit=unit, at=motion.location,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="quadratic_damping",
    family="damping",
    name="quadratic damping (drag)",
    equation="F = -c2*v*abs(v)",
    source="Morison, Johnson, O'Brien, Schaaf 1950 (drag term); Nayfeh and Mook 1979, section 3.3",
    quantities=(Quantity("c2", "N/(m/s)^2 (1/m without a mass)", 0.0, 1e12, 0.0, "drag coefficient"),),
    attaches_to="every velocity with an equation of motion, every oscillatory mode and driven body of a linear model, "
    "every recorded velocity of a static law",
    signature="damping grows in proportion to amplitude",
    confused_with=(
        ("coulomb_friction", "size against speed: Coulomb is flat, drag grows with the square"),
        ("viscous_friction_change", "decay per cycle: drag's falls with amplitude, a viscous one stays"),
    ),
    attach=_attach,
    rank=210,
    settings=(
        Setting(OPENFAST, "HydroDyn: drag coefficients SimplCd"),
        Setting(BLADED, "Sea: hydrodynamic drag"),
    ),
)
