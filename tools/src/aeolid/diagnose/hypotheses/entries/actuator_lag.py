"""A drive that follows its command with a first-order lag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    ROSCO,
    Setting,
    given,
)
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
            OPENFAST,
            "ServoDyn: BPCutoff = {corner_hz:.3g} Hz, a first-order low-pass of the controller library's pitch demand",
            "ServoDyn: BPCutoff = 1/(2 pi tau) in Hz, a first-order low-pass of the controller library's pitch demand",
            at=DRIVES_PITCH,
        ),
        Setting(
            ROSCO,
            "PA_Mode = 1, PA_CornerFreq = {corner_rad_s:.3g} rad/s",
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
            "no switch: neither ServoDyn nor ROSCO has a lag of the torque; low-pass the demand in the controller"
            " library with {tau_s:.3g} s",
            "no switch: neither ServoDyn nor ROSCO has a lag of the torque; low-pass the demand in the controller"
            " library",
            at=DRIVES_TORQUE,
        ),
        Setting(
            BLADED,
            "Generator: torque time constant {tau_s:.3g} s",
            "Generator: torque time constant",
            at=DRIVES_TORQUE,
        ),
        *given("low-pass what the run is given with {tau_s:.3g} s", "low-pass what the run is given"),
    ),
)
