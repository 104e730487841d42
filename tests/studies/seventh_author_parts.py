"""What the systems of seventh_author.py share: recordings that each begin from rest, linear models.

Steps of Runge and Kutta, commands and tones are those of third_author_parts.py, loggers and gusts those of
fourth_author_parts.py, ramps and fixed values those of sixth_author_parts.py. All that is random comes from the
generator that is passed, in the order of the calls. Every case has the true values of its model in `true`, but for
linear models, whose matrices are made of numbers that went through `skewed`: there the true ones are those without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from scipy.signal import cont2discrete
from textbook_plants import Array
from third_author_parts import Command, Slope, rk


def _later(slope: Slope, begun: float, t: float, x: Sequence[float], u: Sequence[float]) -> Sequence[float]:
    """Return the slope at a time after the recording that began then."""
    return slope(begun + t, x, u)


def _shifted(command: Command, begun: int, k: int, x: Sequence[float]) -> Sequence[float] | Array:
    """Return the command at a row after the recording that began there."""
    return command(begun + k, x)


def started(
    slope: Slope, start: Sequence[float], lengths: Sequence[int], step: float, command: Command, fine: int = 8
) -> tuple[Array, Array]:
    """Return states and commands of recordings of these rows, each of which begins at `start`; time runs on."""
    states, commands, begun = [], [], 0
    for rows in lengths:
        x, u = rk(partial(_later, slope, begun * step), start, rows, step, partial(_shifted, command, begun), fine)
        states.append(x)
        commands.append(u)
        begun += rows
    return np.vstack(states), np.vstack(commands)


def begun(lengths: Sequence[int]) -> tuple[int, ...]:
    """Return the rows at which the second and later recordings of these lengths begin."""
    return tuple(int(k) for k in np.cumsum(lengths)[:-1])


def between(values: Array, step: float) -> Callable[[float], float]:
    """Return what runs straight from one row to the next, at any time."""
    table = [*values.tolist(), float(values[-1]), float(values[-1])]

    def read(t: float) -> float:
        k = int(t / step)
        return float(table[k] + (table[k + 1] - table[k]) * (t / step - k))

    return read


def sampled(a: Array, b: Array, c: Array, step: float) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C, D in discrete time of a plant that sees no input at once, its inputs held."""
    d = np.zeros((c.shape[0], b.shape[1]))
    found = cont2discrete((a, b, c, d), step, "zoh")
    return found[0], found[1], found[2], found[3]


def twisting(inertias: tuple[float, float], spring: float, damping: float, drag: float) -> tuple[Array, Array]:
    """Return A and B of two discs on an elastic shaft: speed of the first, of the second, twist; torque on the first.

    The second one has the drag.
    """
    first, second = inertias
    a = np.array([[-damping / first, damping / first, -spring / first],
                  [damping / second, -(damping + drag) / second, spring / second], [1.0, -1.0, 0.0]])  # fmt: skip
    return a, np.array([[1 / first], [0.0], [0.0]])
