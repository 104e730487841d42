"""What the systems of sixth_author.py share: fixed values that are off, sweeps, ramps, accelerations of linear modes.

Steps of Runge and Kutta, commands and tones are those of third_author_parts.py, loggers and gusts those of
fourth_author_parts.py. All that is random comes from the generator that is passed, in the order of the calls. Every
case has the true values of its model in `true`, but for linear models, whose matrices are made of numbers that went
through `skewed`: there the true ones are those without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from fifth_author_parts import LOOP, WT, declared, gust, hiss, logged, modes, skewed, slopes, turning
from numpy.typing import NDArray
from second_author_parts import known, plateaus
from textbook_plants import Array

__all__ = ["LOOP", "WT", "declared", "fixed", "gust", "hiss", "logged", "modes", "ramps", "shaken", "skewed", "slopes",
           "sweep", "tabled", "turning"]  # fmt: skip


def fixed(rng: np.random.Generator, value: float, unit: str = "", most: float = 0.03) -> str:
    """Return a declared constant, such as a mass off a drawing, that is up to `most` off and not fitted."""
    return known(float(f"{skewed(rng, value, most):.4g}"), unit)


def sweep(low: float, high: float, span: float, height: float) -> Callable[[NDArray[np.float64]], Array]:
    """Return a sine whose frequency grows from low to high, in hertz, by the same factor each second."""
    rate = np.log(high / low) / span
    return lambda t: np.asarray(height * np.sin(2 * np.pi * low / rate * np.expm1(rate * np.asarray(t))))


def tabled(
    signal: Callable[[NDArray[np.float64]], Array], rows: int, step: float, fine: int
) -> Callable[[float], float]:
    """Return a signal at any half fine step from a table, which is quicker."""
    h = step / fine / 2
    table = np.asarray(signal(np.arange(2 * fine * rows + 3) * h)).tolist()
    return lambda t: float(table[int(t / h + 0.5)])


def ramps(rng: np.random.Generator, rows: int, dwell: int, ends: tuple[float, float], most: float) -> Array:
    """Return levels as an operator asks for them, each reached by a ramp of at most so much a row."""
    aims = plateaus(rng, rows, dwell, *ends)
    found = [float(aims[0])]
    for aim in aims[1:].tolist():
        found.append(found[-1] + max(min(aim - found[-1], most), -most))
    return np.array(found)


def shaken(w: Sequence[float], ratio: Sequence[float], drive: Array, seen: Array) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D of modes q'' + 2 z w q' + w^2 q = drive u, of which the outputs see accelerations."""
    a, b, _, _ = modes(w, ratio, drive, seen)
    n = len(w)
    return a, b, seen @ a[n:], seen @ drive
