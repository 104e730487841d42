"""Less electrical power than the torque and the speed say."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, ROSCO, Setting
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter


def _attach(site: Site) -> list[Attachment]:
    if not is_turbine(site.context):
        return []
    return [_on(site.output_names[j]) for j in rotor.outputs_like(site, "power")[:1]]


def _on(name: str) -> Attachment:
    slot = Slot("efficiency_loss", "loss", "1", 0.0, -0.2, 0.8, 1e-3)

    def edit(model: Equations) -> Equations:
        kept = ex.parse(f"1 - {slot.name}", "efficiency")
        outputs = tuple(
            replace(o, equation=ex.combine("*", o.equation, kept)) if o.name == name else o for o in model.outputs
        )
        extra = Parameter(slot.name, 0.0, "1", slot.low, slot.high)
        return replace(model, outputs=outputs, parameters=(*model.parameters, extra))

    return Attachment(
        "efficiency_loss", f"efficiency_loss output:{name}", location(f"output:{name}", outputs=(name,)), edit, (slot,),
        equation=f"{name} = (1 - loss)*{name}_model",
        statement=lambda v: (
            f"{name} is {v['loss']:.1%} below what the model's torque and speed give: the drive train loses more"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="efficiency_loss",
    family="power_level",
    name="loss of drive-train or generator efficiency",
    equation="P = (1 - loss)*P_model",
    source="Burton et al., Wind Energy Handbook, chapter 6; IEC 61400-12-1",
    quantities=(Quantity("loss", "1", -0.2, 0.8, 0.0, "share of the modelled power that is not there"),),
    attaches_to="the power output (W, kW, MW) of a wind turbine",
    signature="power alone is low by a constant factor; torque, speed and thrust are as modelled",
    confused_with=(
        ("sensor_scale", "a second power meter: a wrong scale is the meter's, a loss heats the machine"),
        ("cp_change", "torque and speed: the rotor's own loss shows there, a loss behind it only in the power"),
    ),
    attach=_attach,
    rank=540,
    settings=(
        Setting(OPENFAST, "ServoDyn: GenEff; ElastoDyn: GBoxEff"),
        Setting(ROSCO, "VS_GenEff"),
        Setting(BLADED, "Losses: mechanical and electrical"),
    ),
)
