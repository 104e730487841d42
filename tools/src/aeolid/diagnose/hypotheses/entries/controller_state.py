"""A hidden state between the recorded command and the plant, inside the drive's own controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from aeolid.diagnose.data.exogenous import identifiers
from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import operating_point, pitch_path
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.settings import BLADED, DRIVES, ROSCO, Setting
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, State

_TAUS = (3.0, 10.0, 30.0)
_LOW_S, _HIGH_S = 1.5, 200.0


def _attach(site: Site) -> list[Attachment]:
    if is_turbine(site.context):
        chosen = pitch_path.pitch_inputs(site)
    else:
        chosen = list(range(len(site.input_names)))[:2] if site.context.get("closed_loop") is True else []
    return [_on(site, i) for i in chosen]


def _says(name: str, v: Mapping[str, float]) -> str:
    return (
        f"an unrecorded state lies between {name} and the plant: what acts keeps {v['gain']:.3g} times the mean of"
        f" {name} over the last {v['tau_s']:.3g} s on top, as a hidden integrator with a leak does"
    )


def _on(site: Site, i: int) -> Attachment:
    name, symbol = site.input_names[i], site.symbols[i]
    tag = identifiers(site.input_names)[name]
    state, tau = f"hidden_{tag}", f"hidden_tau_{tag}"
    mean = float(np.mean(site.u[:, i]))
    gain = Slot(f"hidden_gain_{tag}", "gain", "1", 0.0, 0.0, 20.0, 1e-3)
    times = Slot(tau, "tau_s", "s", _LOW_S, _LOW_S, _HIGH_S, 0.5, local=False)

    def edit(model: Equations) -> Equations:
        model = operating_point.acting(symbol, f"{gain.name}*{state}", (gain, times), model)
        h, target = model.sample_time_s, f"({symbol} - {mean!r})"
        form = f"({target} - {state})/{tau}" if not h else f"{target} + exp(-{h!r}/{tau})*({state} - {target})"
        added = State(state, site.model.inputs[i].unit, ex.parse(form, "hidden state"), 0.0)
        return replace(model, states=(*model.states, added))

    return Attachment(
        "controller_state", f"controller_state input:{name}", location(f"input:{name}", inputs=(name,)), edit,
        (gain, times), grid=tuple({tau: t} for t in _TAUS), starts=({}, {gain.name: 0.5}), stepped=True,
        equation=f"acting = {name} + gain*z, dz/dt = ({name} - mean - z)/tau_s", statement=partial(_says, name),
    )  # fmt: skip


ENTRY = Entry(
    id="controller_state",
    family="coupling",
    name="hidden state in the recorded controller path",
    equation="acting = u + gain*z, dz/dt = (u - mean - z)/tau_s; a long tau_s with gain/tau_s held: an integrator",
    source="Åström and Hägglund 2006, Advanced PID Control, chapter 3",
    quantities=(
        Quantity("gain", "1", 0.0, 20.0, 0.0, "static gain of the hidden state; over tau_s it is the integral gain"),
        Quantity("tau_s", "s", _LOW_S, _HIGH_S, float("nan"), "its leak"),
    ),
    attaches_to="the pitch input of a wind turbine; elsewhere every input (at most 2) where the case says"
    " closed_loop = true",
    signature="the slow response to the command is larger than the fast one, alike in every output",
    confused_with=(
        ("actuator_lag", "the fast response: a lag takes it away, a hidden integrator leaves it"),
        ("dynamic_inflow", "direction: the wake makes the slow response smaller"),
        ("parameter_error", "fast and slow excitation: a wrong gain is wrong at every frequency"),
    ),
    attach=_attach,
    rank=580,
    settings=(
        Setting(
            ROSCO,
            "F_LPFType, F_LPFCornerFreq, F_LPFDamping and the other filters of DISCON.IN as on the turbine",
            at=DRIVES,
        ),
        Setting(BLADED, "External controller: the same version and parameters as on the turbine", at=DRIVES),
    ),
)
