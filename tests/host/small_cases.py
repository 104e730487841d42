"""Write a case around a small recording: equations, roles and data, as a user's folder has them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


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
