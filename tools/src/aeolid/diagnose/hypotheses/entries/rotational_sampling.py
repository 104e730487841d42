"""Turbulence that the blades cut through again and again: a band at the blades' multiple of the rotor speed."""

from __future__ import annotations

import math
from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import band, rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.hypotheses.parts.wind import wind
from aeolid.diagnose.rules import in_force

_EQUATION = f"{band.EQUATION}, w = blades*Omega"


def _attach(site: Site) -> list[Attachment]:
    """Offer it as wind where the model has one: torque and thrust feel it together.

    As a thrust alone it contradicted the rotor's speed, which saw the gusts: 0.3 nats for 145 on the same recording.
    """
    places, order, rate = rotor.hub(site), rotor.blades(site), rotor.turning(site)
    if not is_turbine(site.context) or not places or not rate:
        return []
    if abs(order * rate) * site.row_step > in_force().hypotheses.nyquist_share * math.pi:
        return []
    omega = f"{order}*{rotor.speed(site) or repr(abs(rate))}"
    thrust = places[0][0]
    first = wind(site, thrust.output) or thrust
    where = {"azimuth_order": order, "frequency_hz": order * abs(rate) / (2 * math.pi)}
    found = band.narrow_band(
        site, "rotational_sampling", first, omega, (),
        _EQUATION,
        lambda v: (
            f"the blades sample the turbulence: a band at {order} times the rotor's speed,"
            f" {where['frequency_hz']:.3g} Hz, with a phase that wanders, at {first.location}; the model leaves it out"
        ),
    )  # fmt: skip
    return [replace(found, location={**found.location, **where})]


ENTRY = Entry(
    id="rotational_sampling",
    family="rotor_3p",
    name="rotational sampling of turbulence",
    equation=_EQUATION,
    source="Kristensen and Frandsen 1982, J. Wind Eng. Ind. Aerodyn. 10; Burton et al., Wind Energy Handbook",
    quantities=(Quantity("relative_width", "1", 0.0, band.WIDEST, 0.0, "half width of the band over its frequency"),),
    attaches_to="the model's wind, else fore-aft or rotor speed, of a wind turbine with a recorded rotor angle or"
    f" speed; band narrower than {band.WIDEST:g} of its frequency",
    signature="a band at the blades' multiple of the rotor speed that moves with it; its mean over turns is zero",
    confused_with=(
        ("tower_shadow", "phase: a shadow's mean over turns at one angle stays, sampled turbulence averages out"),
        ("structural_mode", "another rotor speed: sampled turbulence moves with it, a mode does not"),
    ),
    attach=_attach,
    rank=470,
    settings=(
        Setting(OPENFAST, "InflowWind: WindType = 3 with a full field of TurbSim in place of a uniform wind (1, 2)"),
        Setting(BLADED, "Wind: 3D turbulent in place of single point history"),
    ),
)
