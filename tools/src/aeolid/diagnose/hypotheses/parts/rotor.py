"""Find a turbine's parts in any model (rotor, tower, blades, pitch, power) and write forces locked to the rotor."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.data.machine import blades_of
from aeolid.diagnose.data.shaft_angle import ROLE as SHAFT_ANGLE
from aeolid.diagnose.data.shaft_angle import name_of
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.baseline import FELT
from aeolid.models import expressions as ex
from aeolid.models.angles import radians_a_unit
from aeolid.models.equations import Auxiliary, Equations, Parameter

Array = NDArray[np.float64]
NAMES = {
    "fore_aft": r"fore.?aft|(^|_)fa(_|$)|yawbrtax|ncimutax|ttdspfa|tower.*_x",
    "side_side": r"side.?side|side.?to.?side|lateral|(^|_)ss(_|$)|yawbrtay|ncimutay|ttdspss|tower.*_y",
    "speed": r"rot(or)?_?speed|rotspeed|genspeed|gen(erator)?_?speed|lssgagv|(^|_)omega|rotor_?(rpm|rad)",
    "flap": r"flap|out.?of.?plane|rootmyb|rootmyc|(^|_)oop|_my_?\d",
    "edge": r"edge|(^|_)in.?plane|rootmxb|rootmxc|_mx_?\d",
    "pitch": r"pitch|bldp|(^|_)beta",
    "power": r"power|pwr|(^|_)p_?(el|gen)",
    "wave": r"wave|(^|_)eta(_|$)|elevation",
}
_FAST_SHAFT = r"gen|hss|motor"
_POWER_UNITS = {"W", "kW", "MW"}


@dataclass(frozen=True, eq=False)
class Place:
    """Hold where a force of one kind acts: on an equation of motion, or straight on the output that shows it."""

    location: str
    output: str
    label: str
    unit: str
    size: float
    is_force: bool
    add: Callable[[Equations, ast.expr, str], Equations]


def blades(site: Site) -> int:
    """Return the number of blades, 3 where the case does not say."""
    return blades_of(site.context)


def looks_like(kind: str, name: str, unit: str = "") -> bool:
    """Tell whether a channel's name (and unit) say that it is of this kind."""
    if kind == "power" and unit.strip() in _POWER_UNITS:
        return True
    return re.search(NAMES[kind], name.lower()) is not None


def outputs_like(site: Site, kind: str) -> list[int]:
    """List the outputs of one kind."""
    units = {o.name: o.unit for o in site.model.outputs}
    return [j for j, n in enumerate(site.output_names) if looks_like(kind, n, units.get(n, ""))]


def azimuth(site: Site) -> Exogenous | None:
    """Return the recorded rotor angle, None where the recording or the model leaves none."""
    return next((c for c in site.exogenous if c.role == "azimuth"), None)


def turned(site: Site) -> Exogenous | None:
    """Return the recorded rotor angle, else that which its recorded speed gives from an unknown start on, else None.

    The second serves what is free in its phase. A generator's shaft is not the rotor, whatever stands between them.
    """
    slow = {name_of(n) for n in site.output_names if not re.search(_FAST_SHAFT, n.lower())}
    own = (c for c in site.exogenous if c.role == SHAFT_ANGLE and c.name in slow)
    return azimuth(site) or next(own, None)


def samples(site: Site, channel: Exogenous) -> Array:
    """Return the samples (N,) of a channel the model has no use for."""
    result: Array = site.extra[:, site.exogenous.index(channel)]
    return result


def _radians(site: Site, channel: Exogenous) -> float:
    return radians_a_unit(channel.unit, samples(site, channel))


def turning(site: Site) -> float:
    """Return the rotor's speed in rad/s, signed, from its angle: the median over the samples; 0 unknown."""
    channel = turned(site)
    if channel is None or len(site.extra) < 2:
        return 0.0
    steps = np.diff(samples(site, channel)) * _radians(site, channel)
    steps = (steps + math.pi) % (2 * math.pi) - math.pi
    return float(np.median(steps)) / site.step


@dataclass(frozen=True)
class Angle:
    """Hold a multiple of the rotor angle as text in rad: mid-sample for forces, at the sample's start for sensors.

    An input is held over a sample while the rotor turns on; half a step of its speed makes up for it. An accelerometer
    reads at the instant: the same half step, 4 degrees at 10 Hz, was an error of a tenth of the force below resonance.
    """

    held: str
    now: str


def angle(site: Site, order: int) -> Angle | None:
    """Return order times the rotor angle; None where nothing tells it or it is too fast for the sample time."""
    channel, rate = turned(site), turning(site)
    if channel is None or rate == 0.0 or abs(order * rate) * site.step > in_force().hypotheses.nyquist_share * math.pi:
        return None
    recorded, half = f"{_radians(site, channel)!r}*{channel.symbol}", f"{0.5 * rate * site.step!r}"
    if channel.role == SHAFT_ANGLE:  # of the middle of each row
        return Angle(f"({order}*({recorded}))", f"({order}*({recorded} - {half}))")
    return Angle(f"({order}*({recorded} + {half}))", f"({order}*({recorded}))")


