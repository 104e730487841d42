"""A spring whose force grows with the square of its deflection."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, say, with_spring
from aeolid.diagnose.structure.anatomy import Motion


def _attach(site: Site) -> list[Attachment]:
    return [_on(motion, i) for i, motion in with_spring(site)]


def _on(motion: Motion, number: int) -> Attachment:
    name, size, unit = f"quadratic_{number + 1}", natural(motion, 2), per(motion, 2)
    return force_on(
        motion, number, "quadratic_stiffness",
        (Slot(name, "k2", unit, 0.0, -100 * size, 100 * size, 1e-4 * size),),
        f"-{name}*{{q}}*{{q}}",
        starts=({}, {name: 0.1 * size}, {name: -0.1 * size}),
        equation=f"F = -k2*q^2, q at {motion.location}",
        statement=say(
            "the restoring force at {at} has a part that grows with the square of the deflection (k2 = {k2:.3g}"
            " {unit}): it is stiffer to one side; the model is alike to both", at=motion.location, unit=unit,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="quadratic_stiffness",
    family="nonlinear_stiffness",
    name="quadratic stiffness",
    equation="F = -k2*q^2",
    source="Nayfeh and Mook 1979, Nonlinear Oscillations, section 2.3",
    quantities=(Quantity("k2", "N/m^2 (1/(m s^2) without a mass)", -1e12, 1e12, 0.0, "quadratic coefficient"),),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="large motion shifts the mean and makes second harmonics",
    confused_with=(
        ("cubic_stiffness", "odd against even: cubic makes third harmonics and leaves the mean alone"),
        ("end_stop", "a stop is silent until it is touched"),
    ),
    attach=_attach,
    rank=160,
)
