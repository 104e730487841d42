"""Air that is thinner or denser than the model's: torque and thrust scale alike."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts import power_level
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

_MOST = 0.35  # air of 1.6 or 0.8 kg/m³ where 1.225 was assumed: colder and higher than any wind farm


def _attach(site: Site) -> list[Attachment]:
    return power_level.scaled(
        site, "air_density", "density_change", ("speed", "fore_aft"), _MOST,
        "Q_aero = (1 + density_change)*Q_aero_model, T = (1 + density_change)*T_model",
        lambda change: f"the air's density is off by {change:+.1%} from the model's: torque and thrust go with it",
    )  # fmt: skip


ENTRY = Entry(
    id="air_density",
    family="power_level",
    name="changed air density",
    equation="Q_aero = (1 + density_change)*Q_aero_model, T = (1 + density_change)*T_model",
    source="IEC 61400-12-1 (normalisation by density); Burton et al., Wind Energy Handbook",
    quantities=(Quantity("density_change", "1", -_MOST, _MOST, 0.0, "relative change; weather and height give 0.2"),),
    attaches_to="rotor and tower fore-aft equations of a wind turbine together; without thrust in the model only"
    " cp_change attaches, for nothing tells the two apart",
    signature="torque and thrust are off by the same factor at every wind",
    confused_with=(
        ("cp_change", "the thrust: density scales it as the torque, a worse power coefficient does not"),
        ("efficiency_loss", "torque and speed: a loss behind the rotor shows only in the power"),
    ),
    attach=_attach,
    rank=530,
    settings=(
        Setting(
            OPENFAST, "turbine.fst: AirDens = {density_factor:.4g} times the present value", "turbine.fst: AirDens"
        ),
        Setting(BLADED, "Wind: air density = {density_factor:.4g} times the present value", "Wind: air density"),
    ),
)
