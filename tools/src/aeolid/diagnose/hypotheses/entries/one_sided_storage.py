"""A store that cannot be emptied below its floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.storage import Store, stores
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

_FLOORS = (0.05, 0.15, 0.3, 0.5)  # of the level that is seen
_LOW = (0.002, 0.05)  # quantiles of the level itself where it is measured


def _attach(site: Site) -> list[Attachment]:
    return [_on(site, store, i) for i, store in enumerate(stores(site))]


def _on(site: Site, store: Store, number: int) -> Attachment:
    tag, name, unit = f"floor_{number + 1}", store.state.name, store.state.unit
    blend, floor = f"{tag}_share", f"{tag}_level"
    top, fast, lowest = store.level, site.step, _lowest(site, name)
    slots = (
        Slot(blend, None, "1", 0.0, 0.0, 1.0, 1e-2),
        Slot(floor, "floor_level", unit, 0.0, -top, top, 0.1 * top, local=False),
    )

    def edit(model: Equations) -> Equations:
        hold = ex.parse(f"{blend}*max({floor} - {name}, 0)/{fast!r}", "floor")
        states = tuple(
            replace(s, derivative=ex.combine("+", s.derivative, hold)) if s.name == name else s for s in model.states
        )
        return with_parameters(replace(model, states=states), slots)

    return Attachment(
        "one_sided_storage", f"one_sided_storage state:{name}", location(f"state:{name}"), edit, slots,
        fixed={blend: 1.0}, share=blend, grid=tuple({floor: f} for f in (*(f * top for f in _FLOORS), *lowest)),
        starts=({}, *({floor: f} for f in lowest)),
        equation=f"{name} falls no lower than floor_level",
        statement=lambda v: (
            f"{name} cannot fall below {v['floor_level']:.3g} {unit}: the store gives no more than it holds;"
            " the model lets it fall"
        ),
    )  # fmt: skip


def _lowest(site: Site, name: str) -> tuple[float, ...]:
    """Return the lowest levels seen, where an output reads the store itself: a floor lies nowhere else."""
    seen = [j for j, o in enumerate(site.model.outputs) if ex.to_text(o.equation) == name]
    return tuple(float(np.nanquantile(site.y[:, j], q)) for j in seen[:1] for q in _LOW)


ENTRY = Entry(
    id="one_sided_storage",
    family="storage",
    name="one-sided storage",
    equation="h' = ... + max(floor_level - h, 0)/step",
    source="Filippov 1988, Differential Equations with Discontinuous Right-hand Sides (sliding at a boundary)",
    quantities=(Quantity("floor_level", "the store's own", -1e6, 1e6, float("nan"), "level it cannot fall below"),),
    attaches_to="every store: a level guarded against running dry, or in a unit of level or volume, that empties",
    signature="after a long outflow the level answers the next inflow at once instead of refilling a debt",
    confused_with=(
        ("overflow", "at the floor against at the brim"),
        ("sensor_saturation", "a sensor at its end hides the level, the store behind it goes on falling"),
    ),
    attach=_attach,
    rank=600,
)
