"""A stiffness or a gain that follows a recorded temperature.

The slope of a stiffness is absolute where the model has forces, relative to its own where it has only modes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, say, with_parameters, with_spring
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

UNITS = {"degC", "deg_C", "°C", "C", "K", "celsius", "degF", "°F"}


def _attach(site: Site) -> list[Attachment]:
    """Attach to every spring and every input gain, for each channel in a unit of temperature the model ignores."""
    found = []
    for k, channel in enumerate(site.exogenous):
        if channel.role == "time" or channel.unit.replace(" ", "") not in UNITS:
            continue
        mean, spread = float(np.mean(site.extra[:, k])), float(np.std(site.extra[:, k]))
        if spread > 0:
            found += [_stiffness(m, i, k, channel, (mean, spread)) for i, m in with_spring(site)]
            found += [_gain(site, i, k, channel, (mean, spread)) for i in range(len(site.input_names))]
    return found


def _stiffness(motion: Motion, number: int, k: int, channel: Exogenous, seen: tuple[float, float]) -> Attachment:
    mean, spread = seen
    mode = motion.frequency_hz is not None
    scale = (2 * math.pi * (motion.frequency_hz or 0.0)) ** 2 if mode else 1.0  # a mode's own: the slope is relative
    size = (1.0 if mode else natural(motion)) / spread
    unit = f"1/{channel.unit}" if mode else f"({per(motion, 1)})/{channel.unit}"
    name = f"temperature_{number + 1}_{k + 1}"
    return force_on(
        motion, number, "temperature_dependence",
        (Slot(name, "stiffness_slope", unit, 0.0, -10 * size, 10 * size, 1e-4 * size),),
        f"-{name}*({channel.symbol} - {mean!r})*{scale!r}*{{q}}", kind=f"_{k + 1}",
        equation=f"F = -stiffness_slope*({channel.name} - {mean:.4g})*{'w^2*' if mode else ''}q"
        f" at {motion.location}",
        statement=say(
            "the stiffness at {at} follows {channel}: {stiffness_slope:.3g} {unit} (the model has it constant)",
            at=motion.location, channel=channel.name, unit=unit,
        ),
    )  # fmt: skip


def _gain(site: Site, i: int, k: int, channel: Exogenous, seen: tuple[float, float]) -> Attachment:
    (mean, spread), name, symbol = seen, site.input_names[i], site.symbols[i]
    slope, size = f"temperature_gain_{i + 1}_{k + 1}", 1.0 / seen[1]
    slots = (Slot(slope, "gain_slope", f"1/{channel.unit}", 0.0, -3 * size, 3 * size, 1e-4 * size),)
    factor = {symbol: ex.parse(f"{symbol}*(1 + {slope}*({channel.symbol} - {mean!r}))", "temperature")}

    def edit(model: Equations) -> Equations:
        states = tuple(replace(s, derivative=ex.substitute(s.derivative, factor)) for s in model.states)
        outputs = tuple(replace(o, equation=ex.substitute(o.equation, factor)) for o in model.outputs)
        shared = tuple(replace(a, equation=ex.substitute(a.equation, factor)) for a in model.auxiliaries)
        return with_parameters(replace(model, states=states, outputs=outputs, auxiliaries=shared), slots)

    return Attachment(
        "temperature_dependence", f"temperature_dependence input:{name} {channel.name}",
        location(f"input:{name}", inputs=(name,)), edit, slots,
        equation=f"{name} acts with (1 + gain_slope*({channel.name} - {mean:.4g})) times the model's gain",
        statement=lambda v: (
            f"the gain from {name} follows {channel.name}: {v['gain_slope']:+.3%} a {channel.unit}"
            f" ({abs(v['gain_slope']) * spread:.1%} over its usual excursion)"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="temperature_dependence",
    family="stiffness_change",
    name="temperature dependence",
    equation="F = -stiffness_slope*(T - T0)*q, of a mode times w^2, w = 2*pi*frequency; or an input's gain times"
    " 1 + gain_slope*(T - T0)",
    source="Sohn 2007, Effects of environmental variability on structural health monitoring, Phil. Trans. A 365",
    quantities=(
        Quantity(
            "stiffness_slope",
            "N/m/K (1/(s^2 K) without a mass, 1/K for a mode)",
            -1e9,
            1e9,
            0.0,
            "stiffness a kelvin; of a mode relative",
        ),
        Quantity("gain_slope", "1/K", -1.0, 1.0, 0.0, "relative gain a kelvin"),
    ),
    attaches_to="every spring, every mode and every input gain, where a temperature is recorded that the model ignores",
    signature="the resonance or the gain moves with the recorded temperature, up and down again",
    confused_with=(("stiffness_change", "temperature that only rises looks like time: record a cooling, too"),),
    attach=_attach,
    rank=400,
)
