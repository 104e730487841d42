"""Write the corrected model of a pair: the run as a linear model at the recordings' sample time, with the effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.rotor_frame import to_fixed_frame
from aeolid.diagnose.run_prior.explain import Explanation, Found
from aeolid.diagnose.run_prior.hypotheses import Hypothesis
from aeolid.diagnose.run_prior.naming import Told
from aeolid.diagnose.run_prior.pair import Pair
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.identify.plain import identify_plainly
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, InputFilter, Output, Parameter
from aeolid.record import Record

Array = NDArray[np.float64]
_STATES = 24  # most of a model that is written: what the recordings' modes need, and a page to read
_LONGEST = 60  # samples of the window


def corrected_model(
    pair: Pair, explanation: Explanation, told: Sequence[Told], records: Sequence[Record], runs: Sequence[Record],
    sets: Sequence[tuple[str, tuple[str, ...]]],
) -> Equations:  # fmt: skip
    """Return the corrected model; where the runs lack a mode it is that of the recordings themselves."""
    lacking = any(f.scored is None or _is_resonance(f.scored.hypothesis) for f in explanation.found)
    source = [to_fixed_frame(r, sets) for r in (records if lacking else runs)]
    past = int(min(_LONGEST, math.ceil(pair.past * pair.stride), min(map(len, source)) // 20))
    outputs = len(source[0].names("output"))
    found = identify_plainly(source, past=past, order=min(_STATES, past * outputs), stable=True, uncertainty="none")
    model = equations_of(found.model, shaped_noise=False)
    name = "the recordings" if lacking else "the simulation, with what it leaves out"
    model = replace(model, name=f"linear model of {name}")
    if lacking:  # which has the other effects, too
        return model
    for k, (effect, values) in enumerate(zip(explanation.found, told, strict=True)):
        model = _with_effect(model, effect, values, f"effect{k + 1}")
    return model


def _is_resonance(h: Hypothesis) -> bool:
    """Tell whether a hypothesis is a mode that moved or that an output shows beside its own."""
    return "frequency_hz" in h.names


def _with_effect(model: Equations, found: Found, told: Told, tag: str) -> Equations:
    if found.scored is None:
        return model
    h, v = found.scored.hypothesis, {k: value for k, (value, _) in told.items()}
    kind, _, channel = h.place.partition(":")
    if kind == "input":
        if h.fault:  # recorded in another unit
            v = {"factor": 1.0 / v["factor"]}
        if h.entry in ("parameter_error", "sensor_scale"):
            model = _about_rest(model, channel, v["factor"])
        return _filtered(model, channel, _FILTERS[h.entry][0], _FILTERS[h.entry][1](v), tag)
    if h.entry == "data_time_offset" and kind == "data" and v["offset_s"] > 0:
        for i, signal in enumerate(model.inputs):
            model = _filtered(model, signal.name, "transport_delay", {"delay_s": v["offset_s"]}, f"{tag}_{i + 1}")
        return model
    if h.entry in ("sensor_scale", "sensor_sign"):
        factor = v.get("factor", -1.0)
        outputs = tuple(
            Output(o.name, o.unit, ex.combine("*", ex.parse(repr(factor), tag), o.equation)) if o.name == channel else o
            for o in model.outputs
        )
        return replace(model, outputs=outputs)
    return model


def _about_rest(model: Equations, channel: str, factor: float) -> Equations:
    """Return the model with the offset that keeps its rest when an input is scaled."""
    place = next(i for i, s in enumerate(model.inputs) if s.name == channel)
    bias = f"bias_u{place + 1}"
    rest = model.inputs[place].offset
    parameters = tuple(replace(p, value=(1 - factor) * rest) if p.name == bias else p for p in model.parameters)
    return replace(model, parameters=parameters)


_FILTERS: dict[str, tuple[str, Callable[[Mapping[str, float]], dict[str, float]]]] = {
    "actuator_lag": ("actuator_lag", lambda v: {"tau_s": v["tau_s"]}),
    "transport_delay": ("transport_delay", lambda v: {"delay_s": v["delay_s"]}),
    "actuator_second_order": (
        "actuator_second_order", lambda v: {"inverse_omega_s": 1 / v["omega_rad_s"], "damping": v["damping"]}
    ),
    "backlash": ("backlash", lambda v: {"width": v["width"], "share": 1.0}),
    "deadband": ("deadband", lambda v: {"width": v["width"], "share": 1.0}),
    "rate_limit": ("rate_limit", lambda v: {"rate_per_s": v["rate_per_s"], "share": 1.0}),
    "parameter_error": ("input_scale", lambda v: {"factor": v["factor"], "share": 1.0}),
    "sensor_scale": ("input_scale", lambda v: {"factor": v["factor"], "share": 1.0}),
    "dynamic_inflow": ("lead_lag", lambda v: {"tau_s": v["tau_s"], "gain": v["overshoot"]}),
    "unsteady_aero": ("lead_lag", lambda v: {"tau_s": v["tau_s"], "gain": -v["lagging_share"]}),
}  # fmt: skip


def _filtered(model: Equations, channel: str, kind: str, values: dict[str, float], tag: str) -> Equations:
    parameters = tuple(Parameter(f"{tag}_{n}", float(v), "") for n, v in values.items())
    used = tuple(p.name for p in parameters)
    return replace(
        model, parameters=(*model.parameters, *parameters), filters=(*model.filters, InputFilter(channel, kind, used))
    )
