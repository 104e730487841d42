"""Find the inputs that turn the blades and put slow or partial responses in their path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.models.equations import Equations, InputFilter, Parameter

_ANGLES = {"deg", "rad", "°", "degree", "degrees"}


def pitch_inputs(site: Site) -> list[int]:
    """List the inputs of a wind turbine that are blade pitch: by name, in deg or rad (or without a unit)."""
    units = [s.unit.strip() for s in site.model.inputs]
    return [
        i
        for i, n in enumerate(site.input_names)
        if is_turbine(site.context) and rotor.looks_like("pitch", n) and (not units[i] or units[i] in _ANGLES)
    ]


def lead_lag(
    site: Site, entry: str, *, gain: tuple[str, float, float], tau: tuple[float, float], grid: tuple[float, ...],
    equation: str, says: Callable[[str, Mapping[str, float]], str], show: Callable[[float], float] = float,
    kind: str = "lead_lag", form: str = "",
) -> list[Attachment]:  # fmt: skip
    """Offer u + gain (u − lag(u, tau)) on every pitch input.

    gain: (label, low, high), null 0; kind of input filter; form: what tells one of several forms of an entry apart.
    """
    result = []
    for i in pitch_inputs(site):
        name = site.input_names[i]
        names = (f"{entry}{form}_tau_{i + 1}", f"{entry}{form}_gain_{i + 1}")
        times = Slot(names[0], "tau_s", "s", tau[0], tau[0], tau[1], 0.3 * tau[0], local=False)
        part = Slot(names[1], gain[0], "1", 0.0, gain[1], gain[2], 1e-3, show=show)
        result.append(
            Attachment(
                entry, " ".join(w for w in (entry, form.strip("_"), f"input:{name}") if w),
                location(f"input:{name}", inputs=(name,)),
                partial(_filtered, name, kind, (part, times), grid[0]), (part, times),
                grid=tuple({names[0]: t} for t in grid), starts=({}, {names[1]: 0.3 * (gain[1] + gain[2])}),
                equation=equation, statement=partial(says, name), stepped=True,
            )
        )  # fmt: skip
    return result


def _filtered(name: str, kind: str, slots: tuple[Slot, Slot], start: float, model: Equations) -> Equations:
    part, times = slots
    extra = (
        Parameter(times.name, start, "s", times.low, times.high),
        Parameter(part.name, 0.0, "", part.low, part.high),
    )
    added = InputFilter(name, kind, (times.name, part.name))
    return replace(model, parameters=(*model.parameters, *extra), filters=(*model.filters, added))
