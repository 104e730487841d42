"""Which runs of the simulator are made, and which pairs of them are cases.

A wind is its kind and mean: "u18" is 18 m/s, the same over the disc, "f14" 14 m/s with turbulence over the whole disc.
In every wind the turbine is run as it is two or three times; an effect is one further run, on the side that has it.
Any two runs of a wind are a pair, so that the runs of the nulls are the other sides of the effects, too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations, zip_longest

from openfast_pairs.effects import BOTH, EFFECTS, Effect, Made, Values

SECONDS = 600.0
SIZES = ("small", "medium", "large")
WINDS = {"u18": 3, "f14": 3, "u14": 3, "f18": 3, "u16": 3, "u20": 3, "u12": 3, "f16": 2, "f20": 2, "f12": 2}
CUTS = (120.0, 300.0, SECONDS)  # s: of what is there or not the recording's length makes the sizes
SHORT = 200.0  # s of the first of two sizes, cut: the small one
PARTS = ("tuning", "held")
_SALT = 2822  # of the split: with it either part has half of the nulls and at least one size of every effect


@dataclass(frozen=True)
class Run:
    """Describe one run: name, wind, further options of run.py; the seed follows from the name."""

    name: str
    wind: str
    options: tuple[str, ...] = ()

    def command(self) -> list[str]:
        """Return the options of run.py."""
        seed = 1 + int(hashlib.sha256(self.name.encode()).hexdigest()[:8], 16) % 30_000
        kind = ["--full-field"] if self.wind[0] == "f" else []
        asked = ["--seed", str(seed), "--wind", self.wind[1:], "--seconds", f"{SECONDS:g}"]
        return [*asked, *kind, *self.options]


@dataclass(frozen=True)
class Pair:
    """Describe a pair: recording and simulation by the names of their runs, seconds of the recording, the truth."""

    name: str
    effect: str
    size: str
    wind: str
    recording: str
    simulation: str
    seconds: float = SECONDS
    ids: tuple[str, ...] = ()
    accepted: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    place: str | None = None
    values: Values = field(default_factory=dict)

    @property
    def part(self) -> str:
        """Return the part, "tuning" or "held": the lowest bit of the salted hash of the pair's name."""
        return part_of(self.name, _SALT)


def part_of(name: str, salt: int) -> str:
    """Return the part of a pair; its cases, all channels and two outputs, are in one part."""
    return PARTS[hashlib.sha256(f"{salt}:{name}".encode()).digest()[0] & 1]


def null_name(wind: str, k: int) -> str:
    """Return the name of the k-th run of the turbine as it is, k from 1."""
    return f"null-{wind}-{k}"


def _made_name(effect: Effect, k: int) -> str:
    return f"{effect.key}-{k + 1}-{effect.made[k].wind}"


def all_runs() -> dict[str, Run]:
    """Return every run by name."""
    nulls = [Run(null_name(w, k), w) for w, count in WINDS.items() for k in range(1, count + 1)]
    made = [Run(_made_name(e, k), m.wind, m.options) for e in EFFECTS for k, m in enumerate(e.made)]
    return {r.name: r for r in (*nulls, *made)}


def _sizes(effect: Effect) -> tuple[tuple[int, float], ...]:
    """Return which run makes a size and how many seconds of the recording."""
    if len(effect.made) == 3:
        return (0, SECONDS), (1, SECONDS), (2, SECONDS)
    if len(effect.made) == 2:
        return (0, SHORT), (0, SECONDS), (1, SECONDS)
    return tuple((0, cut) for cut in CUTS)


def _of_effect(effect: Effect, size: int) -> Pair:
    run, seconds = _sizes(effect)[size]
    made: Made = effect.made[run]
    other = null_name(made.wind, (WINDS[made.wind], 2, 1)[size])
    own = _made_name(effect, run)
    recording, simulation = (other, own) if effect.simulated else (own, other)
    return Pair(f"{effect.key}-{SIZES[size]}-{made.wind}", effect.key, SIZES[size], made.wind, recording, simulation,
                seconds, effect.ids, effect.accepted, effect.families, effect.place, made.values)  # fmt: skip


def _both(one: str, other: str) -> Pair:
    """Return a pair whose recording has one effect while its simulation lacks another."""
    known = {e.key: e for e in EFFECTS}
    key, _, size = one.rpartition("-")
    first, second = _of_effect(known[key], SIZES.index(size)), known[other]
    if second.made[0].wind != first.wind:
        raise ValueError(f"{one} and {other} are not of one wind")
    effect = f"{key}_and_{other}"
    return Pair(f"{effect}-{size}-{first.wind}", effect, size, first.wind, first.recording, _made_name(second, 0),
                SECONDS, first.ids + second.ids, first.accepted + second.accepted, first.families + second.families,
                None, {**second.made[0].values, **first.values})  # fmt: skip


def _nulls() -> list[Pair]:
    """Return pairs of the turbine as it is: every two runs of a wind; of full fields also with the roles exchanged."""
    found: dict[str, list[Pair]] = {}
    for wind, count in WINDS.items():
        for a, b in combinations(range(1, count + 1), 2):
            ways = ((a, b), (b, a)) if wind[0] == "f" else ((a, b),) if (a + b) % 2 else ((b, a),)
            for i, j in ways:
                pair = Pair(f"null-{wind}-{i}x{j}", "null", "null", wind, null_name(wind, i), null_name(wind, j))
                found.setdefault(wind, []).append(pair)
    rounds = zip_longest(*found.values())
    return [p for r in rounds for p in r if p is not None]


def all_pairs() -> list[Pair]:
    """Return every pair in the order of their making: a null, three effects, sizes taken in turn, largest first."""
    count = len(EFFECTS)
    single = [_of_effect(EFFECTS[i], (2 - i - r) % 3) for r in range(3) for i in range(count)]
    double = [_both(*b) for b in BOTH]
    spread = len(single) // len(double)
    effects = iter([p for k, s in enumerate(single) for p in ([s] if k % spread else [s, *double[k // spread :][:1]])])
    return list(_interleaved(iter(_nulls()), effects))


def _interleaved(nulls: Iterator[Pair], effects: Iterator[Pair]) -> Iterator[Pair]:
    while True:
        four = [p for p in (next(nulls, None), next(effects, None), next(effects, None), next(effects, None)) if p]
        if not four:
            return
        yield from four


def runs_in_order(part: str | None = None) -> list[Run]:
    """Return the runs, of one part or of both, in the order in which pairs need them."""
    known: Mapping[str, Run] = all_runs()
    pairs = (p for p in all_pairs() if part in (None, p.part))
    names = dict.fromkeys(n for p in pairs for n in (p.simulation, p.recording))
    return [known[n] for n in names]
