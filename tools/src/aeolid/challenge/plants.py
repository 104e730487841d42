"""Describe each plant: its loop, its test signals, and the model a user would have of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.challenge import bench, flows, rotor
from aeolid.challenge.chain import NONE, Chain, anti_alias, coloured, convert, drive_signal, instants
from aeolid.challenge.march import levels, make_march, wander
from aeolid.challenge.paths import Drive, Sensor, read

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """Name a recorded column: unit, role, and the spread of its sensor noise in that unit."""

    name: str
    unit: str
    role: str
    noise: float = 0.0


@dataclass(frozen=True)
class Plant:
    """Hold what all cases of one plant share.

    core: places of the model's states in the plant's; disturbances: (place in w, spread, memory s) of what nobody
    records; swings: amplitude and dwell in samples of each input's test signal; model: text of the equations, from
    constants, outputs, declared factors and the factor on the disturbances' memory.
    """

    name: str
    context: dict[str, Any]
    step_s: float
    every: int
    physics: Any
    parts: tuple[Any, Any, Any]
    states: int
    core: tuple[int, ...]
    start: Callable[[Any], Array]
    rest: tuple[float, ...]
    inputs: tuple[Column, ...]
    outputs: tuple[Column, ...]
    disturbances: tuple[tuple[int, float, float], ...]
    swings: tuple[tuple[float, int], ...]
    aim: float
    width: int
    model: Callable[[Any, tuple[str, ...], dict[str, float], float], str]
    free: tuple[str, ...]
    state_names: tuple[tuple[str, str], ...]
    seen: Column
    held: int  # state that the loop holds; it starts at rest there
    always_closed: bool = False


@dataclass(frozen=True)
class Setup:
    """Hold one recording to be made: what the plant has, what its model has, what is recorded and how.

    truth, base: the constants with and without what is hidden; outputs: which are recorded, by name; roles: further
    columns (warmth, seen, wind, azimuth); loud: factor on the test signal; declared: factors on declared values.
    """

    plant: Plant
    truth: Any
    base: Any
    drive: Drive = field(default_factory=Drive)
    sensors: tuple[Sensor, ...] = ()
    outputs: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    closed: bool = False
    loud: float = 1.0
    gusts: float = 1.0
    rough: float = 1.0
    memory: float = 1.0
    held: bool = False
    declared: dict[str, float] = field(default_factory=dict)
    chain: Chain = NONE
    off: dict[str, float] = field(default_factory=dict)  # factors on what the model's user takes for the constants
    weak: float = 0.0  # dry friction of a bench that does not matter

    @property
    def believed(self) -> Setup:
        """Return the recording that the model's user would make: constants a little off, nothing hidden."""
        wrong = {k: getattr(self.base, k) * factor for k, factor in self.off.items()}
        base = self.base._replace(**wrong)
        return replace(self, truth=base, base=base, drive=Drive(), sensors=())

    @property
    def bare(self) -> Setup:
        """Return the same recording without anything hidden."""
        return replace(self, truth=self.base, drive=Drive(), sensors=())

    def number(self, name: str) -> int:
        """Return the place of an output among those of the plant."""
        return [c.name for c in self.plant.outputs].index(name)


