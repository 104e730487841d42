"""A sensor, or the filter before its logger, that answers as a damped second-order system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.entries.actuator_second_order import HIGHEST_DAMPING, LOWEST_DAMPING, rate_of
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.following import (
    AT_NULL,
    SHORTEST,
    Filter,
    apart,
    following,
    is_possible,
    memories_of,
)
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.wiring import with_reading
from aeolid.models.equations import Equations, Parameter

_SHORTEST, _AVERAGED = 0.02, 0.25  # rows: as a lag of first order; beyond the Nyquist rate nothing tells the two apart
_ROWS = (1.0, 3.0, 10.0)  # rows: periods that the bank scores
_EQUATION = "m'' = omega_rad_s^2*({name} - m) - 2*damping*omega_rad_s*m', m is measured in place of {name}"
_STARTS = tuple((period, zeta) for period in (0.7, 1.5, 3.0, 6.0, 12.0) for zeta in (0.5, 0.85))  # rows, 1


def _statement(name: str, v: Mapping[str, float]) -> str:
    return (
        f"the {name} sensor (or its filter) responds as a second-order system of {v['omega_rad_s']:.3g} rad/s with"
        f" damping {v['damping']:.2g}; in the model it responds at once"
    )


def _attach(site: Site) -> list[Attachment]:
    longest = len(site.y) * site.row_step / 20
    found = [_on(site, j, longest) for j in range(len(site.output_names))]
    slow = [_slow(site, j, longest) for j in range(len(site.output_names))] if is_possible(site) else []
    return found + slow


def _slow(site: Site, j: int, longest: float) -> Attachment:
    name, tag, row = site.output_names[j], f"sensor_slow2_{j + 1}", site.row_step
    inverse, zeta = f"{tag}_inverse_omega", f"{tag}_damping"
    slots = (
        Slot(inverse, "omega_rad_s", "rad/s", AT_NULL * row, SHORTEST * row, longest, row, local=False, show=rate_of),
        Slot(zeta, "damping", "1", 0.7, LOWEST_DAMPING, HIGHEST_DAMPING, 0.05, local=False),
    )
    grid = tuple({inverse: n * row, zeta: 0.7} for n in _ROWS if n * row < longest)
    starts = tuple({inverse: p * row, zeta: z} for p, z in _STARTS)
    found = following(
        site, j, tag, Filter(inverse, zeta, slots, grid, ({}, *starts)), entry="sensor_second_order",
        key=f"sensor_second_order output:{name}, in states", where=location(f"output:{name}", outputs=(name,)),
        equation=_EQUATION.format(name=name), statement=partial(_statement, name),
    )  # fmt: skip
    return replace(found, beside={inverse: _AVERAGED * row}, credible=later_than_a_reading(row, "sensor_second_order"))


def _on(site: Site, j: int, longest: float) -> Attachment:
    name, step, tag = site.output_names[j], site.row_step, f"sensor_order2_{j + 1}"
    states = apart(site, j, f"{tag}_apart", f"{tag}_apart_rate")
    inverse, zeta = f"{tag}_inverse_omega", f"{tag}_damping"
    parameters = (
        Parameter(inverse, 0.0, "s", 0.0, longest),
        Parameter(zeta, 0.7, "1", LOWEST_DAMPING, HIGHEST_DAMPING),
    )

    def edit(model: Equations) -> Equations:
        model = replace(model, states=(*model.states, *states))
        return with_reading(model, name, tag, parameters, memories=memories_of(tag, inverse, zeta, states))

    return Attachment(
        "sensor_second_order", f"sensor_second_order output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(inverse, "omega_rad_s", "rad/s", 0.0, _SHORTEST * step, longest, 0.3 * step, show=rate_of),
         Slot(zeta, "damping", "1", 0.7, LOWEST_DAMPING, HIGHEST_DAMPING, 0.05, local=False)),
        start_states=tuple(s.name for s in states), stepped=True, beside={inverse: _AVERAGED * step},
        starts=tuple({inverse: p * step, zeta: z} for p, z in _STARTS),
        equation=_EQUATION.format(name=name),
        statement=partial(_statement, name), credible=later_than_a_reading(step, "sensor_second_order"),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_second_order",
    family="sensor_dynamics",
    name="second-order sensor or filter",
    equation="m'' = omega_rad_s^2*(y - m) - 2*damping*omega_rad_s*m'",
    source="Gaertner et al. 2020 (IEA 15 MW: speed filter 1.008 rad/s, damping 0.7); Doebelin 2004, chapter 3",
    quantities=(
        Quantity("omega_rad_s", "rad/s", 0.1, 1000.0, float("inf"), "natural frequency"),
        Quantity("damping", "1", LOWEST_DAMPING, HIGHEST_DAMPING, 0.7, "damping ratio"),
    ),
    attaches_to="every output",
    signature="phase and, above omega, gain fall in one output, alike for every input and disturbance",
    confused_with=(
        ("actuator_second_order", "one input to all outputs (actuator) against all inputs to one output (sensor)"),
        ("sensor_lag", "excitation above omega: the gain falls by 12 dB an octave, behind a lag by 6 dB"),
    ),
    attach=_attach,
    rank=60,
    turns=True,
    without_ringing="sensor_lag",
)
