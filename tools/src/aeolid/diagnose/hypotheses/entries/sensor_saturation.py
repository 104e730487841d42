"""A sensor that stops at the end of its range."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.range_ends import rails
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE, is_continuous, unit_of_output, with_reading
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

Array = NDArray[np.float64]
_REACH = 0.05  # of the recorded range: how far a limit may lie from the rail that is seen


def _statement(name: str, unit: str, held: Mapping[str, float], values: Mapping[str, float]) -> str:
    """Say both ends of the range; held: by label, those that other data than the fitted show."""
    v = {**held, **values}
    ends = [f"{'above' if k == 'high' else 'below'} {v[k]:.4g} {unit}".rstrip() for k in ("low", "high") if k in v]
    return f"the {name} sensor shows nothing {' or '.join(ends)}: it is at the end of its range"


def _attach(site: Site) -> list[Attachment]:
    """Attach where values pile up at an end of the recorded range, be it reached in data that are not fitted alone.

    A range has two ends: with the lower one fitted, data that reached the upper one refuted all of it (−1,445 nats).
    """
    result = []
    for j, name in enumerate(site.output_names):
        y = site.y[:, j][np.isfinite(site.y[:, j])]
        ends = (site.rails[j] if site.rails else rails(y)) if is_continuous(y) else {}
        if ends:
            result.append(_on(site, j, name, ends, y))
    return result


def _on(site: Site, j: int, name: str, ends: Mapping[str, float], y: Array) -> Attachment:
    """Return the range of one output; an end that the fitted data y (N,) do not reach stays where it is seen.

    Free, it moved to where a few of them touch it, for a nat, and was refuted where it is reached (−263 nats).
    """
    rules = in_force().hypotheses
    width = float(np.ptp(y))
    out_of_reach = {"low": float(y.min()) > ends.get("low", np.inf) + rules.rail_distance * width,
                    "high": float(y.max()) < ends.get("high", -np.inf) - rules.rail_distance * width}  # fmt: skip
    share, unit = f"sensor_rail_share_{j + 1}", unit_of_output(site, name)
    limits = {side: f"sensor_{side}_{j + 1}" for side in ends}
    slots = [
        Slot(limits[side], side, unit, rail, rail - _REACH * width, rail + _REACH * width, 0.01 * width, local=False)
        for side, rail in ends.items()
    ]
    clipped, outside = "reading", []
    if "low" in limits:
        clipped, outside = f"max({clipped}, {limits['low']})", [f"sign({limits['low']} - reading)"]
    if "high" in limits:
        clipped, outside = f"min({clipped}, {limits['high']})", [*outside, f"sign(reading - {limits['high']})"]
    held = {limits[side]: rail for side, rail in ends.items() if out_of_reach[side]}
    fixed = {share: 1.0} | (held if len(held) < len(ends) else {})  # of what is reached nowhere nothing is known
    seen = {side: rail for side, rail in ends.items() if limits[side] in fixed}
    parameters = (*(Parameter(s.name, s.null, unit, s.low, s.high) for s in slots), Parameter(share, 0.0, "", 0.0, 1.0))

    def edit(model: Equations) -> Equations:
        form = f"reading + {share}*({clipped} - reading)"
        return with_reading(model, name, form, parameters, slope=f"1 - {share}*max({', '.join(['0', *outside])})")

    return Attachment(
        "sensor_saturation", f"sensor_saturation output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (*slots, Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE)),
        shown=True, fixed=fixed, grid=({limits[side]: rail for side, rail in ends.items()},), share=share,
        equation=f"{name}_recorded = min(max({name}, low), high)",
        statement=partial(_statement, name, unit, seen),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_saturation",
    family="sensor_nonlinearity",
    name="saturated sensor",
    equation="y_recorded = min(max(y, low), high)",
    source="Doebelin 2004, Measurement Systems, chapter 3 (range and overload)",
    quantities=(
        Quantity("low", "unit of the output", -1e12, 1e12, float("-inf"), "lowest value shown"),
        Quantity("high", "unit of the output", -1e12, 1e12, float("inf"), "highest value shown"),
    ),
    attaches_to="every output whose values pile up at an end of their range",
    signature="the same extreme value many times in a row, while everything else goes on",
    confused_with=(
        ("end_stop", "other outputs: at an end stop they feel the blow, behind a saturated sensor they go on"),
        ("sensor_rectified", "a sensor clipped at zero stays there, a rectified one rises again"),
    ),
    attach=_attach,
    rank=240,
)
