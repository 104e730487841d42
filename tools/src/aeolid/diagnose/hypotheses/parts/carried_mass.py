"""A part of a body that a spring carries: it swings against the body, and its reaction acts on the body."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.modes import RINGS, beyond_rows, highest_hz, swinging
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations, State

_DAMPING_START, _LEAST_DAMPING = 0.03, 1e-4
_MOST_SHARE = 0.95  # of the mass: what is left of the body still answers its forces
_GRID = 24  # frequencies that the bank scores
_STARTS = 6  # frequencies that fits start from, beside the bank's best
_SHARES = (0.02, 0.05, 0.1, 0.2)  # that fits start from: the score of two that swing alike promises three times more
_SWINGS = 4  # of the body's typical stroke is the shortest pendulum: a shorter one goes over the top, as chance has it
_GRAVITY = "9.80665"  # m/s²


@dataclass(frozen=True)
class _Kind:
    """Hold how a part swings: rates of its states q and v, and what it adds to the body's a; w = Ω, z = ζ, s."""

    name: str
    place: str
    speed: str
    more: str
    equation: str


_SPRING = _Kind(
    "carried", "{w}*{v}", "({a}) - {w}*({q} + 2*{z}*{v})", "{s}/(1 - {s})*(({a}) - {w}*({q} + 2*{z}*{v}))",
    "x'' = a - 2*damping*w*x' - w^2*x, (1 - share)*q'' = a - share*(w^2*x + 2*damping*w*x'), w = 2*pi*frequency_hz,"
    " a what the model says the acceleration q'' of {where} is",
)  # fmt: skip
_LENGTH = f"({_GRAVITY}/{{w}}**2)"
_HINGE = _Kind(
    "hanging", "{v}", f"-(({{a}}) + ({{more}}))*cos({{q}})/{_LENGTH} - {{w}}**2*sin({{q}}) - 2*{{z}}*{{w}}*{{v}}",
    f"{{s}}*(({{a}})*cos({{q}})**2 + {_LENGTH}*(cos({{q}})*({{w}}**2*sin({{q}}) + 2*{{z}}*{{w}}*{{v}})"
    " + sin({q})*{v}**2))/(1 - {s}*cos({q})**2)",
    "L*p'' = -q''*cos(p) - g*sin(p) - 2*damping*w*L*p', (1 - share*cos(p)^2)*q'' = a + share*L*(cos(p)*(w^2*sin(p)"
    " + 2*damping*w*p') + sin(p)*p'^2), L = g/w^2, w = 2*pi*frequency_hz, a what the model says the acceleration q''"
    " of {where} is",
)  # fmt: skip


def carried_masses(site: Site) -> list[Attachment]:
    """Return, for each velocity of first-principles equations that an output reads, that a part of its body swings.

    A share s of the mass is carried by a spring: a machine on rubber feet, sloshing water, the far end of a shaft. The
    two swing against each other at Ω and ζ, x'' = a - 2ζΩ x' - Ω² x with a as the model has it, and the body feels
    (1 - s) v' = a - s (Ω² x + 2ζΩ x'): a vibration absorber (Den Hartog 1956, Mechanical Vibrations, section 3.2; x is
    s - 1 times where the part is against the body). At low frequencies the body is as heavy as the model says. Forces
    of the model keep acting on the body, a spring to the ground among them, where modes within outputs feel none of it.
    What hangs from a hinge (a crane's load) has length L = g/Ω² and angle p, L p'' = -v' cos p - g sin p - 2ζΩ L p'; Ω
    is then that of the part where the body is held. Modes of a turbine have names and places of their own.
    """
    low, high = 4.0 / (len(site.u) * site.step), highest_hz(site)
    return [
        found
        for number, motion in enumerate(site.motions)
        if motion.recorded is None and (outputs := _read_at(motion, site))
        for found in _on(motion, number, (low, high), outputs, site.model.sample_time_s)
    ]


def _read_at(motion: Motion, site: Site) -> tuple[str, ...]:
    """Return the outputs that read a motion; none on a turbine, and none of states in discrete time."""
    if is_turbine(site.context):
        return ()
    if site.linear is not None:
        return (motion.shown_by,)
    if not isinstance(motion.velocity, ast.Name) or site.model.sample_time_s:
        return ()
    wanted = ex.names_in(motion.velocity) | (ex.names_in(motion.position) if motion.position is not None else set())
    return tuple(o.name for o in site.model.outputs if wanted & ex.names_in(o.equation))


