"""A mode within a motion of first-principles equations: what the model has as one rigid body bends."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.modes import RINGS, beyond_rows, highest_hz, kind_of
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, State

_DAMPING_START, _LEAST_DAMPING = 0.03, 1e-4
_GRID = 24  # frequencies that the bank scores
_STARTS = 6  # frequencies that fits start from, beside the bank's best
_MOST_RATIO = 1e3  # of the inertias on either side


def within_motions(site: Site) -> list[Attachment]:
    """Return, for each motion that two or more outputs read, the hypothesis that its body bends.

    Two inertias J₁, J₂ that a spring couples move as their common centre does, v' = a with a as the model has it, and
    against each other, x'' = a − 2ζΩ x' − Ω² x with Ω² = k (1/J₁ + 1/J₂). A reading of one of them has b x beside the
    centre's position and b x' beside its velocity, b = J₂/J₁ on the driven body and −1 on the other (Craig and Kurdila
    2006, chapter 8: modes of a system with a rigid-body mode). Readings of one body share b. A mode in one output
    alone, where position and speed of a body are recorded, leaves the other unexplained. A mode of a turbine has a name
    and a place of its own.
    """
    if site.linear is not None or site.model.sample_time_s:
        return []
    found = []
    for number, motion in enumerate(site.motions):
        bodies = _bodies(motion, site.model.outputs)
        plain = all(kind_of(name, site) is None for name in bodies)
        if motion.recorded is None and len(bodies) > 1 and plain:
            found.append(_on(site, motion, number, bodies))
    return [a for a in found if a is not None]


def _bodies(motion: Motion, outputs: tuple[Output, ...]) -> dict[str, int]:
    """Return which body each output reads, by name: the k-th velocity and the k-th position are of the k-th."""
    found: dict[str, int] = {}
    for read in (motion.velocity, motion.position):
        if isinstance(read, ast.Name):
            seen = [o.name for o in outputs if read.id in ex.names_in(o.equation) and o.name not in found]
            found |= {name: k for k, name in enumerate(seen)}
    return found


def _on(site: Site, motion: Motion, number: int, bodies: Mapping[str, int]) -> Attachment | None:
    low, high = 4.0 / (len(site.u) * site.step), highest_hz(site)
    if high < 2 * in_force().hypotheses.least_band * low:
        return None
    tag = f"bend{number + 1}"
    w, zeta = f"{tag}_frequency_hz", f"{tag}_damping"
    ratios = tuple(f"{tag}_b{k + 1}" for k in range(1 + max(bodies.values())))
    slots = (
        Slot(w, "frequency_hz", "Hz", low, low, high, high / 3, local=False),
        Slot(zeta, "damping", "1", _DAMPING_START, _LEAST_DAMPING, RINGS, 0.02, local=False),
        *(Slot(b, None, "", 0.0, -_MOST_RATIO, _MOST_RATIO, 1e-2) for b in ratios),
    )
    grid = np.geomspace(2 * low, high * (1 - 1e-6), _GRID)
    starts = tuple({w: float(f), zeta: _DAMPING_START} for f in grid[:: _GRID // _STARTS])
    return Attachment(
        "structural_mode", f"structural_mode {motion.location}", location(motion.location, outputs=tuple(bodies)),
        partial(_with_bending, motion, tag, slots, ratios, bodies), slots, start_states=(f"{tag}_q", f"{tag}_v"),
        starts=({}, {zeta: 3 * _DAMPING_START}, *starts),
        grid=tuple({w: float(f), zeta: _DAMPING_START} for f in grid),
        equation=f"x'' + 2*damping*w*x' + w^2*x = a, w = 2*pi*frequency_hz, a the acceleration of {motion.location};"
        " what reads its position sees b*x more, what reads its velocity b*x'",
        statement=partial(_statement, motion.location, tuple(bodies)), credible=partial(beyond_rows, high),
    )  # fmt: skip


def _statement(where: str, outputs: tuple[str, ...], p: Mapping[str, float]) -> str:
    return (
        f"what moves at {where} is not rigid: a mode at {p['frequency_hz']:.3g} Hz with damping {p['damping']:.2g}"
        f" shows in {' and '.join(outputs)}; the model does not have it"
    )


def _with_bending(
    motion: Motion, tag: str, slots: tuple[Slot, ...], ratios: tuple[str, ...], bodies: Mapping[str, int],
    model: Equations,
) -> Equations:  # fmt: skip
    """Add q = Ω x and v = x', driven as the motion is, and what each output reads of them."""
    q, v, omega, zeta = f"{tag}_q", f"{tag}_v", f"(2*pi*{tag}_frequency_hz)", f"{tag}_damping"
    name = ex.to_text(motion.velocity)
    push = ex.to_text(next(s.derivative for s in model.states if s.name == name))
    forms = f"{omega}*{v}", f"({push}) - {omega}*({q} + 2*{zeta}*{v})"
    states = [State(n, "", ex.parse(f, "mode"), 0.0, True) for n, f in zip((q, v), forms, strict=True)]
    outputs = []
    for o in model.outputs:
        if o.name in bodies:
            b = ratios[bodies[o.name]]
            more = {name: ex.parse(f"{name} + {b}*{v}", "mode")}
            if motion.position is not None:
                place = ex.to_text(motion.position)
                more[place] = ex.parse(f"{place} + {b}*{q}/{omega}", "mode")
            o = replace(o, equation=ex.substitute(o.equation, more))
        outputs.append(o)
    model = with_parameters(model, slots)
    return replace(model, states=(*model.states, *states), outputs=tuple(outputs))
