"""Find the stores of a model: levels and volumes that flow into each other."""

from __future__ import annotations

import ast
from dataclasses import dataclass

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Site
from aeolid.diagnose.structure.forces import FORCE
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, State

_UNITS = {"m", "mm", "cm", "dm", "m^3", "m3", "l", "L", "litre", "kg", "t", "%"}


@dataclass(frozen=True, eq=False)
class Store:
    """Hold a store: its state, the state it empties into (None: out of the model), and the level it may reach."""

    state: State
    into: str | None
    level: float


def stores(site: Site) -> list[Store]:
    """List the stores of a first-principles model in continuous time; a mechanical position is none.

    A state counts where its equation guards it against running dry (max(h, 0) or a root of it), or where it has a
    unit of level, volume or mass and empties itself. Its level is the largest output in its unit, or twice its start.
    """
    model = site.model
    if site.linear is not None or model.sample_time_s:
        return []
    moving = {ex.to_text(e) for m in site.motions for e in (m.velocity, m.position) if e is not None}
    forces = {s.name for s in model.states if s.name.startswith(FORCE)}
    held = [s for s in model.states if s.name not in moving | forces and _holds(s, model)]
    result = []
    for s in held:
        below = (t.name for t in held if t is not s and s.name in ex.names_in(t.derivative))
        result.append(Store(s, next(below, None), _level(s, site)))
    return [store for store in result if store.level > 0]


def _holds(state: State, model: Equations) -> bool:
    guarded = any(_guards(n, state.name) for s in model.states for n in ast.walk(s.derivative))
    plain = state.unit.replace(" ", "") in _UNITS
    return guarded or (plain and state.name in ex.names_in(state.derivative))


def _guards(node: ast.AST, name: str) -> bool:
    """Tell whether a node is max(name, …) or a root of something with that name in it."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("max", "sqrt")):
        return False
    inside = set().union(*(ex.names_in(a) for a in node.args))
    plain = any(isinstance(a, ast.Name) and a.id == name for a in node.args)
    return plain or (node.func.id == "sqrt" and name in inside)


def _level(state: State, site: Site) -> float:
    seen = [
        float(np.nanquantile(site.y[:, j], 0.999)) for j, o in enumerate(site.model.outputs) if o.unit == state.unit
    ]
    return max(seen, default=2.0 * abs(state.initial))
