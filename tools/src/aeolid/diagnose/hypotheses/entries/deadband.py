"""A drive that ignores small commands: around zero, or around where it stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    ROSCO,
    Setting,
    given,
)
from aeolid.diagnose.hypotheses.parts.wiring import blended_filter, commanded, is_continuous, spread_of, unit_of_input
from aeolid.diagnose.rules import in_force

_GRID = (0.15, 0.4, 1.0)  # of the input's spread
_STARTS = 24


def _hold(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"{name} stays where it is until the command has moved by {v['width']:.3g} {unit} (a dead band)".replace(
        "  ", " "
    )


def _zone(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"{name} has no effect within ±{v['width']:.3g} {unit} of zero (a dead zone)".replace("  ", " ")


def _attach(site: Site) -> list[Attachment]:
    return [a for i in range(len(site.input_names)) for a in _on(site, i)]


def _on(site: Site, i: int) -> list[Attachment]:
    rules = in_force().hypotheses
    u = site.u[:, i]
    spread = spread_of(u)
    sizes = np.unique(np.abs(u[u != 0]))
    if spread <= 0 or len(sizes) < rules.deadband_levels:
        return []
    name, unit = site.input_names[i], unit_of_input(site, i)
    result, forms = [], []
    if is_continuous(u) and i in commanded(site):
        forms += [("deadband", _hold, f"{name}_actual holds until |{name} - {name}_actual| > width", "")]
    if rules.crossing_share < float(np.mean(u > 0)) < 1 - rules.crossing_share:
        equation = f"{name}_actual = sign({name})*max(|{name}| - width, 0)"
        forms.append(("dead_zone", _zone, equation, ", around zero"))
    for kind, statement, equation, form in forms:
        width = f"{kind}_width_{i + 1}"
        slot = Slot(width, "width", unit, 0.0, 0.0, 4 * spread, 0.01 * spread, local=False, jumps=kind == "deadband")
        hypothesis = blended_filter(
            site, i, kind, (slot,), entry="deadband", form=form,
            grid=[{width: share * spread} for share in _GRID],
            starts=({}, *({width: float(w)} for w in spread * np.geomspace(0.04, 2.0, _STARTS))),
            equation=equation, statement=partial(statement, name, unit),
        )  # fmt: skip
        # a narrow zone takes a constant from large commands: a free friction or rest absorbs it, and with it the score
        result.append(replace(hypothesis, stepped=kind == "dead_zone"))
    return result


ENTRY = Entry(
    id="deadband",
    family="input_nonlinearity",
    name="dead band",
    equation="u_actual = sign(u)*max(|u| - width, 0), or u_actual holds until |u - u_actual| > width",
    source="Tao and Kokotović 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    quantities=(Quantity("width", "unit of the input", 0.0, 1e9, 0.0, "largest command without effect"),),
    attaches_to="every input that takes many values, the hold not of measured disturbances; around zero where it"
    " comes back to it, from four sizes or more",
    signature="small commands do nothing, large ones act in full (hold) or less the width (zone)",
    confused_with=(
        ("backlash", "a dead zone has no memory; behind backlash the way down lags the way up by the width"),
        ("input_quantisation", "quantisation has levels that return, a hold stops at any value"),
    ),
    attach=_attach,
    rank=90,
    settings=(
        Setting(
            OPENFAST,
            "no switch: pass the demand through a dead band of {width:.3g} (in its unit) between controller library"
            " and ServoDyn",
            "no switch: pass the demand through a dead band between controller library and ServoDyn",
            at=DRIVES,
        ),
        Setting(
            ROSCO,
            "no switch: hold the demand until it has moved by {width:.3g} (in its unit)",
            "no switch: hold the demand in a band",
            at=DRIVES,
        ),
        Setting(
            BLADED,
            "Pitch actuator in an external library, with a dead band of {width:.3g}",
            "Pitch actuator in an external library, with a dead band",
            at=DRIVES_PITCH,
        ),
        Setting(
            BLADED,
            "no switch: hold the torque demand in the external controller until it has moved by {width:.3g} (in its"
            " unit)",
            "no switch: hold the torque demand in a band in the external controller",
            at=DRIVES_TORQUE,
        ),
        *given(
            "hold what the run is given until it has moved by {width:.3g} (in its unit)",
            "hold what the run is given in a band",
        ),
    ),
)