def _on(
    motion: Motion, number: int, band: tuple[float, float], outputs: tuple[str, ...], step: float
) -> list[Attachment]:  # fmt: skip
    """Return what may swing with a body: on a spring, and where the body moves in metres also from a hinge."""
    kinds = (_SPRING, _HINGE) if motion.position_unit == "m" and not step else (_SPRING,)
    low, highest = band
    found = []
    for kind in kinds:
        whirls = np.sqrt(float(_GRAVITY) / max(_SWINGS * motion.position_size, 1e-300)) / (2 * np.pi)
        high = min(highest, whirls) if kind is _HINGE else highest
        if high < 2 * in_force().hypotheses.least_band * low:
            continue
        tag = f"{kind.name}{number + 1}"
        w, zeta, share = f"{tag}_frequency_hz", f"{tag}_damping", f"{tag}_share"
        slots = (
            Slot(w, "frequency_hz", "Hz", low, low, high, high / 3, local=False),
            Slot(zeta, "damping", "1", _DAMPING_START, _LEAST_DAMPING, RINGS, 0.02, local=False),
            Slot(share, "share", "1", 0.0, 0.0, _MOST_SHARE, 1e-3),
        )
        grid = tuple({w: float(f), zeta: _DAMPING_START} for f in np.geomspace(2 * low, high * (1 - 1e-6), _GRID))
        edit = partial(_on_mode, motion, tag, slots) if step else partial(_with_carried, motion, tag, kind, slots)
        hypothesis = Attachment(
            "structural_mode", f"structural_mode {motion.location}, {kind.name}",
            location(motion.location, outputs=outputs), edit,
            slots, start_states=(f"{tag}_q", f"{tag}_v"), grid=grid,
            starts=({}, *({share: s} for s in _SHARES), *grid[:: _GRID // _STARTS]),
            equation=kind.equation.format(where=motion.location), statement=partial(_statement, motion.location, kind),
            credible=partial(beyond_rows, high), essential=(share,), stepped=True,
        )  # fmt: skip
        found.append(hypothesis)
    return found


def _statement(where: str, kind: _Kind, p: Mapping[str, float]) -> str:
    f, part = p["frequency_hz"], f"{p['share']:.2g} of the mass (or inertia) that moves at {where}"
    if kind is _HINGE:
        how = f"hangs from it as a pendulum does: where the body is held it swings at {f:.3g} Hz"
    else:
        held = f * np.sqrt(max(1 - p["share"], 0.0))
        how = f"is carried by a spring: it swings at {f:.3g} Hz against the rest, at {held:.3g} Hz where that is held,"
    return f"{part} {how} with damping {p['damping']:.2g}; the model has it rigid"


def _with_carried(
    motion: Motion, tag: str, kind: _Kind, slots: tuple[Slot, ...], model: Equations
) -> Equations:  # fmt: skip
    """Add what swings, driven by the body, and its reaction to the forces on the body."""
    name = ex.to_text(motion.velocity)
    known = ex.to_text(next(s.derivative for s in model.states if s.name == name))
    symbols = {
        "a": known, "q": f"{tag}_q", "v": f"{tag}_v", "w": f"(2*pi*{tag}_frequency_hz)", "z": f"{tag}_damping",
        "s": f"{tag}_share",
    }  # fmt: skip
    more = kind.more.format(**symbols)
    forms = (kind.place.format(**symbols), kind.speed.format(more=more, **symbols))
    mass = motion.mass.name if motion.mass is not None else "1"
    model = motion.inject(with_parameters(model, slots), ex.parse(f"{mass}*({more})", tag), f"{tag}_acts")
    added = [State(f"{tag}_{n}", "", ex.parse(form, tag), 0.0, True) for n, form in zip("qv", forms, strict=True)]
    return replace(model, states=(*model.states, *added))


def _on_mode(motion: Motion, tag: str, slots: tuple[Slot, ...], model: Equations) -> Equations:
    """Add what swings with a mode of a linear model; q is Ω² x, v is Ω x', exactly sampled under the mean of a sample.

    The body feels the mean of what is at both ends of the sample; what its own damper makes of that within the sample
    is left out, an error of first order in the step (0.5 % of the motion at 50 samples a period).
    """
    q, v, w, zeta, share = f"{tag}_q", f"{tag}_v", f"{tag}_frequency_hz", f"{tag}_damping", f"{tag}_share"
    known = ex.to_text(motion.forces)
    states = swinging((q, v), w, zeta, known, model.sample_time_s)
    ends = {f"{s.name}_next": s.derivative for s in states}
    mean = f"0.5*({q} + 2*{zeta}*{v} + {q}_next + 2*{zeta}*{v}_next)"
    force = ex.parse(f"{share}/(1 - {share})*({known} - {mean})", tag)
    more = tuple(Auxiliary(n, form) for n, form in (*ends.items(), (f"{tag}_force", force)))
    model = replace(with_parameters(model, slots), auxiliaries=(*model.auxiliaries, *more))
    model = motion.inject(model, ast.Name(id=f"{tag}_force"), f"{tag}_acts")
    return replace(model, states=(*model.states, *states))
