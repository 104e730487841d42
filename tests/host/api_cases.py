"""Write a shaft whose drag a model leaves out: the four files of a user's folder."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

STEP, SAMPLES, DRAG = 0.1, 600, 0.4  # s; per speed
MODEL = """[model]
name = "shaft"
[parameters]
g = { value = 2.0, unit = "1/s", min = 0.5, max = 8.0, free = true }
T = { value = 0.8, unit = "s", min = 0.1, max = 5.0, free = true }
[[input]]
name = "pitch"
unit = "deg"
[[state]]
name = "speed"
unit = "rpm"
derivative = "(g*pitch - speed)/T"
[[output]]
name = "rotor_speed"
unit = "rpm"
equation = "speed"
"""
ROLES = """[[channel]]
name = "pitch"
unit = "deg"
role = "input"
[[channel]]
name = "rotor_speed"
unit = "rpm"
role = "output"
"""
UNITS = {"pitch": "deg", "rotor_speed": "rpm"}


def shaft(seed: int, samples: int = SAMPLES, drag: float = DRAG) -> NDArray[np.float64]:
    """Return pitch and rotor_speed (N, 2) of 0.8 dx/dt = 2 u − x − drag |x| x with noise on state and sensor; Euler."""
    rng = np.random.default_rng(seed)
    u, x = np.repeat(rng.uniform(-1, 1, samples // 8 + 1), 8)[:samples], 0.0
    rows = np.empty((samples, 2))
    for k in range(samples):
        rows[k] = u[k], x + 0.005 * rng.standard_normal()
        for _ in range(10):
            x += STEP / 10 * (2.0 * u[k] - x - drag * abs(x) * x) / 0.8
        x += 0.01 * rng.standard_normal()
    return rows


def write_outb(path: Path, rows: NDArray[np.float64]) -> None:
    """Write kind 4 of OpenFAST's binary output, 16-bit numbers and names of 16 letters, as its description says."""
    low, high = rows.min(axis=0), rows.max(axis=0)
    scale = 65000.0 / (high - low)
    offset = -32500.0 - scale * low
    texts = ["Time", *UNITS, "(s)", *(f"({unit})" for unit in UNITS.values())]
    parts = [struct.pack("<hhiidd", 4, 16, rows.shape[1], len(rows), 0.0, STEP), scale.astype("<f4").tobytes()]
    parts += [offset.astype("<f4").tobytes(), struct.pack("<i", 5) + b"shaft"]
    parts += [text.ljust(16).encode() for text in texts] + [np.round(scale * rows + offset).astype("<i2").tobytes()]
    path.write_bytes(b"".join(parts))


def write_folder(folder: Path) -> None:
    """Write all four files."""
    write_outb(folder / "monday.outb", shaft(1))
    write_outb(folder / "tuesday.outb", shaft(2))
    (folder / "roles.toml").write_text(ROLES)
    (folder / "model.toml").write_text(MODEL)
