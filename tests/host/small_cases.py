"""Write a case around a small recording: equations, roles and data, as a user's folder has them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

SWING_CHANNELS = (("push", "N", "input"), ("position", "m", "output"), ("speed", "m/s", "output"))
SWING = """[model]
name = "a swing"
[parameters]
m = { value = 1.0, unit = "kg" }
k = { value = 40.0, unit = "N/m", min = 4.0, max = 400.0, free = true }
c = { value = 1.0, unit = "N s/m", min = 0.1, max = 10.0, free = true }
[[input]]
name = "push"
unit = "N"
[[state]]
name = "q"
unit = "m"
derivative = "v"
[[state]]
name = "v"
unit = "m/s"
derivative = "(push - c*v - k*q)/m"
[[output]]
name = "position"
unit = "m"
equation = "q"
[[output]]
name = "speed"
unit = "m/s"
equation = "v"
"""


def write_case(
    folder: Path, model: str, step: float, channels: Sequence[tuple[str, str, str]], rows: NDArray[np.float64],
    *, kind: str = "equations",
) -> Path:  # fmt: skip
    """Write model (text) and rows (N, c), sampled every step s, c channels of (name, unit, role); returns folder."""
    file = "model.toml" if kind == "equations" else "model.json"
    (folder / file).write_text(model)
    (folder / "case.toml").write_text(
        '[case]\ntitle = "bench"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{kind}"\nfile = "{file}"\n[context]\nmachine = "test bench"\n'
    )
    (folder / "roles.toml").write_text(
        '[recording]\ntime = "time_s"\n'
        + "".join(f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "{r}"\n' for n, u, r in channels)
    )
    np.savetxt(
        folder / "recording.csv", np.column_stack([step * np.arange(len(rows)), rows]), delimiter=",", fmt="%.9g",
        comments="", header=",".join(["time_s", *(n for n, _, _ in channels)]),
    )  # fmt: skip
    return folder


SWING_STEP, SAMPLES = 0.02, 5000


def swinging(folder: Path, seed: int = 3, **hidden: float) -> Path:
    """Write a case: 100 s at 50 Hz of a swing pushed at random, gusts on top; Runge-Kutta, 2 steps a sample.

    bend: of the push's action above 5 N; shake: share of the stiffness that swings at 0.37 Hz; teeth: force in N that
    repeats every 0.05 m; stiffer: N/m for every N of push; relaxing: N/m of a spring behind a dashpot, 0.5 s; eddies: N
    of a force in a narrow band around 2.3 Hz, damping 0.02; hard: N/m³ of the spring; softening: share of the stiffness
    that goes evenly over the recording.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    bend, shake = hidden.get("bend", 0.0), hidden.get("shake", 0.0)
    teeth, stiffer = hidden.get("teeth", 0.0), hidden.get("stiffer", 0.0)
    relaxing, hard = hidden.get("relaxing", 0.0), hidden.get("hard", 0.0)
    push = np.repeat(rng.uniform(-16.0, 16.0, SAMPLES // 10), 10)
    gust = 0.4 * rng.standard_normal(SAMPLES)
    if hidden.get("eddies"):
        gust += hidden["eddies"] * narrow(rng.standard_normal(SAMPLES), 2.3, 0.02)
    rows, x, h = np.empty((SAMPLES, 3)), np.zeros(3), SWING_STEP / 2

    def slope(x: Any, u: float, t: float) -> Any:
        gone = hidden.get("softening", 0.0) * (t / (SAMPLES * SWING_STEP) - 0.5)
        k = 40.0 * (1 + shake * np.sin(2 * np.pi * 0.37 * t) - gone) + stiffer * u
        force = u + bend * max(u - 5.0, 0.0) - x[1] - k * x[0] - teeth * np.sin(2 * np.pi * x[0] / 0.05)
        return np.array([x[1], force - hard * x[0] ** 3 - relaxing * x[2], x[1] - x[2] / 0.5])

    for i in range(SAMPLES):
        rows[i] = push[i], x[0], x[1]
        u = push[i] + gust[i]
        for part in range(2):
            t = i * SWING_STEP + part * h
            k1 = slope(x, u, t)
            k2 = slope(x + h / 2 * k1, u, t + h / 2)
            k3 = slope(x + h / 2 * k2, u, t + h / 2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3, u, t + h))
    rows[:, 1:] += rng.standard_normal((SAMPLES, 2)) * (1e-3, 5e-3)
    return write_case(folder, SWING, SWING_STEP, SWING_CHANNELS, rows)


def narrow(noise: NDArray[np.float64], frequency_hz: float, damping: float) -> NDArray[np.float64]:
    """Return white noise behind a resonance, of unit deviation."""
    pole = np.exp(2 * np.pi * frequency_hz * SWING_STEP * complex(-damping, np.sqrt(1 - damping**2)))
    band = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], noise)
    return np.asarray(band / np.std(band))
