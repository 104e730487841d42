"""A command that takes effect only after a dead time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.settings import BLADED, DRIVES, OPENFAST, Setting, given
from aeolid.models.equations import Equations, InputFilter, Parameter

_STARTS = (0.5, 1.5, 2.5, 3.5, 5.5, 8.5, 13.5, 20, 28, 38, 50, 65, 85)  # samples: a delay has an optimum in every one


def _statement(name: str, v: Mapping[str, float]) -> str:
    return f"{name} takes effect {v['delay_s']:.3g} s later than the model says (a dead time)"


def _attach(site: Site) -> list[Attachment]:
    longest = len(site.u) * site.step / 10
    result = []
    for i, name in enumerate(site.input_names):
        delay = f"delay_{i + 1}"

        def edit(model: Equations, delay: str = delay, name: str = name) -> Equations:
            return replace(
                model,
                parameters=(*model.parameters, Parameter(delay, 0.0, "s", 0.0, longest)),
                filters=(*model.filters, InputFilter(name, "transport_delay", (delay,))),
            )

        result.append(
            Attachment(
                "transport_delay", f"transport_delay input:{name}", location(f"input:{name}", inputs=(name,)), edit,
                (Slot(delay, "delay_s", "s", 0.0, 0.0, longest, 0.3 * site.step),),
                stepped=True,
                starts=({}, *({delay: k * site.step} for k in _STARTS if k * site.step < longest)),
                equation=f"{name}_actual(t) = {name}(t - delay_s)",
                statement=partial(_statement, name), credible=later_than_a_reading(site.step),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="transport_delay",
    family="input_lag",
    name="transport delay",
    equation="u_actual(t) = u(t - delay_s)",
    source="Ljung 1999, System Identification: Theory for the User, section 4.2",
    quantities=(Quantity("delay_s", "s", 0.0, 60.0, 0.0, "dead time"),),
    attaches_to="every input",
    signature="phase falls in proportion to frequency, gain is untouched",
    confused_with=(("actuator_lag", "gain droop above 1/tau_s is there for a lag, not for a delay"),),
    attach=_attach,
    rank=20,
    turns=True,
    settings=(
        Setting(
            OPENFAST,
            "ServoDyn: DLL_DT = {delay_s:.3g} s delays by up to one such step (DLL_Ramp by one more); else delay the"
            " demand in the controller library by {delay_s:.3g} s",
            "ServoDyn: DLL_DT and DLL_Ramp; else delay the demand in the controller library",
            at=DRIVES,
        ),
        Setting(
            BLADED,
            "no switch: delay the demand in the external controller by {delay_s:.3g} s",
            "no switch: delay the demand in the external controller",
            at=DRIVES,
        ),
        *given("delay what the run is given by {delay_s:.3g} s", "delay what the run is given"),
    ),
)
