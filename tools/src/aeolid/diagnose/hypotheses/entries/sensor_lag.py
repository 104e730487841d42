"""A sensor that follows what it measures with a first-order lag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.following import AT_NULL, SHORTEST, Filter, apart, following, is_possible
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.settings import BLADED, ROSCO, Setting
from aeolid.diagnose.hypotheses.parts.wiring import with_reading
from aeolid.models.equations import STEP, Equations, Parameter

_SHORTEST = 0.02  # rows: below, the straight line between two rows errs as much
_AVERAGED = 0.5  # rows: what counts or averages over a row is that late by itself; no further effect beside another

_ROWS = (1.0, 3.0, 10.0, 30.0)  # rows: time constants that the bank scores
_EQUATION = "d({name}_measured)/dt = ({name} - {name}_measured)/tau_s"


def _statement(name: str, v: Mapping[str, float]) -> str:
    return f"the {name} sensor (or its filter) has a first-order lag of {v['tau_s']:.3g} s that the model leaves out"


def _attach(site: Site) -> list[Attachment]:
    longest = len(site.y) * site.row_step / 4
    found = [_on(site, j, longest) for j in range(len(site.output_names))]
    slow = [_slow(site, j, longest) for j in range(len(site.output_names))] if is_possible(site) else []
    return found + slow


def _slow(site: Site, j: int, longest: float) -> Attachment:
    name, tau, row = site.output_names[j], f"sensor_slow_{j + 1}_tau", site.row_step
    slot = Slot(tau, "tau_s", "s", AT_NULL * row, SHORTEST * row, longest, row, local=False)
    grid = tuple({tau: n * row} for n in _ROWS if n * row < longest)
    found = following(
        site, j, f"sensor_slow_{j + 1}", Filter(tau, None, (slot,), grid, ({}, *grid)), entry="sensor_lag",
        key=f"sensor_lag output:{name}, in states", where=location(f"output:{name}", outputs=(name,)),
        equation=_EQUATION.format(name=name), statement=partial(_statement, name),
    )  # fmt: skip
    return replace(found, beside={tau: _AVERAGED * row}, credible=later_than_a_reading(row, "sensor_lag"))


def _on(site: Site, j: int, longest: float) -> Attachment:
    """Replace the output by tau m' = y − m, y running straight from one row to the next (first-order hold).

    Over one row m goes to y − tau s + (m₀ − y₀ + tau s) e^(−h/tau), s the slope (y − y₀)/h: linear in tau at 0.
    m starts apart from y, where states can be added.
    """
    name, step, tag = site.output_names[j], site.row_step, f"sensor_lag_{j + 1}"
    tau, now, before = f"{tag}_tau", f"{tag}_now", f"{tag}_before"
    slope = f"{tau}*({now} - {before})/{STEP}"
    decay = f"exp(-{STEP}/max({tau}, 1e-9*{STEP}))"
    states = apart(site, j, f"{tag}_apart")
    memories = (
        (before, now, "reading"),
        (now, "reading", "reading"),
        (
            tag,
            f"{now} - {slope} + ({tag} - {before} + {slope})*{decay}",
            f"{now} + {states[0].name}" if states else now,
        ),
    )

    def edit(model: Equations) -> Equations:
        model = replace(model, states=(*model.states, *states))
        return with_reading(model, name, tag, (Parameter(tau, 0.0, "s", 0.0, longest),), memories=memories)

    return Attachment(
        "sensor_lag", f"sensor_lag output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(tau, "tau_s", "s", 0.0, _SHORTEST * step, longest, 0.3 * step),),
        start_states=tuple(s.name for s in states), stepped=True, beside={tau: _AVERAGED * step},
        starts=({}, {tau: step}, {tau: 5 * step}, {tau: 20 * step}),
        equation=_EQUATION.format(name=name),
        statement=partial(_statement, name), credible=later_than_a_reading(step, "sensor_lag"),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_lag",
    family="sensor_dynamics",
    name="first-order sensor lag",
    equation="d(y_measured)/dt = (y - y_measured)/tau_s",
    source="Doebelin 2004, Measurement Systems, chapter 3; first-order hold between samples",
    quantities=(Quantity("tau_s", "s", 0.0, 60.0, 0.0, "time constant"),),
    attaches_to="every output",
    signature="phase falls and gain droops above 1/tau_s in one output, alike for every input and disturbance",
    confused_with=(
        ("actuator_lag", "one input to all outputs (actuator) against all inputs to one output (sensor)"),
        ("sensor_second_order", "excitation above 1/tau_s: the gain falls by 6 dB an octave, not by 12"),
    ),
    attach=_attach,
    rank=50,
    turns=True,
    settings=(
        Setting(
            ROSCO,
            (
                "for a speed: F_LPFCornerFreq = {corner_rad_s:.3g} rad/s with F_LPFType = 1; else filter"
                " the simulation's output by {tau_s:.3g} s"
            ),
            "for a speed: F_LPFCornerFreq with F_LPFType = 1; else filter the simulation's output",
        ),
        Setting(BLADED, "Transducers: first order lag {tau_s:.3g} s", "Transducers: first order lag"),
    ),
)
