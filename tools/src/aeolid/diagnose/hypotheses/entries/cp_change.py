"""A rotor that takes more or less power from the wind than its curve says."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts import power_level
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting


def _attach(site: Site) -> list[Attachment]:
    return power_level.scaled(
        site, "cp_change", "cp_change", ("speed",), 0.6, "Q_aero = (1 + cp_change)*Q_aero_model",
        lambda change: (
            f"the rotor's torque is off by {change:+.1%} from what the model's power coefficient gives (soiled,"
            " iced or worn blades would do that)"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="cp_change",
    family="power_level",
    name="changed power coefficient",
    equation="Q_aero = (1 + cp_change)*Q_aero_model",
    source="Burton et al., Wind Energy Handbook, chapter 3; Dalili et al. 2009, Renew. Sust. Energy Rev. 13",
    quantities=(Quantity("cp_change", "1", -0.6, 0.6, 0.0, "relative change of the aerodynamic torque"),),
    attaches_to="the rotor's equation of motion of a wind turbine (equations whose aerodynamic slopes are not all free;"
    " in a linear model it is a wrong gain)",
    signature="every aerodynamic torque is off by one factor, the thrust is not",
    confused_with=(
        ("air_density", "the thrust: density scales it as the torque, a worse power coefficient does not"),
        ("efficiency_loss", "torque and speed: a loss behind the rotor shows only in the power"),
    ),
    attach=_attach,
    rank=520,
    settings=(
        Setting(OPENFAST, "AeroDyn: polars (AFNames) and twist (BlTwist) of the blades"),
        Setting(BLADED, "Aerofoils: lift and drag, for instance of rough blades"),
    ),
)
