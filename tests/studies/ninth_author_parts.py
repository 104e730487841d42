"""What the systems of ninth_author.py share: steps of Runge and Kutta, turbulence, measurement chains, texts, runs.

The case, texts of models and declared values are those of second_author_parts.py. All that is random comes from the
generator that is passed, in the order of the calls. A case whose baseline is a simulator's run is a `Pair`, which has
the columns of its runs as well; `write_any` writes both sorts.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import second_author
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import butter, sosfilt, sosfilt_zi
from second_author_parts import Case, Column, equations, free, known
from textbook_plants import Array

Makers = dict[str, tuple[int, Callable[[np.random.Generator], Case]]]
Slope = Callable[[float, Sequence[float], Sequence[float]], Sequence[float]]
Command = Callable[[int, Sequence[float]], Sequence[float]]
LOOP = "closed_loop = true\n"
WT = "wind turbine"
_write_case = second_author.write


@dataclass(frozen=True)
class Pair(Case):
    """Hold a recording and one or several runs of the simulator that is held against it."""

    runs: tuple[Mapping[str, Column], ...] = field(default=())
    same_inputs: bool = False


def paired(case: Case, runs: Sequence[Mapping[str, Column]], same_inputs: bool = False) -> Pair:
    """Return a case whose baseline is runs with the columns given, in place of a model."""
    told = {key: getattr(case, key) for key in case.__dataclass_fields__}
    return Pair(**told, runs=tuple(runs), same_inputs=same_inputs)


def write_any(case: Case, folder: Path) -> None:
    """Write a case as second_author.py does; of a pair also the runs, and a case file that names them."""
    _write_case(case, folder)
    if not isinstance(case, Pair):
        return
    names = []
    for number, columns in enumerate(case.runs, 1):
        own = folder / f"of_run{number}"
        _write_case(replace(case, columns=columns, cuts=(), lost=0, gap=None), own)
        names.append(f"simulation{number}.csv")
        (own / "run1.csv").rename(folder / names[-1])
        for left in own.iterdir():
            left.unlink()
        own.rmdir()
    (folder / "model.json").unlink()
    text = (folder / "case.toml").read_text(encoding="utf-8")
    which = f"files = {json.dumps(names)}" if len(names) > 1 else f'file = "{names[0]}"'
    if case.same_inputs:
        which += "\nsame_inputs = true"
    text = text.replace('kind = "state_space"\nfile = "model.json"', f'kind = "run"\n{which}')
    (folder / "case.toml").write_text(text, encoding="utf-8")


def integrate(slope: Slope, start: Sequence[float], rows: int, step: float, command: Command, fine: int = 6,
              guard: Callable[[list[float]], None] | None = None) -> tuple[Array, Array]:  # fmt: skip
    """Integrate x' = slope(t, x, u) by classical steps, `fine` of them a row; u = command(row, x) is held for a row.

    After each step `guard` may change the state in place. Returns states and commands at the rows.
    """
    x, seen, given, h = [float(v) for v in start], [], [], step / fine
    for k in range(rows):
        u = [float(v) for v in command(k, x)]
        seen.append(list(x))
        given.append(u)
        for j in range(fine):
            t = k * step + j * h
            k1 = slope(t, x, u)
            k2 = slope(t + h / 2, [a + h / 2 * b for a, b in zip(x, k1, strict=True)], u)
            k3 = slope(t + h / 2, [a + h / 2 * b for a, b in zip(x, k2, strict=True)], u)
            k4 = slope(t + h, [a + h * b for a, b in zip(x, k3, strict=True)], u)
            x = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True)]
            if guard:
                guard(x)
    return np.array(seen), np.array(given)


def rates(slope: Slope, step: float, x: Array, u: Array) -> Array:
    """Return the slopes of all states at the rows."""
    return np.array([slope(k * step, a, b) for k, (a, b) in enumerate(zip(x.tolist(), u.tolist(), strict=True))])


def rows_of(u: Array) -> Command:
    """Return a command that is known beforehand, one row each."""
    table = np.atleast_2d(u.T).T.tolist()
    return lambda k, _: table[k]


def kaimal(rng: np.random.Generator, seconds: float, dt: float, mean: float, intensity: float, rotor: float) -> Array:
    """Return the wind over a rotor of this radius: Kaimal's spectrum of the length 340 m, smaller eddies averaged."""
    count = int(2 ** np.ceil(np.log2(seconds / dt + 2)))
    f = np.fft.rfftfreq(count, dt)
    spectrum = 4 * 340.2 / mean / (1 + 6 * f * 340.2 / mean) ** (5 / 3)
    spectrum /= (1 + (1.5 * f * rotor / mean) ** 2) ** (4 / 3)
    spectrum[0] = 0
    lines = np.sqrt(spectrum) * np.exp(2j * np.pi * rng.random(len(f)))
    lines[f > 1.5] = 0
    v = np.fft.irfft(lines, count)
    whole = np.sqrt(np.trapezoid(4 * 340.2 / mean / (1 + 6 * f * 340.2 / mean) ** (5 / 3), f))
    kept = np.sqrt(np.trapezoid(spectrum, f))
    return np.asarray(mean + v / np.std(v) * mean * intensity * kept / whole)


