"""Write a case around a small recording: equations, roles and data, as a user's folder has them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_case(
    folder: Path, model: str, step: float, channels: Sequence[tuple[str, str, str]], rows: NDArray[np.float64]
) -> Path:
    """Write model (TOML) and rows (N, c), sampled every step s, c channels of (name, unit, role); returns folder."""
    (folder / "model.toml").write_text(model)
    (folder / "case.toml").write_text(
        '[case]\ntitle = "bench"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        '[baseline]\nkind = "equations"\nfile = "model.toml"\n[context]\nmachine = "test bench"\n'
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
