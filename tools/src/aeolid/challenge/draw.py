"""Draw the cases of a challenge: what each hides, how strongly, and in which form."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from aeolid.challenge.chain import NONE, draw_chain
from aeolid.challenge.families import family_of
from aeolid.challenge.items import WRITTEN, Item
from aeolid.challenge.menu_turbine import faults, outside, plant_outputs, singles, unreachable
from aeolid.challenge.models import PLANTS
from aeolid.challenge.plants import Setup, simulate
from aeolid.challenge.worth import Worth, worth
from aeolid.errors import DataError

Array = NDArray[np.float64]
DECIDABLE = 5.0  # nats on sealed data below which nobody can tell
SHARES = {"null": 0.14, "parameter": 0.13, "outside": 0.12, "double": 0.08, "fault": 0.08, "impossible": 0.07}
_TRIES, _MOST_VAF, _AIMS = 5, 0.9, (30.0, 250.0)  # nats aimed at, drawn evenly in the logarithm
_DRAWS = 10
_LEAST = 1 / 8  # strength below which a size is no longer that of a real machine
_WRONG = {"spring": ("k", "c", "g", "M"), "shaft": ("k", "bm", "Jl", "g"), "tanks": ("a", "b"),
          "heater": ("p", "h1", "h3"), "turbine": ("kf", "Qb", "Tb", "M")}  # fmt: skip


_LATE, _RINGING = 1.5, 1.4  # samples; delay of a second-order drive times its frequency in rad/s, damping 0.7
_WEAK = {"spring": 0.02, "shaft": 0.008}  # dry friction, N and N m, that every bench has
_FURTHER = {"warmth": 0.2, "seen": 0.2}


@dataclass(frozen=True)
class Draw:
    """Hold one case: its class (single, double, null …), what it hides, its recording and what it is worth."""

    sort: str
    items: tuple[Item, ...]
    setup: Setup
    form: int
    kind: str  # of the baseline
    seed: int
    strength: tuple[float, ...]
    value: Worth | None
    runs: int = 1  # recordings, of equal length


def sorts(cases: int, rng: np.random.Generator) -> list[str]:
    """Return the class of each case, in random order; at least a quarter hide nothing, a tenth what has no name."""
    listed: list[str] = []
    for sort, share in SHARES.items():
        least = 1 if cases >= 8 else 0
        listed += [sort] * max(least, int(np.ceil(share * cases - 1e-9)) if share >= 0.12 else round(share * cases))
    listed = listed[:cases]
    listed += ["single"] * (cases - len(listed))
    return [listed[i] for i in rng.permutation(cases)]


def draw_all(cases: int, seed: int) -> list[tuple[str, tuple[Item, ...], int]]:
    """Return class, effects and seed of every case; single effects take turns by family and by entry."""
    rng = np.random.default_rng([seed, 0])
    chosen = sorts(cases, rng)
    singly, foreign, faulty, never = (Turns(f(), rng) for f in (singles, outside, faults, unreachable))
    found: list[tuple[str, tuple[Item, ...], int]] = []
    for number, sort in enumerate(chosen):
        own = seed * 100_003 + number + 1
        items: tuple[Item, ...] = ()
        if sort == "single":
            items = (singly(),)
        elif sort == "outside":
            items = (foreign(),)
        elif sort == "fault":
            items = (faulty(),)
        elif sort == "impossible":
            items = (never(),) if rng.random() < 0.5 else (_sized(singly),)
        elif sort == "double":
            items = _pair(rng)
        found.append((sort, items, own))
    return found


class Hidden(Protocol):
    """Name what any effect has: its plant, the names that are right, and what it is."""

    @property
    def plant(self) -> str:
        """Return the name of its plant."""

    @property
    def accepted(self) -> tuple[str, ...]:
        """Return the ids that name it rightly, the best first."""

    @property
    def what(self) -> str:
        """Return what it is."""


T = TypeVar("T", bound=Hidden)


class Turns(Generic[T]):
    """Give out items: families by turns, within a family ids by turns, within an id plants by turns."""

    def __init__(self, items: Sequence[T], rng: np.random.Generator) -> None:
        groups: dict[str, dict[str, list[T]]] = defaultdict(lambda: defaultdict(list))
        for i in rng.permutation(len(items)):
            name = items[i].accepted[0] if items[i].accepted else items[i].what
            groups[family_of(name) if items[i].accepted else items[i].plant][name].append(items[i])
        self.order = [list(groups[g].values()) for g in sorted(groups)]
        self.order = [self.order[i] for i in rng.permutation(len(self.order))]
        self.given = 0

    def __call__(self) -> T:
        group = self.order[self.given % len(self.order)]
        turn = self.given // len(self.order)
        self.given += 1
        same = group[turn % len(group)]
        return same[(turn // len(group)) % len(same)]


def _sized(turns: Turns[Item]) -> Item:
    return next(i for i in iter(turns, None) if not i.fixed)


def _pair(rng: np.random.Generator) -> tuple[Item, Item]:
    """Return an effect in the plant and one in its drive, or in a sensor, of two families."""
    listed = [i for i in singles() if not i.random and not i.fixed and i.plant in ("spring", "shaft", "turbine")]
    while True:
        a, b = (listed[i] for i in rng.integers(0, len(listed), 2))
        apart = family_of(a.accepted[0]) != family_of(b.accepted[0]) and a.plant == b.plant
        drives = sum(i.put.__qualname__.startswith("on_drive") for i in (a, b))
        sizes = sum(i.put.__qualname__.startswith("in_plant") or "declared" in i.put.__qualname__ for i in (a, b))
        shown = not (a.outputs and b.outputs) or a.outputs == b.outputs
        if apart and drives < 2 and sizes < 2 and shown and set(a.kinds) & set(b.kinds):
            return a, b


def build(sort: str, items: tuple[Item, ...], seed: int, samples: int, chained: bool = False) -> Draw:
    """Settle one case: plant, loop, baseline, form, strength; drawn anew where the recording would run away.

    chained: recorded through a measurement chain, by a machine and a model with small imperfections.

    Raises DataError where it does in every draw.
    """
    for draws in range(_DRAWS):
        rng = np.random.default_rng([seed, 1, draws] if draws else [seed, 1])
        draw = _settle(sort, items, seed, samples, rng, chained)
        if draw.value is None or np.isfinite(draw.value.nats):
            return draw
    hidden = " and ".join(i.what for i in items)
    raise DataError(f"{hidden}: the plant runs away in each of {_DRAWS} draws; make the challenge with another --seed")


def _settle(
    sort: str, items: tuple[Item, ...], seed: int, samples: int, rng: np.random.Generator, chained: bool
) -> Draw:  # fmt: skip
    """Draw plant, loop, baseline and form, and find the strength."""
    plant = PLANTS[items[0].plant if items else str(rng.choice(list(PLANTS), p=[0.2, 0.2, 0.1, 0.1, 0.4]))]
    kinds = [k for k in (items[0].kinds if items else ("equations", "state_space", "run")) if _allowed(k, plant.name)]
    for item in items[1:]:
        kinds = [k for k in kinds if k in item.kinds]
    odds = np.array([{"equations": 0.55, "state_space": 0.33, "run": 0.12}[k] for k in kinds])
    kind = str(rng.choice(kinds, p=odds / odds.sum()))
    form = int(rng.integers(0, 2)) if all(i.forms > 1 for i in items) else 0
    if sort == "impossible":
        form = 0  # a servo that is far from its limit still has its lag
    if sort == "parameter":
        kind = "equations"
    setup = _setting(plant.name, kind, items, rng)
    setup = _timed(setup, samples)
    if sort == "null" and plant.name == "turbine":
        setup = replace(setup, rough=1.0)  # the model declares a wind of one memory: it shall be right
    if sort == "parameter":
        symbols = rng.permutation(_WRONG[plant.name])[: int(rng.integers(1, 3))]
        factors = {str(s): float(rng.choice([-1, 1]) * rng.uniform(0.04, 0.2) + 1) for s in symbols}
        setup = replace(setup, declared={**setup.declared, **factors})
    runs = 1
    if chained:
        own = np.random.default_rng([seed, 5])
        setup = _imperfect(setup, own)
        short = kind != "run" and sort != "fault" and not any(15 in i.hides for i in items)  # nothing slow
        runs = int(own.integers(6, 13)) if short and samples >= 3000 and own.random() < 0.25 else 1
    if not items:
        return Draw(sort, items, setup, 0, kind, seed, (), None, runs)
    return _strong_enough(Draw(sort, items, setup, form, kind, seed, (), None, runs), samples, rng)


def _imperfect(setup: Setup, rng: np.random.Generator) -> Setup:
    """Add a chain, a little friction, and a model whose free constants are 1 to 3 % off."""
    chain = draw_chain(rng)
    if setup.closed or setup.plant.always_closed:  # the controller's output is held
        chain = replace(chain, analogue=False)
    held = bool(setup.declared.get("held"))
    names = [f for f in setup.plant.free if getattr(setup.base, f) and not (held and f[:2] in ("q_", "t_"))]
    off = {f: 1 + float(rng.choice([-1, 1]) * rng.uniform(0.01, 0.03)) for f in names}
    return replace(setup, chain=chain, off=off, weak=_WEAK.get(setup.plant.name, 0.0))


def _allowed(kind: str, plant: str) -> bool:
    return kind == "equations" or (plant != "tanks" and (kind == "state_space" or plant != "heater"))


def _setting(name: str, kind: str, items: tuple[Item, ...], rng: np.random.Generator) -> Setup:
    plant = PLANTS[name]
    drawn = float(rng.random())
    outputs = plant_outputs(items[0], drawn) if items else ()
    for item in items:
        outputs = item.outputs or outputs
    if not items:
        outputs = plant_outputs(Item(name, (), lambda s, x, f: s, (), "", WRITTEN), drawn)
    roles = [r for i in items for r in i.roles]
    further = {"azimuth": 0.8, "wind": 0.3, "wave": 0.15, "seen": 0.15} if name == "turbine" else _FURTHER
    roles += [r for r, share in further.items() if rng.random() < share]  # what is recorded must not tell what acts
    physics = plant.physics
    if name == "turbine" and kind != "equations":
        physics = physics._replace(curve=0.0)  # a linear model of a plant that is one
    return Setup(
        plant, physics, physics, outputs=outputs, roles=tuple(dict.fromkeys(roles)), closed=bool(rng.random() < 0.4),
        gusts=float(np.exp(rng.uniform(-0.4, 0.4))), rough=float(rng.choice([1.0, 2.0])),
        memory=float(np.exp(rng.uniform(-0.3, 0.3))),
    )  # fmt: skip


def _timed(setup: Setup, samples: int) -> Setup:
    """Put changes in time where the fit part and the sealed part both see before and after, as far as they can."""
    if hasattr(setup.truth, "at"):
        at = round(0.3 * samples * setup.plant.step_s, 2)
        setup = replace(setup, truth=setup.truth._replace(at=at), base=setup.base._replace(at=at))
    return setup


def place(draw: Draw, strength: Sequence[float]) -> Setup:
    """Return the recording with every effect at its strength."""
    setup, at = draw.setup, getattr(draw.setup.truth, "at", None)
    for item, size in zip(draw.items, strength, strict=True):
        setup = item.put(setup, size, draw.form)
    return setup if at is None else replace(setup, truth=setup.truth._replace(at=at))


def _strong_enough(draw: Draw, samples: int, rng: np.random.Generator) -> Draw:
    """Change the strengths until the effect can be found and yet moves the fit little, or cannot be found at all."""
    aim = float(np.exp(rng.uniform(*np.log(_AIMS))))
    strength = [1.0] * len(draw.items)
    for k, item in enumerate(draw.items):
        if not item.fixed:
            own = replace(draw, items=(item,))
            strength[k] = _late_enough(own, _tuned(own, samples, aim, draw.sort == "impossible"))
    return replace(draw, strength=tuple(strength), value=measure(draw, strength, samples))


def _tuned(draw: Draw, samples: int, aim: float, faint: bool) -> float:
    """Return a strength at which nats come near the aim; both nats and the change of the fit grow with its square."""
    size, best, found, below, above = 1.0, np.inf, 1.0, 0.0, np.inf
    for _ in range(_TRIES):
        value = measure(draw, [size], samples)
        if value is None:
            break
        wanted = 0.3 if faint else aim
        if np.isfinite(value.nats):
            if value.vaf_points > _MOST_VAF and value.nats > wanted:  # less, as long as it stays decidable
                wanted = max(2 * DECIDABLE, wanted * _MOST_VAF / value.vaf_points)
            miss = abs(np.log(max(value.nats, 1e-3) / wanted))
            if miss < best:
                best, found = miss, size
        ratio = wanted / max(value.nats, 1e-3) if np.isfinite(value.nats) else 0.1
        if best < 0.5 or (faint and value.nats < 1.0):
            break
        below, above = (size, above) if ratio > 1 else (below, size)
        step = size * float(np.clip(ratio, 1e-4, 16.0)) ** 0.5
        size = (below * above) ** 0.5 if below > 0 and above < np.inf else step
        size = float(np.clip(size, 1e-3 if faint else _LEAST, draw.items[0].most))
    return float(f"{found:.3g}")


def _late_enough(draw: Draw, strength: float) -> float:
    """Return a strength at which what is late is so by more than a measurement chain may be, if that is hidden at all.

    All outputs late by less than a sample are told as how the recording was made, whatever made them so; an analogue
    command that is read as if it were held seems half a sample early.
    """
    (item,) = draw.items
    if draw.setup.chain is NONE or draw.sort == "impossible" or family_of((*item.accepted, "")[0]) != "input_lag":
        return strength
    label, value = item.quantity or ("", _nothing)
    while label and strength < item.most:
        told = abs(value(place(draw, [strength])))
        late_s = _RINGING / told if label == "omega_rad_s" else told
        if late_s >= (_LATE + 0.5 * draw.setup.chain.analogue) * draw.setup.plant.step_s:
            break
        strength = float(f"{strength * 1.15:.3g}")
    return strength


def _nothing(setup: Setup) -> float:
    return 0.0


def measure(draw: Draw, strength: Sequence[float], samples: int) -> Worth | None:
    """Return what the effect is worth on this very recording; None where no predictor says so."""
    setup = place(draw, strength)
    if setup.declared.get("unconnected") or draw.sort == "fault":
        return None
    smooth = replace(setup, chain=replace(setup.chain, bits=0))
    hidden, bare = simulate(smooth, samples, draw.seed), simulate(smooth.bare, samples, draw.seed)
    if not all(np.all(np.isfinite(v)) for v in hidden.values()):
        return Worth(np.inf, np.inf, -np.inf)
    recorded = simulate(setup.bare, samples, draw.seed) if setup.chain.bits else bare
    random = any(i.random for i in draw.items)
    return worth(setup, hidden, bare, recorded, random=random, loose=draw.kind != "equations")


def unnamed_family(item: Item) -> str:
    """Return the family an effect is counted under."""
    return family_of(item.accepted[0]) if item.accepted else "outside"
