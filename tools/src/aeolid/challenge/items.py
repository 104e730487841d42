"""What can be hidden: how each effect enters a plant, what a right answer calls it, and how it hides.

`hides` are the numbers of the ways of `WAYS`. Sizes are for a strength of 1; the drawing of a case makes them weaker or
stronger until the effect is worth finding and yet moves the fit little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from aeolid.challenge.paths import Drive, Sensor
from aeolid.challenge.plants import Setup

Put = Callable[[Setup, float, int], Setup]
BOTH, WRITTEN = ("equations", "state_space"), ("equations",)
WAYS = {
    1: "the loop compensates it", 2: "one-step prediction corrects it", 3: "narrow band, high fit elsewhere",
    4: "below broadband noise", 5: "moves with another input", 6: "a wrong parameter absorbs it", 7: "not excited",
    8: "another wind in the simulation", 9: "the sensor loses information", 10: "aliased",
    11: "enters unmeasured", 12: "only in one region", 13: "only at one rotor angle", 14: "two effects at once",
    15: "slow drift", 16: "clock offset", 17: "filtered before logging", 18: "its trace is in the command",
    19: "vanishes at small amplitude", 20: "unit, sign or channel", 21: "tuned on the same record",
    22: "looks like more wind",
}  # fmt: skip


@dataclass(frozen=True)
class Item:
    """Hold one effect on one plant.

    accepted: ids that name it rightly, the best first (none: outside the catalogue); quantity: label of a parameter of
    the diagnosis and its true value in form 0, of the setup; random: the effect is noise itself; fixed: it has no size;
    outputs, roles: what must be recorded; most: strength beyond which no machine has it.
    """

    plant: str
    accepted: tuple[str, ...]
    put: Put
    hides: tuple[int, ...]
    what: str
    kinds: tuple[str, ...] = BOTH
    quantity: tuple[str, Callable[[Setup], float]] | None = None
    random: bool = False
    fixed: bool = False
    outputs: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    forms: int = 2
    most: float = 8.0


def snapped(value: float) -> float:
    """Return the nearest of 1, 2 and 5 times a power of ten: converters have such steps."""
    steps = [m * 10.0**k for k in range(-5, 5) for m in (1, 2, 5)]
    return min(steps, key=lambda s: abs(s / value - 1) if s >= value else abs(value / s - 1))


def on_drive(
    kind: str, size: float, *, inverse: bool = False, b: float = 0.0, which: int = 0, snap: bool = False
) -> Put:
    """Hide something in the drive of an input; inverse: a smaller number is a stronger effect."""

    def put(s: Setup, strength: float, form: int) -> Setup:
        a = size / strength if inverse else size * strength
        return replace(s, drive=Drive(which, kind, form, snapped(a) if snap else a, b))

    return put


def on_sensor(
    kind: str, which: int, size: float, *, inverse: bool = False, b: float = 0.0, snap: bool = False, plus: float = 0.0
) -> Put:
    """Hide something in a sensor or logger; plus: the size is a deviation from that."""

    def put(s: Setup, strength: float, form: int) -> Setup:
        a = plus + (size / strength if inverse else size * strength)
        return replace(s, sensors=(*s.sensors, Sensor(which, kind, form, snapped(a) if snap else a, b)))

    return put


def in_plant(strong: Mapping[str, float], other: Mapping[str, float] | None = None, **base: float) -> Put:
    """Hide something in the plant: `strong` grows with the strength, `other` does not, `base` changes the model's."""

    def put(s: Setup, strength: float, form: int) -> Setup:
        grown = {k: v * strength for k, v in strong.items()}
        truth = s.truth._replace(**grown, **(other or {}), other=float(form))
        return replace(s, truth=truth, base=s.base._replace(**base))

    return put


def declared(put: Put, **flags: float) -> Put:
    """Also write the model another way."""

    def changed(s: Setup, strength: float, form: int) -> Setup:
        s = put(s, strength, form)
        return replace(s, declared={**s.declared, **flags})

    return changed


def sensor_a(s: Setup) -> float:
    """Return the first size of the last sensor effect."""
    return s.sensors[-1].a


def drive_a(s: Setup) -> float:
    """Return the first size of the drive's effect."""
    return s.drive.a


def field(name: str) -> Callable[[Setup], float]:
    """Return how a constant of the plant is read."""
    return lambda s: float(getattr(s.truth, name))
