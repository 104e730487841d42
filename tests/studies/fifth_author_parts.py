"""What the systems of fifth_author.py share: what nobody records, how a logger reads, and declared values.

Steps of Runge and Kutta, commands and tones are those of third_author_parts.py, loggers and gusts those of
fourth_author_parts.py. All that is random comes from the generator that is passed, in the order of the calls. Every
case has the true values of its model in `true`, but for linear models, whose matrices are made of numbers that went
through `skewed`: there the true ones are those without it. Without gusts, hiss and logger (`gust`, `hiss`, `logged`,
`frozen`) and at true values the models of the nulls are the machines; own/check_set.py shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from fourth_author_parts import LOOP, WT, declared, gust, hiss, logged
from second_author_parts import smooth
from textbook_plants import Array

__all__ = ["LOOP", "WT", "declared", "frozen", "gust", "hiss", "logged", "modes", "skewed", "slopes", "turning"]


def frozen(rng: np.random.Generator, y: Array, count: int, long: int) -> Array:
    """Return a reading that stands `count` times for half to one `long` rows, as that of a logger that hangs."""
    y = np.array(y, dtype=float)
    for place in rng.choice(np.arange(60, len(y) - 2 * long, 2 * long), count, replace=False):
        y[place : place + int(rng.integers(long // 2, long + 1))] = y[place]
    return y


def skewed(rng: np.random.Generator, value: float, most: float) -> float:
    """Return a number of a linear model that is declared a quarter of `most` to `most` off, either way."""
    return float(value * (1 + rng.choice([-1, 1]) * rng.uniform(most / 4, most)))


def slopes(slope: Callable[..., Sequence[float]], step: float, x: Array, u: Array) -> Array:
    """Return the slopes of all states at the rows."""
    rows = zip(x.tolist(), u.tolist(), strict=True)
    return np.array([slope(k * step, a, b) for k, (a, b) in enumerate(rows)])


def turning(rng: np.random.Generator, rows: int, step: float, mean: float, rms: float) -> Array:
    """Return the angle of a rotor at the rows, its speed until the next, and the time of the row (N, 3)."""
    speed = mean + smooth(rng, rows, 9 / step, rms)
    angle = rng.uniform(0, 6) + np.r_[0, np.cumsum(speed)[:-1]] * step
    return np.column_stack([angle, speed, np.arange(rows) * step])


def modes(w: Sequence[float], ratio: Sequence[float], drive: Array, seen: Array) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of modes q'' + 2 z w q' + w^2 q = drive u, of which the outputs see positions."""
    n, a, z = len(w), np.asarray(w), np.asarray(ratio)
    low = np.hstack([-np.diag(a**2), -np.diag(2 * z * a)])
    top = np.hstack([np.zeros((n, n)), np.eye(n)])
    return (np.vstack([top, low]), np.vstack([np.zeros_like(drive), drive]), np.hstack([seen, np.zeros_like(seen)]),
            np.zeros((len(seen), drive.shape[1])))  # fmt: skip
