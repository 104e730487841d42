"""A tank that runs over: what rises above its brim leaves, some of it into the next tank."""

from __future__ import annotations

import ast
from dataclasses import replace

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.storage import Store, stores
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations

_BRIMS = (1.5, 1.25, 1.0, 0.85, 0.7, 0.5)  # of the level that is seen


def _attach(site: Site) -> list[Attachment]:
    return [_on(site, store, i) for i, store in enumerate(stores(site))]


def _on(site: Site, store: Store, number: int) -> Attachment:
    tag, name, unit = f"overflow_{number + 1}", store.state.name, store.state.unit
    blend, brim, slow, into = (f"{tag}_{what}" for what in ("share", "level", "time", "into_next"))
    top, fast = store.level, 0.5 * site.step  # half a sample: the fastest that the integration follows
    slots = [
        Slot(blend, None, "1", 0.0, 0.0, 1.0, 1e-2),
        Slot(brim, "brim_level", unit, top, 0.1 * top, 5 * top, 0.1 * top, local=False),
        Slot(slow, "spill_time_s", "s", fast, fast, 200 * fast, fast, local=False),  # at once is no end of a range
    ]
    if store.into is not None:
        slots.append(Slot(into, "share_into_next", "1", 0.0, 0.0, 3.0, 0.1, local=False))
    shares = (0.0, 0.7) if store.into is not None else (None,)
    grid = [{brim: b * top} | ({} if s is None else {into: s}) for b in _BRIMS for s in shares]
    return Attachment(
        "overflow", f"overflow state:{name}", location(f"state:{name}"),
        lambda model: _spilling(model, store, (blend, brim, slow, into), tuple(slots)), tuple(slots),
        fixed={blend: 1.0}, share=blend, grid=tuple(grid),
        starts=({}, {slow: 20 * fast}, {brim: 1.2 * top}, {brim: 0.8 * top}),
        equation=f"spill = max({name} - brim_level, 0)/spill_time_s leaves {name}"
        + (f", share_into_next*spill reaches {store.into}" if store.into else ""),
        statement=lambda v: (
            f"{name} overflows above {v['brim_level']:.3g} {unit}"
            + (f", {v['share_into_next']:.0%} of it into {store.into}" if "share_into_next" in v else "")
            + "; the model lets it rise"
        ),
    )  # fmt: skip


def _spilling(model: Equations, store: Store, names: tuple[str, str, str, str], slots: tuple[Slot, ...]) -> Equations:
    blend, brim, slow, into = names
    spill = Auxiliary(f"{blend}_spill", ex.parse(f"{blend}*max({store.state.name} - {brim}, 0)/{slow}", "overflow"))
    flow: dict[str, ast.expr] = {store.state.name: ex.parse(f"-{spill.name}", "overflow")}
    if store.into is not None:
        flow[store.into] = ex.parse(f"{into}*{spill.name}", "overflow")
    states = tuple(
        replace(s, derivative=ex.combine("+", s.derivative, flow[s.name])) if s.name in flow else s
        for s in model.states
    )
    return with_parameters(replace(model, states=states, auxiliaries=(*model.auxiliaries, spill)), slots)


ENTRY = Entry(
    id="overflow",
    family="storage",
    name="overflow",
    equation="h' = ... - max(h - brim_level, 0)/spill_time_s, share_into_next of it into the next store",
    source="Schoukens, Mattsson, Wigren, Noël 2016, Cascaded tanks benchmark; linear weir above a brim",
    quantities=(
        Quantity("brim_level", "the store's own", 0.0, 1e6, float("nan"), "level above which it spills"),
        Quantity("spill_time_s", "s", 0.0, 1e5, 0.0, "how slowly the level above the brim falls"),
        Quantity("share_into_next", "1", 0.0, 3.0, 0.0, "rise of the next store over the fall of this one"),
    ),
    attaches_to="every store: a level guarded against running dry, or in a unit of level or volume, that empties",
    signature="large inflow no longer raises the level; the next store feels the inflow at once",
    confused_with=(
        ("sensor_saturation", "a clipped sensor hides the level, the outflow goes on rising behind it"),
        ("input_saturation", "a saturated pump limits the inflow at every level"),
        ("one_sided_storage", "at the brim against at the floor"),
    ),
    attach=_attach,
    rank=590,
)
