"""What the systems of third_author.py share: steps of Runge and Kutta, commands, noise and declared values.

All that is random comes from the generator that is passed, in the order of the calls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from second_author_parts import Tones, free
from textbook_plants import Array

Slope = Callable[[float, Sequence[float], Sequence[float]], Sequence[float]]
Command = Callable[[int, Sequence[float]], Sequence[float] | Array]


def rk(slope: Slope, start: Sequence[float], rows: int, step: float, command: Command, fine: int = 8,
       after: Callable[[list[float]], None] | None = None) -> tuple[Array, Array]:  # fmt: skip
    """Integrate x' = slope(t, x, u) by `fine` Runge-Kutta steps a row, u = command(row, x) held; after each, `after`.

    Returns states and commands at the rows.
    """
    x, states, commands, h = [float(v) for v in start], [], [], step / fine
    for k in range(rows):
        u = [float(v) for v in command(k, x)]
        states.append(list(x))
        commands.append(u)
        for j in range(fine):
            t = k * step + j * h
            a = slope(t, x, u)
            b = slope(t + h / 2, [p + h / 2 * q for p, q in zip(x, a, strict=True)], u)
            c = slope(t + h / 2, [p + h / 2 * q for p, q in zip(x, b, strict=True)], u)
            d = slope(t + h, [p + h * q for p, q in zip(x, c, strict=True)], u)
            x = [p + h / 6 * (q + 2 * r + 2 * s + w) for p, q, r, s, w in zip(x, a, b, c, d, strict=True)]
            if after:
                after(x)
    return np.array(states), np.array(commands)


def told(u: Array) -> Command:
    """Return a command that is known beforehand, (N,) or (N, r)."""
    u = u if u.ndim > 1 else u[:, None]
    return lambda k, _: u[k]


def looked_up(tones: Tones, rows: int, step: float, fine: int) -> Callable[[float], float]:
    """Return sines at any half fine step from a table, which is quicker."""
    h = step / fine / 2
    table = np.asarray(tones(np.arange(2 * fine * rows + 3) * h)).tolist()
    return lambda t: float(table[int(t / h + 0.5)])


def white(rng: np.random.Generator, y: Array, std: float) -> Array:
    """Return a signal with white noise of this deviation."""
    return np.asarray(y + std * rng.standard_normal(len(y)))


def off(
    rng: np.random.Generator, true: Mapping[str, float], least: float = 0.02, most: float = 0.10, **units: str
) -> dict[str, str]:  # fmt: skip
    """Return free values that are declared `least` to `most` off, between a quarter and four times the true ones."""
    found = {}
    for key, v in true.items():
        declared = float(f"{v * (1 + rng.choice([-1, 1]) * rng.uniform(least, most)):.3g}")
        low, high = sorted((v / 4, v * 4))
        found[key] = free(declared, float(f"{low:.3g}"), float(f"{high:.3g}"), units.get(key, ""))
    return found
