"""Draw cases of the foreign rigs: what each hides, through which measurement chain it was recorded, and its model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aeolid.challenge.chain import (
    Array,
    Chain,
    anti_alias,
    convert,
    draw_chain,
    drive_signal,
    instants,
    kept,
    noise,
    sample,
    smooth,
)
from aeolid.challenge.draw import Turns
from aeolid.challenge.engine import FINE, linearise, simulate
from aeolid.challenge.families import family_of
from aeolid.challenge.march import levels, wander
from aeolid.challenge.rig_menu import Effect, effects, outside
from aeolid.challenge.rigs import Rig, Values
from aeolid.challenge.rigs_static import ALL
from aeolid.decompositions import pinv

Facts = dict[str, Any]
SHARES = {"parameter": 0.08, "double": 0.07, "outside": 0.06}  # and a third hide nothing; each at least once from 12 on
MATTERS = (0.05, 0.4)  # by how much an effect moves a free run, over the spread of that output
_TRIES, _MEMORY_S = 8, 0.5


@dataclass(frozen=True)
class Case:
    """Hold one case: its class, rig, effects with their strengths, chain, baseline and the seed of its signals.

    declared: factors on the constants that the model is written with; wrong: factors on what is written of a parameter;
    runs: number of recordings, of equal length.
    """

    sort: str
    rig: Rig
    hidden: tuple[Effect, ...]
    strength: tuple[float, ...]
    chain: Chain
    seed: int
    kind: str = "equations"
    declared: Mapping[str, float] = field(default_factory=dict)
    wrong: Mapping[str, float] = field(default_factory=dict)
    runs: int = 1
    moved: float | None = None

    @property
    def background(self) -> Values:
        """Return the rig without the effect: every joint has a little dry friction."""
        weak = self.rig.weak if self.chain.rough else 0.0
        return {**self.rig.values, "dry": weak}

    @property
    def truth(self) -> Values:
        """Return the rig with its effects; dead times are whole steps of the engine."""
        values = self.background
        for effect, strength in zip(self.hidden, self.strength, strict=True):
            values = effect.put(values, strength)
        step = self.rig.step_s / FINE
        return {**values, "late": round(values["late"] / step) * step}

    @property
    def flags(self) -> Mapping[str, float]:
        """Return how the model is written."""
        return {k: v for e in self.hidden for k, v in e.flags.items()}

    def model(self) -> str:
        """Return model.toml, with constants that are a little off."""
        return self.rig.model(
            {k: v * self.declared.get(k, 1.0) for k, v in self.rig.values.items()}, self.wrong, self.flags
        )

    def state_space(self) -> Facts:
        """Return the rig without its effect as a discrete linear model, with constants that are a little off."""
        rig = self.rig
        values = {k: v * self.declared.get(k, 1.0) for k, v in rig.values.items()}
        rest = np.array([rig.rest(values), 0.0])
        A, B, C, shown = linearise(rig.write(values), np.array(rig.start(values)), rest)
        B = B[:, :1]
        if rig.project:
            T = np.array(rig.project)
            A, B, C = T @ A @ pinv(T), T @ B, C @ pinv(T)
        outputs = [
            {"name": o.name, "unit": o.unit, "offset": float(y)} for o, y in zip(rig.outputs, shown, strict=True)
        ]
        return {
            "kind": "state_space", "sample_time_s": rig.step_s,
            "inputs": [{"name": rig.drive.name, "unit": rig.drive.unit, "offset": float(rest[0])}], "outputs": outputs,
            "states": [{"name": n, "unit": u} for n, u in rig.states], "A": A.tolist(), "B": B.tolist(),
            "C": C.tolist(), "D": np.zeros((len(C), 1)).tolist(), "K": None, "x0": [0.0] * len(A),
            "innovation_covariance": None, "scheduling": None,
        }  # fmt: skip


def sorts(cases: int, rng: np.random.Generator) -> list[str]:
    """Return the class of each case in random order: at least a third hide nothing."""
    listed = ["null"] * -(-cases // 3)
    for sort, share in SHARES.items():
        listed += [sort] * max(1 if cases >= 12 else 0, round(share * cases))
    listed += ["single"] * (cases - len(listed))
    return [listed[i] for i in rng.permutation(cases)]


def draw_cases(cases: int, seed: int, samples: int) -> Iterator[Case]:
    """Return every case; rigs take turns where nothing is hidden, effects by family and by name."""
    rng = np.random.default_rng([seed, 9])
    singly, strange = Turns(effects(), rng), Turns(outside(), rng)
    names = [list(ALL)[i] for i in rng.permutation(len(ALL))]
    calm = 0
    for number, sort in enumerate(sorts(cases, rng)):
        own = seed * 100_003 + number + 1
        hidden: tuple[Effect, ...] = ()
        if sort in ("null", "parameter"):
            rig = ALL[names[calm % len(names)]]
            calm += 1
        else:
            hidden = _pair(rng) if sort == "double" else (singly() if sort == "single" else strange(),)
            rig = ALL[hidden[0].plant]
        yield settle(sort, rig, hidden, own, samples)


def _pair(rng: np.random.Generator) -> tuple[Effect, Effect]:
    """Return two effects of one rig and of two families, which the model shall hold both."""
    listed = [e for e in effects() if not e.fixed and e.accepted[0] != "sensor_saturation"]
    while True:
        a, b = (listed[i] for i in rng.integers(0, len(listed), 2))
        if a.plant == b.plant and family_of(a.accepted[0]) != family_of(b.accepted[0]):
            return a, b


def settle(sort: str, rig: Rig, hidden: tuple[Effect, ...], seed: int, samples: int) -> Case:
    """Settle one case: chain, baseline, what is declared a little wrong, number of recordings, strength."""
    rng = np.random.default_rng([seed, 1])
    chain = draw_chain(rng)
    if rig.servo:  # it moves smoothly, and all that is recorded has gone the same way
        chain = replace(chain, analogue=True, offset=0.0)
    kind = "state_space" if rig.linear and rng.random() < 0.3 else "equations"
    if sort == "parameter" or any(e.flags for e in hidden):
        kind = "equations"
    off = {k: 1 + float(rng.choice([-1, 1]) * rng.uniform(0.01, 0.03)) for k in rig.free}
    wrong = {}
    if sort == "parameter":
        symbol = str(rng.choice(rig.wrong))
        wrong[symbol] = 1 + float(rng.choice([-1, 1]) * rng.uniform(0.15, 0.35))
    strength = tuple(1.0 if e.fixed else float(np.exp(rng.uniform(-0.35, 0.35))) for e in hidden)
    runs = int(rng.integers(6, 13)) if rng.random() < 0.25 and samples >= 3000 else 1
    case = Case(sort, rig, hidden, strength, chain, seed, kind, off, wrong, runs)
    return _strong_enough(case, min(samples, 2000)) if hidden else case


def _strong_enough(case: Case, samples: int) -> Case:
    """Change the strengths until each effect moves a free run by enough to matter and a model bears it."""
    strength, total = list(case.strength), 0.0
    for k, effect in enumerate(case.hidden):
        for _ in range(_TRIES):
            moved = moves(replace(case, hidden=(effect,), strength=(strength[k],)), samples)
            if effect.fixed or MATTERS[0] <= moved <= MATTERS[1]:
                break
            strength[k] = float(f"{strength[k] * (1.3 if moved < MATTERS[0] else 1 / 1.3):.4g}")
        total = max(total, moved)
    return replace(case, strength=tuple(float(f"{s:.4g}") for s in strength), moved=total)


def moves(case: Case, samples: int) -> float:
    """Return by how much the effects move a noise-free run, over the spread of the output that they move most."""
    bare = dict(case.background)
    if case.flags.get("rigid"):
        bare["k"] *= 400.0
    test = _commands(case, samples, np.random.default_rng([case.seed, 2]))
    found = [_run(case.rig, v, test)[::FINE] for v in (case.truth, bare)]
    shown = [o.role == "output" for o in case.rig.outputs]
    return float(np.max((np.std(found[0] - found[1], axis=0) / np.std(found[1], axis=0))[shown]))


def _commands(case: Case, samples: int, rng: np.random.Generator) -> Array:
    """Return the command at every step of the engine, and no force."""
    swell = np.repeat(rng.uniform(0.5, 1.0, samples // 200 + 1), 200)[:samples]  # loud and quiet stretches
    test = case.rig.swing * swell * levels(rng, samples, case.rig.dwell, True)
    fine = drive_signal(case.chain, test[:, None], FINE) + case.rig.rest(case.rig.values)
    if case.rig.servo:
        return smooth(fine, FINE)
    return np.column_stack([fine, np.zeros(len(fine))])


def _run(rig: Rig, values: Values, commands: Array) -> Array:
    """Return what the rig's sensors would show without a chain; the fourth of a servo's is the acceleration."""
    shown = simulate(rig.write(values), commands[0] if rig.servo else np.array(rig.start(values)), commands,
                     np.array([rig.rest(values)]))  # fmt: skip
    if len(rig.outputs) > shown.shape[1]:
        shown = np.column_stack([shown, np.gradient(shown[:, 1], rig.step_s / FINE)])
    return shown


def record(case: Case, samples: int, number: int = 0) -> dict[str, Array]:
    """Return the columns of one recording, as the chain leaves them."""
    rig, chain = case.rig, case.chain
    rng = np.random.default_rng([case.seed, 3, number])
    commands = _commands(case, samples, rng)
    if not rig.servo:
        commands[:, 1] = rig.force * chain.rough * wander(rng, len(commands), _MEMORY_S, rig.step_s / FINE)
    truth = case.truth
    seen = anti_alias(chain, _run(rig, truth, commands), FINE)
    spreads = np.array([o.noise for o in rig.outputs])
    shown = sample(seen, instants(chain, samples, rng), FINE) + noise(chain, spreads, samples, rng)
    if truth["clip"]:  # the first sensor's amplifier ends there, too
        shown[:, 0] = np.clip(shown[:, 0], -truth["clip"], truth["clip"])
    rows = kept(chain, samples, rng)
    shown = convert(chain, shown)
    columns: dict[str, Array] = {"time_s": rig.step_s * np.arange(samples, dtype=float)}
    if not rig.servo:
        told = convert(chain, anti_alias(chain, commands[:, :1], FINE)[::FINE]) if chain.analogue else commands[::FINE]
        columns[rig.drive.name] = told[:, 0]
    columns |= {o.name: shown[:, i] for i, o in enumerate(rig.outputs)}
    return {name: values[rows] for name, values in columns.items()}
