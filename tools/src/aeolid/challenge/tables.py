"""Write the files of a case: no account is kept beside them, the folder is new and its answers are sealed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aeolid import output


def write_file(path: Path, text: str) -> None:
    """Write a file of a case."""
    output.write_text(path, text, durable=False, own=True)


def write_table(path: Path, columns: Mapping[str, Any], channels: list[tuple[str, str, str, str]]) -> None:
    """Write a recording; channels: name, column of the simulation, unit and role."""
    table = np.column_stack([columns["time_s"], *(columns[c] for _, c, _, _ in channels)])
    lines = [",".join(["time_s", *(n for n, _, _, _ in channels)])]
    lines += [",".join(f"{x:.8g}" for x in row) for row in table]
    write_file(path, "\n".join(lines) + "\n")


def names_of(runs: int) -> list[str]:
    """Return the names of the recordings of a case."""
    return ["recording.csv"] if runs == 1 else [f"recording_{i + 1:02d}.csv" for i in range(runs)]


def write_roles(path: Path, channels: list[tuple[str, str, str, str]]) -> None:
    """Write the roles file of a recording."""
    rows = [f'[[channel]]\nname = "{n}"\nunit = "{u}"\nrole = "{r}"\n' for n, _, u, r in channels]
    write_file(path, '[recording]\ntime = "time_s"\n' + "".join(rows))
