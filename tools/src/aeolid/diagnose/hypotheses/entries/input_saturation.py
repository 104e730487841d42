"""A drive that cannot go beyond certain values."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    ROSCO,
    Setting,
    given,
)
from aeolid.diagnose.hypotheses.parts.wiring import Array, blended_filter, is_continuous, unit_of_input

_GRID = (0.97, 0.85)  # quantiles of the input where a limit is tried; 1 − q below
_STARTS = (0.99, 0.95, 0.9, 0.8, 0.7, 0.5, 0.3)
_STRONGEST = 0.15  # quantile of the input that an upper limit reaches down to; 1 − q for a lower one
_BEYOND, _REACH = 0.05, 0.1  # of the recorded range: where a limit that never acts stands, where its range ends


def _statement(name: str, unit: str, ends: tuple[float, float], v: Mapping[str, float]) -> str:
    acting = []
    if v["low"] > ends[0]:
        acting.append(f"below {v['low']:.4g}")
    if v["high"] < ends[1]:
        acting.append(f"above {v['high']:.4g}")
    return f"{name} does not get {' or '.join(acting) or 'beyond its range'} {unit}".rstrip() + ": the drive saturates"


def _attach(site: Site) -> list[Attachment]:
    return [a for i in range(len(site.input_names)) for a in _on(site, i)]


def _on(site: Site, i: int) -> list[Attachment]:
    u = site.u[:, i]
    bottom, top = float(u.min(initial=np.inf)), float(u.max(initial=-np.inf))
    if not top > bottom or not is_continuous(u):
        return []
    name, unit, width = site.input_names[i], unit_of_input(site, i), top - bottom
    low, high = f"input_low_{i + 1}", f"input_high_{i + 1}"
    deepest, highest = (float(q) for q in np.quantile(u, (_STRONGEST, 1 - _STRONGEST)))
    slots = (
        Slot(low, "low", unit, bottom - _BEYOND * width, bottom - _REACH * width, highest, 0.01 * width, local=False),
        Slot(high, "high", unit, top + _BEYOND * width, deepest, top + _REACH * width, 0.01 * width, local=False),
    )
    return [
        blended_filter(
            site, i, "input_saturation", slots, entry="input_saturation", grid=_limits(u, _GRID, low, high),
            starts=({}, *_limits(u, _STARTS, low, high)),
            equation=f"{name}_actual = min(max({name}, low), high)",
            statement=partial(_statement, name, unit, (bottom, top)),
        )
    ]  # fmt: skip


def _limits(u: Array, quantiles: tuple[float, ...], low: str, high: str) -> list[dict[str, float]]:
    """List limits from mild to strong: above only, below only, both; an idle limit stands beyond the range."""
    bottom, top = float(u.min()), float(u.max())
    beyond = _BEYOND * (top - bottom)
    result = []
    for q in quantiles:
        upper = min(float(np.quantile(u, q)), top - beyond / 5)
        lower = max(float(np.quantile(u, 1 - q)), bottom + beyond / 5)
        pairs = ((bottom - beyond, upper), (lower, top + beyond), (lower, upper))
        result += [{low: a, high: b} for a, b in pairs if a < b]
    return result


ENTRY = Entry(
    id="input_saturation",
    family="input_nonlinearity",
    name="saturated drive",
    equation="u_actual = min(max(u, low), high)",
    source="Tarbouriech et al. 2011, Stability and Stabilization of Linear Systems with Saturating Actuators",
    quantities=(
        Quantity("low", "unit of the input", -1e9, 1e9, float("-inf"), "lowest value"),
        Quantity("high", "unit of the input", -1e9, 1e9, float("inf"), "highest value"),
    ),
    attaches_to="every input that takes many values",
    signature="the response stops growing beyond a certain command; small commands act in full",
    confused_with=(
        ("rate_limit", "a slow large command: saturation cuts it off, a rate limit lets it through"),
        ("parameter_error", "small commands: a wrong gain shows there too"),
    ),
    attach=_attach,
    rank=80,
    settings=(
        Setting(
            OPENFAST,
            "no switch: ServoDyn only tells Ptch_Min and Ptch_Max to a controller library; limit the demand there",
            at=DRIVES_PITCH,
        ),
        Setting(ROSCO, "PC_MinPit, PC_MaxPit", at=DRIVES_PITCH),
        Setting(BLADED, "Pitch actuator: angle limits", at=DRIVES_PITCH),
        Setting(OPENFAST, "no switch: limit the demand in the controller library", at=DRIVES_TORQUE),
        Setting(ROSCO, "VS_MinTq, VS_MaxTq", at=DRIVES_TORQUE),
        Setting(BLADED, "Generator: minimum and maximum torque demand", at=DRIVES_TORQUE),
        *given(
            "cut what the run is given to {low:.3g} to {high:.3g} (in its unit)",
            "cut what the run is given to its range",
        ),
    ),
)