def speed(site: Site) -> str | None:
    """Write the rotor's speed in rad/s by a state of the equations; None where none is it or its scale is unknown."""
    rate, states = abs(turning(site)), {s.name for s in site.model.states}
    for j in outputs_like(site, "speed") if site.linear is None else []:
        y = site.y[:, j][np.isfinite(site.y[:, j])]
        mean = float(np.mean(y)) if len(y) else 0.0
        read = next(o.equation for o in site.model.outputs if o.name == site.output_names[j])
        if rate and isinstance(read, ast.Name) and read.id in states and np.std(y) < abs(mean):
            return f"({rate / mean!r}*{read.id})"
    return None


def wind_factor(site: Site) -> str:
    """Write (V/V_mean)² where a wind in m/s is recorded and unused, else an empty text."""
    for c in site.exogenous:
        mean = float(np.mean(samples(site, c)))
        if c.role in ("scheduling", "disturbance") and c.unit.strip() == "m/s" and mean > 2:
            return f"*({c.symbol}/{mean!r})**2"
    return ""


def place(site: Site, kind: str, as_output: bool = False, broad: bool = False) -> Place | None:
    """Find where a force of this kind acts: the motion its output shows (equations), else the output itself.

    broad: the force is no line, so that its way through the mode shows: push a linear model's mode too.
    """
    found = outputs_like(site, kind)
    if not found:
        return None
    name = site.output_names[found[0]]
    motion = None if as_output else motion_of(site, name) if site.linear is None else _mode(site, name, broad)
    if motion is not None:

        def act(model: Equations, force: ast.expr, label: str) -> Equations:
            return motion.inject(model, force, label)

        return Place(motion.location, name, motion.force_name, motion.force_unit, motion.force_size, True, act)
    spread = float(np.nanstd(site.y[:, found[0]])) or 1.0
    unit = next(o.unit for o in site.model.outputs if o.name == name)

    def show(model: Equations, force: ast.expr, _: str) -> Equations:
        return on_output(model, name, force)

    return Place(f"output:{name}", name, "amplitude", unit, spread, False, show)


def _mode(site: Site, name: str, broad: bool) -> Motion | None:
    return next((m for m in site.motions if m.shown_by == name), None) if broad else None


def on_output(model: Equations, name: str, term: ast.expr) -> Equations:
    """Return the model with a term added to one output."""
    outputs = tuple(
        replace(o, equation=ex.combine("+", o.equation, term)) if o.name == name else o for o in model.outputs
    )
    return replace(model, outputs=outputs)


def motion_of(site: Site, output: str) -> Motion | None:
    """Return the motion that an output shows: its velocity, position or acceleration; None where that is unclear."""
    equation = next(o.equation for o in site.model.outputs if o.name == output)
    derivatives = {s.name: s.derivative for s in site.model.states}
    direct = [
        m
        for m in site.motions
        if isinstance(m.velocity, ast.Name)
        and (
            _names(equation) <= {m.velocity.id, *([m.position.id] if isinstance(m.position, ast.Name) else [])}
            or f"{FELT}{m.velocity.id}" in _names(equation)
            or (m.velocity.id in derivatives and ex.to_text(derivatives[m.velocity.id]) in ex.to_text(equation))
        )
    ]
    return direct[0] if len(direct) == 1 else None


def _names(tree: ast.expr) -> set[str]:
    return ex.names_in(tree) or {""}


