"""Mass that moves along and is not in the model: ice, water, a payload."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations


def _attach(site: Site) -> list[Attachment]:
    """Attach where no declared mass could say the same: a wrong declared one is a parameter."""
    return [_on(motion, i) for i, motion in enumerate(site.motions) if motion.mass is None and not motion.recorded]


def _on(motion: Motion, number: int) -> Attachment:
    ratio = f"added_mass_{number + 1}"
    slots = (Slot(ratio, "mass_ratio", "1", 0.0, 0.0, 5.0, 1e-4),)

    def edit(model: Equations) -> Equations:
        share = ex.parse(f"-{ratio}/(1 + {ratio})", "added mass")
        return motion.inject(with_parameters(model, slots), ex.combine("*", share, motion.forces), f"{ratio}_force")

    return Attachment(
        "added_mass", f"added_mass {motion.location}", location(motion.location), edit, slots,
        starts=({}, {ratio: 0.05}, {ratio: 0.3}),
        equation=f"(1 + mass_ratio)*a = what the model says a is, a the acceleration at {motion.location}",
        statement=lambda v: (
            f"{v['mass_ratio']:.1%} more mass (or inertia) moves at {motion.location} than the model has:"
            " it answers every force the less"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="added_mass",
    family="stiffness_change",
    name="added mass",
    equation="(1 + mass_ratio)*q'' = f(q, q', u); against a run an output times factor",
    source="Blevins 1979, Flow-Induced Vibration (added mass); ISO 12494:2017 (ice)",
    quantities=(
        Quantity("mass_ratio", "1", 0.0, 5.0, 0.0, "added mass over the mass in the model"),
        Quantity("factor", "1", 0.02, 50.0, 1.0, "how an output moves over how it does in a simulator's run"),
    ),
    attaches_to="every equation of motion without a declared mass, every oscillatory mode",
    signature="frequency, damping and gain fall together: omega^2, 2*zeta*omega and the gain by the same factor",
    confused_with=(
        ("stiffness_change", "gain above resonance: mass lowers it, stiffness leaves it"),
        ("parameter_error", "a wrong frequency leaves the gain above resonance alone; a declared mass is a parameter"),
    ),
    attach=_attach,
    rank=390,
    settings=(
        Setting(OPENFAST, "ElastoDyn: NacMass, HubMass, AdjTwMa, AdjBlMs; inertias NacYIner, HubIner, GenIner"),
        Setting(BLADED, "Mass and inertia of hub, nacelle, tower, blades"),
    ),
)
