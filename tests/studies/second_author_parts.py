"""What the systems of second_author.py share: the case, excitations, steps of SciPy's solver, noise, texts of models.

All but the steps serve third_author.py, too. Excitations differ from those of textbook_plants.py in that they dwell for
random times. All that is random comes from the generator that is passed, in the order of the calls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter
from textbook_plants import Array

Column = tuple[Array, str, str]  # values, unit, role
Slope = Callable[[float, Array, Array], Sequence[float]]
Command = Callable[[int, Array], Sequence[float] | Array]


@dataclass(frozen=True)
class Case:
    """Hold a recording, the model that is given with it, what that lacks, and how the recording is written.

    `right` are entries each of which is the truth, `alike` those that may stand in for it, `values` what an entry of
    `right` has to tell. Without `right` the model is complete, unless it lacks physics outside the catalogue. `clean`
    are the outputs of a complete model at its true values `true`, where nothing acts that is not recorded.
    """

    name: str
    step: float
    columns: Mapping[str, Column]
    model: str | Mapping[str, Any]
    right: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    beside: tuple[str, ...] = ()  # entries that the recording has, too, but that alone are no answer
    outside: bool = False  # lacks physics that no entry has
    verdicts: tuple[str, ...] = ()  # of a model that is complete or lacks physics outside, that are true as well
    machine: str = "rig"
    context: str = ""
    cuts: tuple[int, ...] = ()  # rows at which a new recording begins
    lost: int = 0  # rows that are not in the files
    gap: tuple[int, int] | None = None  # rows of the first recording that are not there
    headings: bool = False  # units stand in the headings of the columns
    time: str = "time_s"
    time_scale: float = 1.0  # of the column of time, from seconds
    digits: int = 7
    clean: Mapping[str, Array] = field(default_factory=dict)
    true: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Tones:
    """Sines at about geometric frequencies with random phases around a mean, known at any time."""

    speeds: Array
    phases: Array
    height: float
    mean: float

    @classmethod
    def drawn(cls, rng: np.random.Generator, low: float, high: float, count: int, rms: float, mean: float) -> Tones:
        """Draw frequencies from low to high, in hertz, and phases."""
        speeds = 2 * np.pi * np.geomspace(low, high, count) * rng.uniform(0.97, 1.03, count)
        return cls(speeds, rng.uniform(0, 2 * np.pi, count), float(rms * np.sqrt(2 / count)), mean)

    def __call__(self, t: float | NDArray[Any]) -> Any:
        """Return the value at a time, or at several."""
        return self.mean + self.height * np.sum(np.sin(np.multiply.outer(t, self.speeds) + self.phases), -1)


def plateaus(rng: np.random.Generator, rows: int, dwell: int, low: float, high: float) -> Array:
    """Return steps to random levels, each kept for half to one and a half times `dwell` rows."""
    found: list[float] = []
    while len(found) < rows:
        level = rng.uniform(low, high)
        found += [level] * int(rng.integers(dwell // 2, dwell * 3 // 2))
    return np.array(found[:rows])


def flips(rng: np.random.Generator, rows: int, dwell: int, size: float) -> Array:
    """Return steps between two levels, each kept for one to three times `dwell` rows."""
    found: list[float] = []
    while len(found) < rows:
        level = size * rng.choice([-1, 1])
        found += [level] * int(dwell * rng.integers(1, 4))
    return np.array(found[:rows])


def smooth(rng: np.random.Generator, rows: int, lag: float, rms: float) -> Array:
    """Return noise behind a lag of so many rows, of this deviation in the mean over many."""
    a = np.exp(-1 / lag)
    white = rng.standard_normal(rows + int(10 * lag))
    return np.asarray(rms * lfilter([np.sqrt(1 - a * a)], [1, -a], white)[-rows:])


def coloured(rng: np.random.Generator, y: Array, share: float, lag: float) -> Array:
    """Return a signal with noise of a share of its deviation, half of it behind a lag of so many rows."""
    noise = 0.7 * smooth(rng, len(y), lag, 1) + 0.7 * rng.standard_normal(len(y))
    return np.asarray(y + share * np.std(y) * noise)


def converted(y: Array, low: float, high: float, bits: int) -> Array:
    """Return what a converter of this range and resolution makes of a signal."""
    least = (high - low) / 2**bits
    return np.asarray(np.round(np.clip(y, low, high) / least) * least)


def advance(slope: Callable[[float, Array], Any], x: Array, span: float, **options: Any) -> Array:
    """Return the state after a span of time from now, with solve_ivp's options."""
    return np.asarray(solve_ivp(slope, (0, span), x, **options).y[:, -1])


