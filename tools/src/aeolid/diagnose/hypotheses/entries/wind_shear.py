"""Wind that grows with height: each blade's load swings once a turn, the hub feels it blades times a turn."""

from __future__ import annotations

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.forces import swing, swings
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting


def _attach(site: Site) -> list[Attachment]:
    if not is_turbine(site.context):
        return []
    flap = rotor.blade_outputs(site, "flap")
    if flap:
        return rotor.on_blades(
            site, "wind_shear", flap, (("cos", "vertical"),), "M_flap = vertical*cos(azimuth of the blade)",
            lambda size, unit: (
                f"the wind grows with height: the blades' flapwise moments swing by {size:.3g} {unit} once a turn,"
                " most when the blade is up; the model leaves it out"
            ),
        )  # fmt: skip
    hub = rotor.hub(site)
    return [] if not hub else rotor.locked(
        site, "wind_shear", hub, rotor.blades(site), f"F = {swing(hub[0][0].label, 'blades*azimuth')}",
        lambda size, unit, where: (
            f"shear of the wind: {size:.3g} {unit} at {where}, {rotor.blades(site)} times a turn, locked to the rotor;"
            " the model leaves it out"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="wind_shear",
    family="rotor_1p",
    name="wind shear",
    equation="M_flap = vertical*cos(azimuth of the blade), V(z) = V_hub*(z/H)^alpha at first order; at the hub"
    f" F = {swing('force_N', 'blades*azimuth')}",
    source="Dolan and Lehn 2006, IEEE Trans. Energy Conversion 21(3); Burton et al., Wind Energy Handbook",
    quantities=(
        Quantity("vertical", "unit of the output", -1e12, 1e12, 0.0, "swing of a blade's moment, blade up (azimuth 0)"),
        *swings("thrust at the hub"),
    ),
    attaches_to="flapwise blade outputs (azimuth 0: blade 1 up), else fore-aft and rotor speed of a wind turbine whose"
    " rotor angle or speed is recorded",
    signature="one cosine a turn in every blade, shifted by the blades' spacing; at the hub only the blades' multiple",
    confused_with=(
        ("yaw_misalignment", "the wind vane; and a sine part, which only the skewed wake of a yawed rotor has"),
        ("tower_shadow", "higher multiples: a shadow is a narrow dip, shear a smooth swing"),
    ),
    attach=_attach,
    rank=440,
    settings=(
        Setting(OPENFAST, "InflowWind: PLexp, or the shear columns of the uniform wind file; TurbSim: PLExp"),
        Setting(BLADED, "Wind: shear exponent"),
    ),
)
