"""What the systems of eighth_author.py share: binary sequences, sums of harmonics, earthquakes, linear models.

Steps of Runge and Kutta, commands and tones are those of third_author_parts.py, loggers and gusts those of
fourth_author_parts.py, linear models in discrete time those of seventh_author_parts.py. All that is random comes from
the generator that is passed, in the order of the calls. Equations have their true values in `true`; linear models are
made of numbers that went through `skewed`, and there the true ones are those without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from fifth_author_parts import skewed
from scipy.signal import lfilter
from second_author_parts import Case, Tones
from textbook_plants import Array

Makers = dict[str, tuple[int, Callable[[np.random.Generator], Case]]]


def prbs(rng: np.random.Generator, rows: int, dwell: int, low: float, high: float) -> Array:
    """Return a binary sequence of a shift register of eleven bits that starts anywhere, each bit kept `dwell` rows."""
    bits = [int(b) for b in rng.integers(0, 2, 11)]
    bits[0] = 1
    found: list[float] = []
    while len(found) < rows:
        found += [high if bits[-1] else low] * dwell
        bits = [bits[10] ^ bits[8], *bits[:-1]]
    return np.array(found[:rows])


def levels(rng: np.random.Generator, rows: int, dwell: int, values: Sequence[float]) -> Array:
    """Return steps between a few set points, each kept `dwell` rows, none twice in a row."""
    found: list[float] = []
    last = -1
    while len(found) < rows:
        last = int(rng.choice([k for k in range(len(values)) if k != last]))
        found += [values[last]] * dwell
    return np.array(found[:rows])


def harmonics(
    rng: np.random.Generator, first: int, last: int, base: float, rms: float, mean: float = 0.0, every: int = 1
) -> Tones:
    """Return a multisine that repeats: harmonics first to last of a base in hertz, random phases."""
    lines: Array = np.arange(first, last + 1, every).astype(np.float64)
    height = rms * np.sqrt(2 / len(lines))
    speeds: Array = np.asarray(2 * np.pi * base * lines, dtype=np.float64)
    return Tones(speeds, rng.uniform(0, 2 * np.pi, len(lines)), float(height), mean)


def quake(rng: np.random.Generator, rows: int, step: float, shocks: Sequence[tuple[float, float, float]]) -> Array:
    """Return accelerations of the ground: noise about 2 Hz under envelopes of a start, a length in s and a height."""
    t, w = np.arange(rows) * step, 2 * np.pi * 2.0
    a = [1, -2 * np.exp(-0.6 * w * step) * np.cos(0.8 * w * step), np.exp(-1.2 * w * step)]
    shape = lfilter([1, -1], a, rng.standard_normal(rows + 400))[400:]
    rise = np.full(rows, 0.02)
    for begin, long, height in shocks:
        s = np.maximum(t - begin, 0) / long
        rise += height * s**2 * np.exp(2 * (1 - s))
    return np.asarray(rise * shape / np.std(shape))


def each(rng: np.random.Generator, values: Sequence[float], most: float) -> list[float]:
    """Return several numbers of a linear model, each skewed by itself."""
    return [skewed(rng, v, most) for v in values]


def behind(a: Array, b: Array, c: Array, count: int) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D in discrete time with one input that reaches the plant `count` samples later."""
    n, size = len(a), len(a) + count
    wide = np.zeros((size, size))
    wide[:n, :n] = a
    wide[:n, n : n + 1] = b
    wide[n : size - 1, n + 1 :] = np.eye(count - 1)
    drive = np.zeros((size, 1))
    drive[-1, 0] = 1.0
    return wide, drive, np.hstack([c, np.zeros((len(c), count))]), np.zeros((len(c), 1))
