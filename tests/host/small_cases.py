"""Write a case around a small recording: equations, roles and data, as a user's folder has them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
