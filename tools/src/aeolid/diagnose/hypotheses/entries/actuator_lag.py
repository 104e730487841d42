"""A drive that follows its command with a first-order lag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.settings import BLADED, DRIVES_ELSE, DRIVES_PITCH, OPENFAST, ROSCO, Setting
from aeolid.models.equations import Equations, InputFilter, Parameter


def _statement(name: str, v: Mapping[str, float]) -> str:
    return f"{name} acts through a first-order lag of {v['tau_s']:.3g} s that the model leaves out"


def _attach(site: Site) -> list[Attachment]:
    span = len(site.u) * site.step
    result = []
    for i, name in enumerate(site.input_names):
        tau = f"lag_tau_{i + 1}"

        def edit(model: Equations, tau: str = tau, name: str = name) -> Equations:
            return replace(
                model,
                parameters=(*model.parameters, Parameter(tau, 0.0, "s", 0.0, span / 4)),
                filters=(*model.filters, InputFilter(name, "actuator_lag", (tau,))),
            )

        result.append(
            Attachment(
                "actuator_lag", f"actuator_lag input:{name}", location(f"input:{name}", inputs=(name,)), edit,
                (Slot(tau, "tau_s", "s", 0.0, 0.0, span / 4, 0.3 * site.step),),
                stepped=True,
                starts=({}, {tau: site.step}, {tau: 5 * site.step}),
                equation=f"d({name}_actual)/dt = ({name} - {name}_actual)/tau_s",
                statement=partial(_statement, name), credible=later_than_a_reading(site.step),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="actuator_lag",
    family="input_lag",
    name="first-order actuator lag",
    equation="d(beta)/dt = (beta_cmd - beta)/tau_s",
    source="Jonkman et al. 2009 (NREL 5 MW), pitch drive as a first-order lag; Burton et al., Wind Energy Handbook",
    quantities=(Quantity("tau_s", "s", 0.0, 60.0, 0.0, "time constant"),),
    attaches_to="every input",
    signature="phase falls and gain droops above 1/tau_s, alike in every output that the input drives",
    confused_with=(
        ("transport_delay", "gain: a delay leaves it flat, a lag lets it droop above 1/tau_s"),
        ("sensor_lag", "one input to all outputs (actuator) against all inputs to one output (sensor)"),
    ),
    attach=_attach,
    rank=10,
    turns=True,
    settings=(
        Setting(
            ROSCO,
            "PA_Mode = 1, PA_CornerFreq = {inverse_tau:.3g} rad/s",
            "PA_Mode = 1, PA_CornerFreq = 1/tau in rad/s",
            at=DRIVES_PITCH,
        ),
        Setting(
            BLADED,
            "Pitch actuator: first order, time constant {tau_s:.3g} s",
            "Pitch actuator: first order lag",
            at=DRIVES_PITCH,
        ),
        Setting(
            OPENFAST,
            (
                "ServoDyn has no lag of the torque behind a controller library: low-pass the demand in "
                "the library with {tau_s:.3g} s"
            ),
            ("ServoDyn has no lag of the torque behind a controller library: low-pass the demand in the library"),
            at=DRIVES_ELSE,
        ),
        Setting(
            BLADED, "Generator: torque time constant {tau_s:.3g} s", "Generator: torque time constant", at=DRIVES_ELSE
        ),
    ),
)