def _later(slope: Slope, begun: float, u: Array, t: float, x: Array) -> Sequence[float]:
    """Return the slope at a time after the row that began then."""
    return slope(begun + t, x, u)


def march(slope: Slope, start: Sequence[float], rows: int, step: float, command: Command,
          **options: Any) -> tuple[Array, Array]:  # fmt: skip
    """Integrate x' = slope(t, x, u), u = command(row, x) held to the next row; return states and commands at rows."""
    x, states, commands = np.array(start, dtype=float), [], []
    for k in range(rows):
        u = np.array(command(k, x), dtype=float)
        states.append(x)
        commands.append(u)
        x = advance(partial(_later, slope, k * step, u), x, step, **options)
    return np.array(states), np.array(commands)


def held(slope: Slope, start: Sequence[float], u: Array, step: float) -> Array:
    """Return the states at the rows under inputs (N, r) that are known beforehand."""
    return march(slope, start, len(u), step, lambda k, _: u[k], rtol=1e-8, atol=1e-9, first_step=step / 4)[0]


def free_time(slope: Callable[[float, Array], Any], start: Sequence[float], rows: int, step: float,
              longest: float) -> Array:  # fmt: skip
    """Return the states at the rows where the input is a function of time."""
    t = np.arange(rows) * step
    found = solve_ivp(slope, (0, t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-10, max_step=longest)
    return np.asarray(found.y.T)


def free(value: float, low: float, high: float, unit: str = "") -> str:
    """Return a declared value that the recording may correct."""
    bounds = f"value = {float(value)!r}, min = {float(low)!r}, max = {float(high)!r}"
    return f"{{ {bounds}{f', unit = {chr(34)}{unit}{chr(34)}' if unit else ''}, free = true }}"


def known(value: float, unit: str = "") -> str:
    """Return a declared value that stands."""
    return f"{{ value = {float(value)!r}{f', unit = {chr(34)}{unit}{chr(34)}' if unit else ''} }}"


def equations(name: str, values: Mapping[str, str], states: Mapping[str, tuple[str, float, str]],
              outputs: Mapping[str, tuple[str, str]]) -> str:  # fmt: skip
    """Return the text of a model: values of `free` or `known`, states (derivative, first value, unit), outputs."""
    lines = ["[model]", f'name = "{name}"', 'time = "continuous"', "[parameters]"]
    lines += [f"{key} = {text}" for key, text in values.items()]
    for key, (slope, first, unit) in states.items():
        lines += ["[[state]]", f'name = "{key}"', f'derivative = "{slope}"']
        lines += [f"initial = {{ value = {float(first)!r}, free = true }}", f'unit = "{unit}"']
    for key, (form, unit) in outputs.items():
        lines += ["[[output]]", f'name = "{key}"', f'equation = "{form}"', f'unit = "{unit}"']
    return "\n".join(lines) + "\n"


def state_space(step: float, inputs: Mapping[str, str], outputs: Mapping[str, str],
                matrices: Sequence[Array]) -> dict[str, Any]:  # fmt: skip
    """Return a linear model (A, B, C, D) without a gain; a step of 0 is continuous time."""
    a, b, c, d = (np.asarray(m) for m in matrices)
    count, seen = len(a), len(outputs)
    return {
        "kind": "state_space", "sample_time_s": step,
        "inputs": [{"name": name, "unit": unit} for name, unit in inputs.items()],
        "outputs": [{"name": name, "unit": unit} for name, unit in outputs.items()],
        "states": [{"name": f"x{i + 1}", "unit": ""} for i in range(count)],
        "A": a.tolist(), "B": b.tolist(), "C": c.tolist(), "D": d.tolist(),
        "K": np.zeros((count, seen)).tolist(), "x0": [0.0] * count,
        "innovation_covariance": np.eye(seen).tolist(), "scheduling": None,
    }  # fmt: skip
