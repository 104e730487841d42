"""A sensor whose zero moves with time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.imitation import imitated_by_forces
from aeolid.diagnose.hypotheses.parts.wiring import spread_of, unit_of_output, with_reading
from aeolid.models.equations import Equations, Parameter


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"the zero of the {name} sensor drifts by {v['rate_per_s']:+.3g} {unit}"


def _attach(site: Site) -> list[Attachment]:
    """Offer a drift where no slow force could do the same; elsewhere say that it cannot be tested."""
    clock = next((k for k, e in enumerate(site.exogenous) if e.role == "time"), None)
    if clock is None:
        return []
    result = []
    for j, name in enumerate(site.output_names):
        if imitated_by_forces(site)[j]:
            where = location(f"output:{name}", outputs=(name,))
            result.append(Attachment("sensor_drift", f"sensor_drift output:{name}", where, lambda m: m, ()))
        else:
            result.append(_on(site, j, name, clock))
    return result


def _on(site: Site, j: int, name: str, clock: int) -> Attachment:
    rate, symbol = f"sensor_drift_{j + 1}", site.exogenous[clock].symbol
    unit = f"{unit_of_output(site, name) or '1'}/s"
    times = site.extra[:, clock]
    start = float(np.min(times))  # a sensor is right when it is set, and drifts from there
    size = spread_of(site.y[:, j]) / max(float(np.ptp(times)), site.step)

    def edit(model: Equations) -> Equations:
        added = Parameter(rate, 0.0, unit, -100 * size, 100 * size)
        return with_reading(model, name, f"reading + {rate}*({symbol} - {start!r})", (added,))

    return Attachment(
        "sensor_drift", f"sensor_drift output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(rate, "rate_per_s", unit, 0.0, -100 * size, 100 * size, 1e-2 * size),),
        equation=f"{name}_recorded = {name} + rate_per_s*(time - {start:.6g} s)",
        statement=partial(_statement, name, unit),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_drift",
    family="sensor_nonlinearity",
    name="drifting sensor",
    equation="y_recorded = y + rate_per_s*(time - t0)",
    source="Doebelin 2004, Measurement Systems, chapter 3 (zero drift)",
    quantities=(Quantity("rate_per_s", "unit of the output/s", -1e9, 1e9, 0.0, "drift of the zero"),),
    attaches_to="outputs that no slow force could move alone; elsewhere it cannot be tested",
    signature="a difference that grows steadily and contradicts the other outputs",
    confused_with=(
        ("sensor_bias", "a bias is there from the start and stays"),
        ("temperature_dependence", "a recorded temperature explains the difference better than time"),
    ),
    attach=_attach,
    rank=300,
)
