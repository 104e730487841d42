"""A channel whose numbers are a constant factor off: a wrong calibration, or another unit than stated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.data.forensics import RATIOS, ratio_text
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import likeness, with_filter, with_reading
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

_LARGEST = 2000.0
_UNITS_ONLY = 3.0  # where the range of a factor of units begins: no tolerance of a gain is that large
_UNITS = ((", larger unit", _UNITS_ONLY, _LARGEST), (", smaller unit", 1 / _LARGEST, 1 / _UNITS_ONLY))


def _statement(name: str, what: str, v: Mapping[str, float]) -> str:
    factor = v["factor"]
    verb = "shows" if what == "sensor" else "acts with"
    return f"the {name} {what} {verb} {factor:.4g} times what the model has{ratio_text(factor)}"


def _attach(site: Site) -> list[Attachment]:
    """Offer any factor on an output where another output shows the truth; elsewhere only ratios that no gain has.

    With one output a scaled sensor and a wrong gain are the same thing; so are a scaled input and its gain.
    """
    rules = in_force().hypotheses
    result = []
    for j, name in enumerate(site.output_names):
        if len(site.output_names) > 1:
            result.append(_any_factor(j, name, _is_clear(site, j), likeness(site)[j][0] > rules.unit_correlation))
        else:
            result += [_unit(f"sensor_unit_{j + 1}_{k + 1}", name, "sensor", *form) for k, form in enumerate(_UNITS)]
    for i, name in enumerate(site.input_names):
        result += [_unit(f"input_unit_{i + 1}_{k + 1}", name, "input", *form) for k, form in enumerate(_UNITS)]
    return result


def _credible(values: Mapping[str, float]) -> str:
    """Refuse a factor that is neither a gauge's tolerance nor, within a tenth, a ratio of units."""
    close, unit, factor = in_force().hypotheses.unit_tolerance, in_force().data.unit_ratio, abs(values["factor"])
    known = any(abs(factor * r - 1) < close or abs(factor / r - 1) < close for r, _ in RATIOS)
    if known or 1 / unit < factor < unit:
        return ""
    return f"a factor of {factor:.3g} is neither a gauge's tolerance nor a ratio of units"


def _ratios(low: float, high: float) -> list[float]:
    return [r for ratio, _ in RATIOS for r in (ratio, 1 / ratio) if low < r < high]


def _is_clear(site: Site, j: int) -> bool:
    """Tell whether a free run resembles the output in all but size: a fitted baseline may hide that from the scores."""
    alike, ratio = likeness(site)[j]
    unit = in_force().data.unit_ratio
    return bool(alike > in_force().hypotheses.unit_correlation and (ratio > unit or ratio < 1 / unit))


def _any_factor(j: int, name: str, clear: bool, alike: bool) -> Attachment:
    """Return the hypothesis of any factor; where the output does not resemble the model's, only of a credible one."""
    factor = f"sensor_scale_{j + 1}"
    low = -1e-5 * _LARGEST  # below zero, so that a thousandth is not the end of the range

    def edit(model: Equations) -> Equations:
        added = Parameter(factor, 1.0, "1", low, _LARGEST)
        return with_reading(model, name, f"{factor}*reading", (added,), slope=f"1/max({factor}, 1e-6)")

    return Attachment(
        "sensor_scale", f"sensor_scale output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(factor, "factor", "1", 1.0, low, _LARGEST, 1e-3),),
        starts=({}, *({factor: r} for r in _ratios(low, _LARGEST))),
        equation=f"{name}_recorded = factor*{name}",
        statement=partial(_statement, name, "sensor"),
        always_fit=clear,
        credible=(lambda values: "") if alike else _credible,
    )  # fmt: skip


def _unit(tag: str, name: str, what: str, words: str, low: float, high: float) -> Attachment:
    """Blend a factor in by a share; the bank tries the mildest known ratio, the fit all of them."""
    share, ratios = f"{tag}_share", sorted(_ratios(low, high), key=lambda r: abs(math.log(r)))
    parameters = (Parameter(tag, ratios[0], "1", low, high), Parameter(share, 0.0, "", 0.0, 1.0))
    is_sensor = what == "sensor"

    def edit(model: Equations) -> Equations:
        if not is_sensor:
            return with_filter(model, name, "input_scale", parameters)
        return with_reading(model, name, f"reading*(1 + {share}*({tag} - 1))", parameters)

    where = location(f"output:{name}", outputs=(name,)) if is_sensor else location(f"input:{name}", inputs=(name,))
    return Attachment(
        "sensor_scale", f"sensor_scale {where['entry']}{words}", where, edit,
        (Slot(tag, "factor", "1", ratios[0], low, high, 1e-3, local=False),
         Slot(share, None, "", 0.0, 0.0, 1.0, 1e-3)),
        fixed={share: 1.0}, grid=({tag: ratios[0]},), starts=tuple({tag: r} for r in ratios), share=share,
        equation=f"{name}_recorded = factor*{name}" if is_sensor else f"{name}_acting = factor*{name}_recorded",
        statement=partial(_statement, name, what),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_scale",
    family="sensor_nonlinearity",
    name="wrong scale or unit of a channel",
    equation="y_recorded = factor*y",
    source="Doebelin 2004, Measurement Systems, chapter 3 (static calibration); ratios of units from ISO 80000",
    quantities=(Quantity("factor", "1", 1 / _LARGEST, _LARGEST, 1.0, "recorded over true"),),
    attaches_to="every output where there are two or more; else, and to inputs, only with factors no gain is off by",
    signature="one output is larger or smaller by a constant factor at every frequency and for every input",
    confused_with=(
        ("parameter_error", "one input to all outputs (gain) against all inputs to one output (scale)"),
        ("sensor_sign", "direction"),
    ),
    attach=_attach,
    rank=260,
    turns=True,
)