def locked(
    site: Site, entry: str, places: list[tuple[Place, str]], order: int, equation: str,
    says: Callable[[float, str, str], str],
) -> list[Attachment]:  # fmt: skip
    """Offer one hypothesis: at each place a cosine and a sine of order times the rotor angle, times a factor text.

    says(amplitude at the first place, its unit, its location) makes the statement.
    """
    phase = angle(site, order)
    if phase is None or not places:
        return []
    slots, terms = harmonic(entry, places, phase)
    first = places[0][0]

    def edit(model: Equations) -> Equations:
        return add_terms(model, slots, terms)

    where = location(first.location, outputs=tuple(p.output for p, _ in places)) | {"azimuth_order": order}
    return [
        Attachment(
            entry, f"{entry} {first.location}", where, edit, tuple(slots), equation=equation,
            statement=lambda v: says(amplitude(v, slots), first.unit, first.location),
        )
    ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Term:
    """Hold what acts at a place: text with the angle as forces see it (held) and as sensors do (now)."""

    place: Place
    held: str
    now: str
    name: str

    def on(self, model: Equations) -> Equations:
        """Return the model with the term; outputs that feel it read it at their instant."""
        model = push(model, self.place.add, ex.parse(self.held, self.name), self.name)
        at_once = {self.name: ast.Name(id=f"{self.name}_now")}
        felt = {a.name for a in model.auxiliaries if a.name.startswith(FELT)}
        kept = [a for a in model.auxiliaries if a.name not in felt]
        kept.append(Auxiliary(f"{self.name}_now", ex.parse(self.now, self.name)))
        kept += [replace(a, equation=ex.substitute(a.equation, at_once)) for a in model.auxiliaries if a.name in felt]
        outputs = tuple(replace(o, equation=ex.substitute(o.equation, at_once)) for o in model.outputs)
        return replace(model, outputs=outputs, auxiliaries=tuple(kept))


def harmonic(entry: str, places: list[tuple[Place, str]], phase: Angle) -> tuple[list[Slot], list[Term]]:
    """Return cosine and sine slots for each place and the terms to add there."""
    slots: list[Slot] = []
    terms = []
    for k, (p, factor) in enumerate(places):
        names = [f"{entry}_{part}{k + 1}" for part in ("cos", "sin")]
        label = p.label if k == 0 else f"{p.label}_{p.output}"
        for name, part in zip(names, ("cos", "sin"), strict=True):
            slots.append(Slot(name, f"{label}_{part}", p.unit, 0.0, -100 * p.size, 100 * p.size, 1e-3 * p.size))
        texts = [f"({names[0]}*cos({x}) + {names[1]}*sin({x})){factor}" for x in (phase.held, phase.now)]
        terms.append(Term(p, texts[0], texts[1], f"{entry}_force{k + 1}"))
    return slots, terms


def add_terms(model: Equations, slots: list[Slot], terms: list[Term]) -> Equations:
    """Return the model with the slots as parameters and each term added at its place."""
    extra = (Parameter(s.name, s.null, s.unit, s.low, s.high) for s in slots)
    model = replace(model, parameters=(*model.parameters, *extra))
    for term in terms:
        model = term.on(model)
    return model


def push(
    model: Equations, add: Callable[[Equations, ast.expr, str], Equations], term: ast.expr, name: str
) -> Equations:
    """Add a term by its name: an intermediate, for a force may enter several equations."""
    model = replace(model, auxiliaries=(*model.auxiliaries, Auxiliary(name, term)))
    return add(model, ast.Name(id=name), f"{name}_in")


def amplitude(values: dict[str, float] | object, slots: list[Slot]) -> float:
    """Return √(cos² + sin²) of the first place from reported values."""
    assert isinstance(values, dict)
    return math.hypot(values[str(slots[0].label)], values[str(slots[1].label)])


def hub(site: Site) -> list[tuple[Place, str]]:
    """List where a thrust and a torque act: tower fore-aft and the rotor, as far as outputs show them."""
    found = [place(site, "fore_aft"), place(site, "speed")]
    return [(p, "") for p in found if p is not None]


def blade_outputs(site: Site, kind: str) -> list[tuple[str, float]]:
    """List blade outputs of a kind with the blade's angle ahead of the rotor angle in rad.

    The number at the end of the name is the blade's, blade 2 a spacing ahead of blade 1; other names (a mean over
    the blades, where once a turn cancels) are left out.
    """
    count, found = blades(site), []
    for j in outputs_like(site, kind):
        number = re.search(r"[1-9]$", site.output_names[j]) or re.search(
            r"(?<![0-9])[1-9](?![0-9])", site.output_names[j]
        )
        if number and int(number[0]) <= count:
            found.append((site.output_names[j], 2 * math.pi / count * (int(number[0]) - 1)))
    return found


def on_blades(
    site: Site, entry: str, outputs: list[tuple[str, float]], parts: tuple[tuple[str, str], ...], equation: str,
    says: Callable[[float, str], str],
) -> list[Attachment]:  # fmt: skip
    """Offer one hypothesis on all blade outputs alike; parts: ("cos" or "sin", label), once a turn of each blade."""
    rules = in_force().hypotheses
    channel, rate = azimuth(site), turning(site)
    if channel is None or rate == 0.0 or abs(rate) * site.step > rules.nyquist_share * math.pi or not outputs:
        return []
    scale = _radians(site, channel)  # an output is read at its instant: no half step here
    first = site.output_names.index(outputs[0][0])
    unit = next(o.unit for o in site.model.outputs if o.name == outputs[0][0])
    size = float(np.nanstd(site.y[:, first])) or 1.0
    slots = [Slot(f"{entry}_{p}", label, unit, 0.0, -100 * size, 100 * size, 1e-3 * size) for p, label in parts]

    def edit(model: Equations) -> Equations:
        extra = (Parameter(s.name, 0.0, s.unit, s.low, s.high) for s in slots)
        model = replace(model, parameters=(*model.parameters, *extra))
        for name, ahead in outputs:
            at = f"({scale!r}*{channel.symbol} + {ahead!r})"
            text = " + ".join(f"{s.name}*{p}({at})" for s, (p, _) in zip(slots, parts, strict=True))
            model = on_output(model, name, ex.parse(text, entry))
        return model

    names = tuple(n for n, _ in outputs)
    where = location(f"output:{names[0]}", outputs=names) | {"azimuth_order": 1}
    return [
        Attachment(
            entry, f"{entry} {', '.join(names)}", where, edit, tuple(slots), equation=equation,
            statement=lambda v: says(math.hypot(*(v[label] for _, label in parts)), unit),
        )
    ]  # fmt: skip