def simulate(setup: Setup, samples: int, seed: int) -> dict[str, Array]:
    """Run the loop; returns every column that may be recorded. The same seed gives the same noise to every setup."""
    plant, rng = setup.plant, np.random.default_rng(seed)
    n, fine = samples * plant.every, plant.step_s / plant.every
    w = np.zeros((n, plant.width))
    for place, spread, memory_s in plant.disturbances:
        calm, quick = wander(rng, n, memory_s * setup.memory, fine), wander(rng, n, 0.2 * memory_s, fine)
        mixed = calm if setup.rough < 2 else 0.85 * calm + 0.53 * quick  # a spectrum of two slopes, as Kaimal's
        w[:, place] = setup.gusts * spread * mixed
    clock = plant.step_s * np.arange(samples)
    warmth = 14.0 * np.sin(2 * np.pi * clock / (0.31 * clock[-1])) + 3.0 * wander(rng, samples, 40 * plant.step_s, 1.0)
    seen = wander(rng, samples, 25 * plant.step_s, plant.step_s)
    extra = {"warmth": 20.0 + warmth, "seen": seen}
    _place(plant, w, extra, rng, n, fine)
    swell = np.repeat(rng.uniform(0.35, 1.0, samples // 200 + 1), 200)[:samples]  # loud and quiet stretches
    test = np.column_stack([a * setup.loud * swell * levels(rng, samples, d, True) for a, d in plant.swings])
    smooth = drive_signal(setup.chain, test, plant.every)
    test = smooth[:: plant.every]
    between = smooth - np.repeat(test, plant.every, axis=0)
    aim = plant.aim * levels(rng, samples, 60, True)
    jitter = rng.standard_normal((samples, len(plant.outputs))) * np.array([c.noise for c in plant.outputs])
    own = np.random.default_rng([seed, 7])  # of the chain: without one, every draw is as it was
    jitter += coloured(setup.chain, np.array([c.noise for c in plant.outputs]), samples, own)
    march = make_march(*plant.parts)
    physics = setup.truth
    if setup.weak and not physics.dry:
        physics = physics._replace(dry=setup.weak)
    start, rest = plant.start(physics), np.array(plant.rest)
    u, y = march(
        physics, setup.drive.packed(), start, rest, test, between, start[plant.held] + aim, w, jitter, plant.every,
        plant.step_s, setup.closed or plant.always_closed,
    )  # fmt: skip
    u = _commanded(setup, u, between)
    logged = _logged(setup, y, jitter, fine, own)
    columns = {"time_s": clock, **extra}
    columns |= {c.name: u[:, i] for i, c in enumerate(plant.inputs)}
    columns |= {c.name: logged[:, i] for i, c in enumerate(plant.outputs)}
    if plant.name == "turbine":
        columns["azimuth"] = columns["azimuth"] % 360.0
        columns["wind"] = rotor.V0 + w[:: plant.every, 0] + 0.3 * rng.standard_normal(samples)
    return columns


def _commanded(setup: Setup, u: Array, between: Array) -> Array:
    """Return the commands as they are recorded: those of a controller are known, analogue ones are measured."""
    if not setup.chain.analogue:
        return u
    every = setup.plant.every
    seen = anti_alias(setup.chain, np.repeat(u, every, axis=0) + between, every)
    return convert(setup.chain, seen[::every])


def _logged(setup: Setup, y: Array, jitter: Array, fine: float, rng: np.random.Generator) -> Array:
    """Return the outputs as the chain leaves them; a counter of turns (without noise) passes no converter."""
    plant, chain = setup.plant, setup.chain
    if chain is NONE:
        return read(setup.sensors, y, jitter, plant.every, fine)
    analogue = np.array([c.noise > 0 for c in plant.outputs])
    y = y.copy()
    y[:, analogue] = anti_alias(chain, y[:, analogue], plant.every)
    logged = read(setup.sensors, y, jitter, plant.every, fine, instants(chain, len(jitter), rng))
    logged[:, analogue] = convert(chain, logged[:, analogue])
    return logged


def _place(plant: Plant, w: Array, extra: dict[str, Array], rng: np.random.Generator, n: int, fine: float) -> None:
    """Put what is recorded, and what only some effects use, into the disturbances at every fine step."""
    held = {k: np.repeat(v, plant.every) for k, v in extra.items()}
    if plant.name != "turbine":
        w[:, 1], w[:, 2] = held["warmth"] - 20.0, held["seen"]
        return
    w[:, 2], w[:, 3] = _sea(rng, n, fine), held["seen"]
    w[:, 4], w[:, 5] = wander(rng, n, 8.0, fine), wander(rng, n, 8.0, fine)
    extra["wave"] = w[:: plant.every, 2]


def _sea(rng: np.random.Generator, n: int, fine: float) -> Array:
    """Return the elevation of a narrow-banded sea of 9 s, 0.5 m deviation: 60 waves of random phase (JONSWAP-like)."""
    t, f = fine * np.arange(n), np.linspace(0.06, 0.25, 60)
    shape = f**-5 * np.exp(-1.25 * (0.111 / f) ** 4) * 3.3 ** np.exp(-((f - 0.111) ** 2) / (2 * (0.08 * 0.111) ** 2))
    sizes, phases = np.sqrt(shape / shape.sum()) * 0.5 * np.sqrt(2), rng.uniform(0, 2 * np.pi, 60)
    total = np.zeros(n)
    for a, omega, phase in zip(sizes, 2 * np.pi * f, phases, strict=True):
        total += a * np.cos(omega * t + phase)
    return total


def zeros(count: int) -> Callable[[Any], Array]:
    """Return a start at rest."""
    return lambda e: np.zeros(count)


def tanks_start(e: flows.Tanks) -> Array:
    """Return the levels at which 2.2 V hold the tanks."""
    level = (e.fill * 2.2 / e.drain) ** 2
    return np.array([level, level, 0.0, 0.0])


def heater_start(e: flows.Heater) -> Array:
    """Return the temperatures at which 20 of power hold the heater."""
    shell = e.heat * 20.0 / e.couple * e.shell / e.air
    return np.array([shell + e.heat * 20.0 / e.couple, shell, 0.0, 0.0])


def turbine_start(e: rotor.Turbine) -> Array:
    """Return the operating point, rotor and generator at one speed."""
    start = np.zeros(rotor.STATES)
    start[0] = rotor.Q0 / e.ks
    start[1] = start[2] = rotor.W0
    return start


def by_name(name: str) -> Plant:
    """Return a plant."""
    from aeolid.challenge.models import PLANTS

    return PLANTS[name]


__all__ = ["Column", "Plant", "Setup", "bench", "by_name", "simulate"]