class Air:
    """A wind that is known at any time: turbulence and extreme operating gusts of IEC 61400-1 at given instants."""

    def __init__(self, rng: np.random.Generator, rows: int, step: float, mean: float, *, intensity: float = 0.12,
                 rotor: float = 40.0, gusts: Sequence[tuple[float, float]] = ()) -> None:  # fmt: skip
        """Draw the turbulence; gusts are instants in s and heights in m/s, each 10.5 s long."""
        self.h = step / 16
        count = 16 * rows + 40
        coarse = max(step / 2, 0.05)
        v = kaimal(rng, (rows + 4) * step + 60, coarse, mean, intensity, rotor)
        t = np.arange(count) * self.h
        found = CubicSpline(np.arange(len(v)) * coarse, v)(t)
        for begin, height in gusts:
            s = np.clip((t - begin) / 10.5, 0, 1)
            found = found - 0.37 * height * np.sin(3 * np.pi * s) * (1 - np.cos(2 * np.pi * s))
        self.all = found
        self.table = found.tolist()
        self.at = found[: 16 * rows : 16]

    def __call__(self, t: float) -> float:
        """Return the wind at a time, from the nearest of sixteen values a row."""
        return float(self.table[int(t / self.h + 0.5)])


def wander(rng: np.random.Generator, rows: int, lag: float, rms: float) -> Array:
    """Return what disturbs a process and nobody records: noise behind two lags, of so many rows and a third of it."""
    white = rng.standard_normal(rows + int(8 * lag) + 20)
    for tau in (max(lag, 0.5), max(lag / 3, 0.3)):
        a, last = np.exp(-1 / tau), 0.0
        for k, v in enumerate(white.tolist()):
            last = a * last + (1 - a) * v
            white[k] = last
    own = white[-rows:]
    return np.asarray(rms * own / np.std(own))


def stairs(rng: np.random.Generator, rows: int, shortest: int, longest: int, levels: Sequence[float]) -> Array:
    """Return steps among levels, none twice in a row, each kept for a random number of rows."""
    found: list[float] = []
    last = -1
    while len(found) < rows:
        last = int(rng.choice([k for k in range(len(levels)) if k != last]))
        found += [float(levels[last])] * int(rng.integers(shortest, longest + 1))
    return np.array(found[:rows])


def daq(rng: np.random.Generator, y: Array, ends: tuple[float, float], bits: int = 12, *, noise: float = 0.0,
        slow: float = 0.0, corner: float = 0.0, jitter: float = 0.0) -> Array:  # fmt: skip
    """Return what a converter of so many bits between its ends keeps of a signal.

    `noise` is a deviation in units of the signal, `slow` that of noise behind a lag of six rows. `corner` is that of a
    Butterworth filter of second order before the converter, in shares of the sampling rate, `jitter` in shares of a
    sample.
    """
    rows, read = len(y), np.asarray(y, dtype=float)
    if jitter or corner:
        whole = CubicSpline(np.arange(rows), read)
        if corner:
            sos = butter(2, corner / 10, output="sos")
            filtered = sosfilt(sos, whole(np.arange(20 * rows - 19) / 20), zi=sosfilt_zi(sos) * read[0])[0]
            whole = CubicSpline(np.arange(20 * rows - 19) / 20, filtered)
        read = whole(np.clip(np.arange(rows) + jitter * np.clip(rng.standard_normal(rows), -3, 3), 0, rows - 1))
    read = read + noise * rng.standard_normal(rows)
    if slow:
        read = read + wander(rng, rows, 6, slow)
    least = (ends[1] - ends[0]) / 2**bits
    return np.asarray(np.clip(np.round((read - ends[0]) / least) * least + ends[0], *ends))


def off(rng: np.random.Generator, value: float, most: float) -> float:
    """Return a value that is a third of `most` to `most` wrong, either way."""
    return float(f"{value * (1 + rng.choice([-1, 1]) * rng.uniform(most / 3, most)):.5g}")


def near(rng: np.random.Generator, true: Mapping[str, float], most: float, **units: str) -> dict[str, str]:
    """Return free values that are declared up to `most` off."""
    found = {}
    for key, value in true.items():
        low, high = sorted((value / 3, value * 3))
        found[key] = free(off(rng, value, most), float(f"{low:.3g}"), float(f"{high:.3g}"), units.get(key, ""))
    return found


def stands(true: Mapping[str, float], **units: str) -> dict[str, str]:
    """Return values that are declared as they are and not fitted."""
    return {key: known(value, units.get(key, "")) for key, value in true.items()}


def model_text(name: str, values: Mapping[str, str], helpers: Mapping[str, str],
               states: Mapping[str, tuple[str, float, str]], outputs: Mapping[str, tuple[str, str]],
               ) -> str:  # fmt: skip
    """Return the text of a model in which several equations share helpers."""
    text = equations(name, values, states, outputs)
    for key, form in helpers.items():
        text += f'[[auxiliary]]\nname = "{key}"\nequation = "{form}"\n'
    return text


def sampled(a: Array, b: Array, step: float) -> tuple[Array, Array]:
    """Return A and B in discrete time under held inputs."""
    n, r = b.shape
    whole = np.zeros((n + r, n + r))
    whole[:n, :n], whole[:n, n:] = a, b
    found = expm(whole * step)
    return found[:n, :n], found[:n, n:]
