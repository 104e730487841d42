"""Ask the diagnosis for the play of geared axes whose model has drive and load in one, and grade each answer.

    python tests/studies/geared_axes.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

A servo holds the shaft of its motor at a commanded angle; the load, of which angle and speed are recorded, hangs
between teeth with clearance. The challenge has one such rig with oil between its teeth; here the two bodies are
integrated apart from that: dry and oiled teeth, small and large plays, light and heavy loads, and one axis whose model
is complete. Declared values are 2 to 3 % off, sensors have 0.5 to 1 % of noise. Cases are written, diagnosed and graded
as those of second_author.py. Exit code 1 where an answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from second_author import Makers, run
from second_author_parts import Case, equations, free, known, plateaus

STEP, ROWS, FINE = 0.01, 6000, 40  # s a row, rows, Runge–Kutta steps a row
Array = np.ndarray[Any, np.dtype[np.float64]]


def turned(u: Array, *, J: float, share: float, width: float, film: float, contact: float, loss: float, k: float,
           d: float) -> Array:  # fmt: skip
    """Return angle and speed (N, 2) of a load with a share of the inertia J behind the play, at the rows.

    film, contact: damping rate and frequency, 1/s, of what is between the teeth and of the teeth; loss: their damping.
    """
    load, drive, pair = share * J, (1 - share) * J, J * share * (1 - share)

    def slope(z: Array, command: float) -> Array:
        q, v, p, w = z
        x, rate = p - q, w - v
        pressed = x - min(max(x, -width / 2), width / 2)
        damped = film + (2 * loss * contact if pressed else 0.0)
        torque = pair * (contact**2 * pressed + damped * rate)
        return np.array([v, (torque - 0.02 * v) / load, w, (k * (command - p) - d * w - torque) / drive])

    z, h, found = np.zeros(4), STEP / FINE, np.empty((len(u), 2))
    for i, command in enumerate(u.tolist()):
        found[i] = z[:2]
        for _ in range(FINE):
            a = slope(z, command)
            b = slope(z + h / 2 * a, command)
            c = slope(z + h / 2 * b, command)
            z = z + h / 6 * (a + 2 * b + 2 * c + slope(z + h * c, command))
    return found


def axis(
    rng: np.random.Generator, *, name: str, size: float, dwell: int, noise: float, off: tuple[float, float],
    **plant: float,
) -> Case:  # fmt: skip
    """Return a case; size: of the command's steps, rad; off: factors of the declared stiffness and damping."""
    u = plateaus(rng, ROWS, dwell, -size, size)
    y = turned(u, **plant)
    y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
    k, d = (plant[key] * factor for key, factor in zip("kd", off, strict=True))
    values = {
        "J": known(plant["J"], "kg m^2"), "k": free(k, k / 5, 5 * k, "N m/rad"),
        "d": free(d, d / 5, 5 * d, "N m s/rad"),
    }  # fmt: skip
    states = {"q": ("w", 0.0, "rad"), "w": ("(k*(command - q) - d*w)/J", 0.0, "rad/s")}
    width = plant["width"]
    return Case(
        name, STEP,
        {"command": (u, "rad", "input"), "angle": (y[:, 0], "rad", "output"), "speed": (y[:, 1], "rad/s", "output")},
        equations("geared axis", values, states, {"angle": ("q", "rad"), "speed": ("w", "rad/s")}),
        right=("backlash",) if width else (), values={"width": width} if width else {},
    )  # fmt: skip


def made(name: str, **facts: Any) -> Callable[[np.random.Generator], Case]:
    """Return what makes a case of this name."""
    return partial(axis, name=name, **facts)


AXES: Makers = {
    "dry_small": (401, made("dry_small", size=0.5, dwell=40, noise=0.005, off=(1.02, 0.97), J=0.02, share=0.6,
                            width=0.03, film=1.0, contact=700.0, loss=0.3, k=4.0, d=0.25)),
    "dry_heavy": (402, made("dry_heavy", size=0.8, dwell=60, noise=0.005, off=(0.98, 1.03), J=0.1, share=0.8,
                            width=0.08, film=3.0, contact=900.0, loss=0.5, k=25.0, d=1.2)),
    "oiled": (403, made("oiled", size=0.5, dwell=30, noise=0.01, off=(1.01, 1.02), J=0.05, share=0.3, width=0.05,
                        film=40.0, contact=600.0, loss=0.2, k=12.0, d=0.8)),
    "light_load": (404, made("light_load", size=0.4, dwell=50, noise=0.01, off=(1.03, 0.98), J=0.04, share=0.15,
                             width=0.04, film=10.0, contact=800.0, loss=0.3, k=15.0, d=0.6)),
    "null_axis": (405, made("null_axis", size=0.5, dwell=40, noise=0.005, off=(1.02, 0.98), J=0.03, share=0.5,
                            width=0.0, film=50.0, contact=900.0, loss=0.5, k=8.0, d=0.5)),
}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(AXES, "geared_axes", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
