"""A channel whose numbers are a constant factor off: a wrong calibration, or another unit than stated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from aeolid.diagnose.catalogue.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.catalogue.wiring import with_filter, with_reading
from aeolid.diagnose.forensics import RATIOS, ratio_text
from aeolid.models.equations import Equations, Parameter

_LARGEST = 2e6
_UNITS_ONLY = 3.0  # from here on a factor is no tolerance of a gain


def _statement(name: str, what: str, v: Mapping[str, float]) -> str:
    factor = v["factor"]
    verb = "shows" if what == "sensor" else "acts with"
    return f"the {name} {what} {verb} {factor:.4g} times what the model has{ratio_text(factor)}"


def _attach(site: Site) -> list[Attachment]:
    """Offer any factor on an output where another output shows the truth; elsewhere only ratios that no gain has.

    With one output a scaled sensor and a wrong gain are the same thing; so are a scaled input and its gain.
    """
    result = []
    whole = ("", 1 / _LARGEST, _LARGEST, 1 / _LARGEST, _LARGEST)
    parts = ((", larger unit", 1.0, _LARGEST, _UNITS_ONLY, _LARGEST),
             (", smaller unit", 1 / _LARGEST, 1.0, 1 / _LARGEST, 1 / _UNITS_ONLY))  # fmt: skip
    for j, name in enumerate(site.output_names):
        for k, form in enumerate((whole,) if len(site.output_names) > 1 else parts):
            factor = f"sensor_scale_{j + 1}_{k + 1}"

            def read(model: Equations, name: str = name, factor: str = factor, form: _Form = form) -> Equations:
                added = Parameter(factor, 1.0, "1", form[1], form[2])
                return with_reading(model, name, f"{factor}*reading", (added,))

            result.append(_hypothesis(name, "sensor", form, read, factor))
    for i, name in enumerate(site.input_names):
        for k, form in enumerate(parts):
            factor = f"input_scale_{i + 1}_{k + 1}"

            def act(model: Equations, name: str = name, factor: str = factor, form: _Form = form) -> Equations:
                return with_filter(model, name, "input_scale", (Parameter(factor, 1.0, "1", form[1], form[2]),))

            result.append(_hypothesis(name, "input", form, act, factor))
    return result


_Form = tuple[str, float, float, float, float]  # words, range of the parameter, range that is accepted


def _hypothesis(
    name: str, what: str, form: _Form, edit: Callable[[Equations], Equations], factor: str
) -> Attachment:  # fmt: skip
    words, low, high = form[0], form[3], form[4]
    where = (
        location(f"output:{name}", outputs=(name,)) if what == "sensor" else location(f"input:{name}", inputs=(name,))
    )
    ratios = [r for ratio, _ in RATIOS for r in (ratio, 1 / ratio) if low < r < high]
    return Attachment(
        "sensor_scale", f"sensor_scale {where['entry']}{words}", where, edit,
        (Slot(factor, "factor", "1", 1.0, low, high, 1e-3),),
        starts=({}, *({factor: r} for r in ratios)),
        equation=f"{name}_recorded = factor*{name}" if what == "sensor" else f"{name}_acting = factor*{name}_recorded",
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
)
