"""Read what is to be simulated elsewhere: equations as they are, a linear model as equations."""

from __future__ import annotations

from pathlib import Path

from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.exchange.files import read_state_space
from aeolid.models.exchange.linear_equations import linear_equations
from aeolid.models.load import discretise


def equations_to_simulate(path: Path, sample_time_s: float | None) -> Equations:
    """Read model.toml, a linear model's file, or the one of model.toml and model.json that a folder holds.

    sample_time_s: at which a linear model of continuous time is made one of discrete time, inputs held, s; None leaves
    it. Raises DataError that names file and key or line.
    """
    file = path
    if path.is_dir():
        found = [p for p in (path / "model.json", path / "model.toml") if p.exists()]
        if len(found) != 1:
            raise DataError(f"{path}: the folder holds {len(found)} of model.json and model.toml, one is needed")
        file = found[0]
    if file.suffix == ".toml":
        return equations_file.load(file)
    linear = read_state_space(file, sample_time_s)
    if sample_time_s and not linear.sample_time_s:
        linear = discretise(linear, sample_time_s)
    return linear_equations(linear, str(file))
