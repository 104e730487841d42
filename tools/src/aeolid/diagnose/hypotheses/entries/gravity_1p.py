"""Weight that turns with a rotor: out of balance on the shaft, a blade's own in its edgewise moment."""

from __future__ import annotations

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor, shafts
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.forces import swing, swings
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting


def _attach(site: Site) -> list[Attachment]:
    if not is_turbine(site.context):
        return shafts.out_of_balance(site, "gravity_1p")
    edge = rotor.blade_outputs(site, "edge")
    if edge:
        return rotor.on_blades(
            site, "gravity_1p", edge, (("sin", "weight"),), "M_edge = weight*sin(azimuth of the blade)",
            lambda size, unit: (
                f"the weight of the blades swings their edgewise moments by {size:.3g} {unit} once a turn;"
                " the model leaves it out"
            ),
        )  # fmt: skip
    shaft = rotor.place(site, "speed")
    if shaft is None:
        return []
    return rotor.locked(
        site, "gravity_1p", [(shaft, "")], 1, f"Q_weight = {swing(shaft.label)}",
        lambda size, unit, where: (
            f"weight pulls on the shaft once a turn: {size:.3g} {unit} at {where}, whatever the speed;"
            " the model leaves it out"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="gravity_1p",
    family="rotor_1p",
    name="gravity load once a turn",
    equation=f"Q_weight = {swing('torque_N_m')}; M_edge = weight*sin(azimuth of the blade)",
    source="Burton et al., Wind Energy Handbook, chapter 5; Manwell, McGowan, Rogers, Wind Energy Explained, chapter 4",
    quantities=(
        *swings("torque of the weight on the shaft", "torque_N_m"),
        Quantity("weight", "unit of the output", -1e12, 1e12, 0.0, "swing of a blade's moment, the blade level"),
    ),
    attaches_to="edgewise blade outputs, else the rotor's speed, of a wind turbine with a recorded rotor angle or speed"
    " (that in a single recording); shafts of other machines of which the same holds",
    signature="a line at the rotor's speed, locked to the angle, of the same size at every wind and speed",
    confused_with=(
        ("mass_imbalance", "the side-side motion: the force of a mass grows with the speed squared"),
        ("aero_imbalance", "another wind: weight does not grow with it"),
    ),
    attach=_attach,
    rank=430,
    settings=(
        Setting(OPENFAST, "turbine.fst: Gravity"),
        Setting(BLADED, "Loads: gravity"),
    ),
)
