"""Viscous friction where the model has none."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, say
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations


def _attach(site: Site) -> list[Attachment]:
    """Attach only where no term of the model follows the velocity: a declared coefficient is a parameter."""
    if site.linear is not None:
        return []  # every mode has a damping: a wrong one is a wrong value
    return [_on(m, i) for i, m in enumerate(site.motions) if not _follows(site.model, m)]


def _follows(model: Equations, motion: Motion) -> bool:
    seen = ex.names_in(motion.forces)
    for a in reversed(model.auxiliaries):
        seen |= ex.names_in(a.equation) if a.name in seen else set()
    return ex.names_in(motion.velocity) <= seen


def _on(motion: Motion, number: int) -> Attachment:
    name, size = f"viscous_{number + 1}", natural(motion, velocity=True)
    unit = per(motion, 1, velocity=True)
    return force_on(
        motion, number, "viscous_friction_change",
        (Slot(name, "damping_change", unit, 0.0, 0.0, 100 * size, 1e-4 * size),),
        f"-{name}*{{v}}",
        starts=({}, {name: 0.01 * size}, {name: 0.1 * size}),
        equation=f"F = -damping_change*v, v at {motion.location}",
        statement=say(
            "viscous friction of {damping_change:.3g} {unit} acts at {at}; the model has none there",
            unit=unit, at=motion.location,
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="viscous_friction_change",
    family="friction",
    name="viscous friction",
    equation="F = -damping_change*v",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, Automatica 30(7)",
    quantities=(
        Quantity("damping_change", "N s/m (1/s without a mass)", 0.0, 1e9, 0.0, "friction in proportion to speed"),
    ),
    attaches_to="every velocity with an equation of motion, or recorded of a static law, that does not depend on it",
    signature="free motion decays by the same share every cycle",
    confused_with=(
        ("coulomb_friction", "size against speed: Coulomb is flat, viscous grows in proportion"),
        ("quadratic_damping", "decay per cycle: drag's falls with amplitude, a viscous one stays"),
        ("parameter_error", "a declared friction coefficient that is wrong is a parameter, not a missing effect"),
    ),
    attach=_attach,
    rank=140,
)
