"""Ask whether steady forces that nobody measured do to an output what an offset of its sensor does."""

from __future__ import annotations

import ast
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import svd
from aeolid.diagnose.hypotheses.parts.base import Site
from aeolid.diagnose.hypotheses.parts.wiring import compiled_of, spread_of
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.rules.hypotheses import HypothesesRules
from aeolid.diagnose.structure.forces import FORCE
from aeolid.models.integrate import numeric_jacobian, output_jacobian

Array = NDArray[np.float64]
_ENDS = (5.0, 95.0)  # percentiles of what an output shows, between which a model's state is asked about


def imitated_by_forces(site: Site) -> tuple[bool, ...]:
    """Tell for each output whether steady forces that nobody measured could move it alone.

    The responses to a slow force on every state that noise drives span what disturbances do; a direction that lies in
    this span, but for a tenth, says nothing about a sensor. A response that fades with the frequency (a speed, of a
    mass on a spring) is none: the force would have to grow without end. The force must do so wherever the output goes:
    a pendulum that hangs is held off by a torque as by an offset of its angle, one that swings to the horizontal is
    not. The states of a linear model are anything, a disturbance may enter all of them: every output is imitated.
    """
    return _imitated(site, in_force().hypotheses)


@lru_cache(maxsize=4)
def _imitated(site: Site, rules: HypothesesRules) -> tuple[bool, ...]:
    count = len(site.output_names)
    if site.linear is not None:
        return (True,) * count
    sizes = np.array([max(spread_of(y), 1e-300) for y in site.y.T])
    found = [_steady(site, x, rules) for x in _places(site)]
    if not found[0].size or not np.all(np.isfinite(found[0])):
        return (False,) * count
    held = [steady / sizes[:, None] for steady in found if np.all(np.isfinite(steady))]
    scaled = np.vstack(held)
    U, s, _ = svd(scaled / np.maximum(np.linalg.norm(scaled, axis=0), 1e-300))
    reached = U[:, s > rules.force_reach * max(s[0], 1e-300)]
    offsets = np.tile(np.eye(count), len(held)) / np.sqrt(len(held))
    inside = np.linalg.norm(offsets @ reached, axis=1)
    return tuple(bool(1 - x * x < rules.force_reach**2) for x in inside)


def _places(site: Site) -> list[Array]:
    """Return the model's start, and the same with each state that an output shows at the ends of what it shows."""
    model = site.model
    names = [s.name for s in model.states]
    places = [model.x0]
    for output, y in zip(model.outputs, site.y.T, strict=True):
        shown, measured = output.equation, y[np.isfinite(y)]
        if isinstance(shown, ast.Name) and shown.id in names and len(measured):
            for value in np.percentile(measured, _ENDS):
                places.append(model.x0.copy())
                places[-1][names.index(shown.id)] = value
    return places


def _steady(site: Site, x: Array, rules: HypothesesRules) -> Array:
    """Return the outputs' steady response (l, f) to the unmeasured forces about a state, zero where it fades."""
    slow = 2 * np.pi / max(len(site.u) * site.step, 1e-9)  # rad/s: one swing over the recording
    moved, slower = _responses(site, x, (slow, 0.1 * slow))
    if not np.all(np.isfinite(moved)):
        return np.full(moved.shape, np.nan)
    return np.where(np.abs(slower) > rules.fading_ratio * np.abs(moved), slower, 0.0)


def _responses(site: Site, x: Array, turns: tuple[float, ...]) -> list[Array]:
    """Return the outputs' responses (l, f) to the unmeasured forces about a state x, at some frequencies in rad/s."""
    model, compiled, u = site.model, compiled_of(site), np.median(site.u, axis=0)
    J = numeric_jacobian(compiled, x, u, model.theta)
    C = output_jacobian(compiled, x, u, model.theta)
    forces = np.array([s.name.startswith(FORCE) for s in model.states])
    if not np.any(forces) or not np.all(np.isfinite(J)):
        return [np.zeros((len(C), 0))] * len(turns)
    own, step, found = ~forces, model.sample_time_s, []
    for turn in turns:
        s = np.exp(1j * turn * step) if step else 1j * turn
        moved = np.linalg.solve(
            s * np.eye(int(own.sum())) - J[np.ix_(own, own)], J[np.ix_(own, forces)].astype(complex)
        )
        found.append(np.asarray(C[:, own] @ moved + C[:, forces]))
    return found
