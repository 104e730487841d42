"""What the catalogue's forces share: places of a motion, units, and how a force with parameters enters it."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.hypotheses.parts.base import Attachment, Quantity, Site, Slot, location
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.sums import straight_in
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter

EDGE = 0.01  # of the typical velocity: a sign is tanh(v/(EDGE·size)), narrow enough, and wide enough to integrate


def force_on(
    motion: Motion, number: int, entry: str, slots: tuple[Slot, ...], force: str, *, kind: str = "",
    states: Callable[[Equations], Equations] = lambda model: model, **rest: Any,
) -> Attachment:  # fmt: skip
    """Return the hypothesis that `force` acts on a motion; {q}, {v} stand for its position and velocity.

    `states` adds what the force remembers; `rest` are further fields of the attachment, `equation` and `statement`
    among them.
    """
    tree = place(force, motion)
    name = f"{entry}{kind}_{number + 1}_acts"

    def edit(model: Equations) -> Equations:
        return motion.inject(with_parameters(states(model), slots), tree, name)

    where = location(motion.location)
    key = " ".join(word for word in (entry, kind.replace("_", " ").strip(), motion.location) if word)
    return Attachment(entry, key, where, edit, slots, **rest)


def with_parameters(model: Equations, slots: tuple[Slot, ...]) -> Equations:
    """Return the model with these slots as parameters, at their nulls."""
    added = tuple(Parameter(s.name, s.null, s.unit, s.low, s.high) for s in slots)
    return replace(model, parameters=(*model.parameters, *added))


def place(force: str, motion: Motion) -> ast.expr:
    """Parse a force, {q} and {v} replaced by the motion's position and velocity."""
    q, v = (ex.to_text(e) if e is not None else "0" for e in (motion.position, motion.velocity))
    return ex.parse(force.format(q=f"({q})", v=f"({v})"), "force")


def with_spring(site: Site) -> list[tuple[int, Motion]]:
    """List the motions that have a position, numbered among all."""
    return [(i, m) for i, m in enumerate(site.motions) if m.position is not None]


def with_travel(site: Site) -> list[tuple[int, Motion]]:
    """List the motions of which a position is known, or how far a recorded velocity takes one, numbered among all."""
    return [(i, m) for i, m in enumerate(site.motions) if m.position is not None or m.recorded is not None]


def per(motion: Motion, power: int, *, velocity: bool = False) -> str:
    """Return the unit of a force over the motion's position (or velocity) to a power."""
    base = motion.position_unit or "1"
    if velocity:  # of what goes so many rpm s, the velocity is in rpm
        below = base.removesuffix(" s") if base.endswith(" s") else f"({base}/s)"
    else:
        below = f"({base})" if " " in base else base
    return f"{motion.force_unit or '1'}/{below}" + (f"^{power}" if power > 1 else "")


def natural(motion: Motion, power: int = 1, *, velocity: bool = False) -> float:
    """Return the coefficient whose force is of the motion's own size: force over position (or velocity) to a power."""
    size = motion.velocity_size if velocity else motion.position_size
    return motion.force_size / float(max(size, 1e-300)) ** power


def travel(site: Site, motion: Motion) -> tuple[float, float]:
    """Return the middle and the half-width of what a position is seen to move over.

    From the recording where it is an input, or an output shows this position alone, be it in another unit; else around
    zero by its typical size.
    """
    if motion.recorded is not None:
        return sum(motion.recorded) / 2, (motion.recorded[1] - motion.recorded[0]) / 2
    for j, output in enumerate(site.model.outputs):
        if isinstance(motion.position, ast.Name):
            shown = straight_in(output.equation, motion.position.id, site.model)
            if shown is not None:
                low, high = sorted((np.nanquantile(site.y[:, j], [0.001, 0.999]) - shown[1]) / shown[0])
                if high > low:
                    return float(low + high) / 2, float(high - low) / 2
    return 0.0, 2.5 * motion.position_size


def time_channel(site: Site) -> tuple[Exogenous, float, float] | None:
    """Return time with its first and last value, or None where the recordings' times do not follow on each other."""
    for k, channel in enumerate(site.exogenous):
        if channel.role == "time":
            values = site.extra[:, k]
            return (channel, float(values[0]), float(values[-1])) if np.all(np.diff(values) > 0) else None
    return None


def swing(label: str, angle: str = "azimuth") -> str:
    """Return what a force locked to the rotor is, as reports have it: a cosine and a sine of an angle."""
    return f"({label}_cos*cos({angle}) + {label}_sin*sin({angle}))"


def swings(meaning: str, label: str = "force_N") -> tuple[Quantity, Quantity]:
    """Return the two quantities of a force (or a torque) locked to the rotor; straight on an output, in its unit."""
    unit = f"{'N' if label == 'force_N' else 'N m'} (unit of the output without a motion)"
    return (
        Quantity(f"{label}_cos", unit, -1e7, 1e7, 0.0, f"{meaning}, cos part"),
        Quantity(f"{label}_sin", unit, -1e7, 1e7, 0.0, f"{meaning}, sin part"),
    )


def say(text: str, **names: str) -> Callable[[Mapping[str, float]], str]:
    """Return a statement from a format string over the reported values and names.

    What a user wrote (channels, units) comes in as `names`: braces in it are text, not fields.

    >>> say("{k:.2g} {unit} at {at}", unit="N/m^{2}", at="input:v{1}")({"k": 2.5})
    '2.5 N/m^{2} at input:v{1}'
    """
    return lambda values: text.format(**names, **values)
