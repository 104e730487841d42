"""A rotor that does not face the wind: advancing and retreating blades, a skewed wake."""

from __future__ import annotations

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, ROSCO, Setting

_EQUATION = "M_flap = vertical*cos(azimuth of the blade) + lateral*sin(azimuth of the blade)"


def _attach(site: Site) -> list[Attachment]:
    flap = rotor.blade_outputs(site, "flap") if is_turbine(site.context) else []
    return rotor.on_blades(
        site, "yaw_misalignment", flap, (("sin", "lateral"), ("cos", "vertical")),
        _EQUATION,
        lambda size, unit: (
            f"the rotor does not face the wind: the blades' flapwise moments swing by {size:.3g} {unit} once a turn,"
            " with a part that differs between the two sides; the model leaves it out"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="yaw_misalignment",
    family="rotor_1p",
    name="yaw misalignment",
    equation=_EQUATION,
    source="Bertelè, Bottasso, Cacciola et al. 2017, Wind Energy Science 2; Burton et al., Wind Energy Handbook",
    quantities=(
        Quantity("lateral", "unit of the output", -1e12, 1e12, 0.0, "sine part: the skewed wake"),
        Quantity("vertical", "unit of the output", -1e12, 1e12, 0.0, "cosine part: the advancing blade"),
    ),
    attaches_to="flapwise blade outputs of a wind turbine whose rotor angle is recorded (azimuth 0: blade 1 up)",
    signature="once a turn in every blade, with a part that differs left and right of the rotor",
    confused_with=(
        ("wind_shear", "the wind vane; shear has no sine part, a yawed rotor with a light wake has little"),
        ("tower_shadow", "higher multiples: a shadow is a narrow dip"),
    ),
    attach=_attach,
    rank=450,
    settings=(
        Setting(OPENFAST, "ElastoDyn: NacYaw (ServoDyn: YawNeut); or InflowWind: PropagationDir"),
        Setting(ROSCO, "Y_ControlMode and its offsets"),
        Setting(BLADED, "Wind: flow direction; nacelle: yaw angle"),
    ),
)
