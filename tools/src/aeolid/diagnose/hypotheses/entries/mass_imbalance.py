"""A rotor whose centre of mass lies off its axis."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.forces import swings
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting


def _attach(site: Site) -> list[Attachment]:
    found = rotor.place(site, "side_side")
    if not is_turbine(site.context) or found is None:
        return []
    speed = rotor.speed(site)
    factor = f"*{speed}**2" if speed else ""
    if speed:  # the force over the square of the speed is the static moment of the mass itself
        unit = "kg m" if found.unit == "N" else f"{found.unit} s^2"
        label = "static_moment" if found.unit == "N" else found.label
        found = replace(found, label=label, unit=unit, size=found.size / rotor.turning(site) ** 2)
    return rotor.locked(
        site, "mass_imbalance", [(found, factor)], 1, _with(found.label, bool(speed)),
        lambda size, unit, where: (
            f"the rotor is out of balance by mass: once a turn a side force at {where}, {size:.3g} {unit}"
            f"{' (times the speed squared)' if speed else ''}, that the model leaves out"
        ),
    )  # fmt: skip


def _with(label: str, squared: bool) -> str:
    return f"F_side = {'Omega^2*' if squared else ''}({label}_cos*cos(azimuth) + {label}_sin*sin(azimuth))"


ENTRY = Entry(
    id="mass_imbalance",
    family="rotor_1p",
    name="mass imbalance of the rotor",
    equation=f"{_with('static_moment', squared=True)}; without a speed in the model {_with('force_N', squared=False)}",
    source="Niebsch, Ramlau, Nguyen 2010, Energies 3(4); Burton et al., Wind Energy Handbook",
    quantities=(
        Quantity("static_moment_cos", "kg m", -1e5, 1e5, 0.0, "static moment m_r, part in phase with cos(azimuth)"),
        Quantity("static_moment_sin", "kg m", -1e5, 1e5, 0.0, "part in phase with sin(azimuth)"),
        *swings("side force where the model has no speed of the rotor"),
    ),
    attaches_to="tower side-side of a wind turbine with a recorded rotor angle or speed",
    signature="one line at the rotor's speed in the side-side motion, locked to the angle, nothing in thrust",
    confused_with=(
        ("aero_imbalance", "the fore-aft motion: a pitched blade shakes it once a turn, a mass does not"),
        ("gravity_1p", "the force of a mass grows with the speed squared, its weight acts on the shaft"),
    ),
    attach=_attach,
    rank=410,
    settings=(
        Setting(OPENFAST, "ElastoDyn: a blade file of its own for one blade (BldFile) with AdjBlMs, or TipMass"),
        Setting(BLADED, "Rotor: mass imbalance (radial position and mass)"),
    ),
)
