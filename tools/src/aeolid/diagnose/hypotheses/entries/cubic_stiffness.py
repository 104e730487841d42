"""A spring that stiffens (or softens) with the cube of its deflection."""

from __future__ import annotations

import ast
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import per
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter


def _attach(site: Site) -> list[Attachment]:
    return [_on(m, m.position, i) for i, m in enumerate(site.motions) if m.position is not None]


def _on(motion: Motion, position: ast.expr, number: int) -> Attachment:
    name = f"cubic_{number + 1}"
    natural = motion.force_size / max(motion.position_size, 1e-300) ** 3
    unit = per(motion, 3)

    def edit(model: Equations) -> Equations:
        cube = ex.combine("*", ex.combine("*", position, position), position)
        pull = ast.UnaryOp(op=ast.USub(), operand=ex.combine("*", ast.Name(id=name), cube))
        extended = replace(
            model, parameters=(*model.parameters, Parameter(name, 0.0, unit, -100 * natural, 100 * natural))
        )
        return motion.inject(extended, pull, f"{name}_force")

    return Attachment(
        "cubic_stiffness", f"cubic_stiffness {motion.location}", location(motion.location), edit,
        (Slot(name, "k3", unit, 0.0, -100 * natural, 100 * natural, 1e-4 * natural),),
        starts=({}, {name: 0.01 * natural}, {name: 0.1 * natural}),
        equation=f"F = -k3*q^3, q at {motion.location}",
        statement=lambda v: (
            f"the restoring force at {motion.location} {'hardens' if v['k3'] > 0 else 'softens'} with the cube of the"
            f" deflection (k3 = {v['k3']:.3g} {unit}); the model is linear there"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="cubic_stiffness",
    family="nonlinear_stiffness",
    name="cubic (Duffing) stiffness",
    equation="F = -k3*q^3",
    source="Kovacic and Brennan 2011, The Duffing Equation",
    quantities=(Quantity("k3", "N/m^3 (1/(m^2 s^2) without a mass)", -1e12, 1e12, 0.0, "cubic coefficient"),),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="resonance moves with amplitude, third harmonic of large motion",
    confused_with=(
        ("quadratic_stiffness", "even against odd: quadratic shifts the mean and makes second harmonics"),
        ("stiffness_change", "a changed linear stiffness moves the resonance at every amplitude"),
    ),
    attach=_attach,
    rank=150,
)
