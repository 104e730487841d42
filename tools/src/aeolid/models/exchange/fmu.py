"""Run a functional mock-up unit (FMI 1 to 3, co-simulation or model exchange) on given inputs."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.display import token, without_quotes
from aeolid.errors import Contradiction, DataError, NotIdentifiable

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fmu:
    """Hold a unit that was opened: its file, its variables by name (unit as declared, empty where none), its kind."""

    path: Path
    units: dict[str, str]
    causality: dict[str, str]
    description: Any

    def require(self, names: Sequence[str], causality: str, record_units: dict[str, str]) -> None:
        """Refuse names that the unit does not have as `causality`, or declares in another unit."""
        for name in names:
            if name not in self.units:
                known = ", ".join(n for n, c in self.causality.items() if c == causality) or "none"
                raise DataError(f"{self.path}: no {causality} {name!r}; the unit's {causality}s are {known}")
            if causality == "input" and self.causality[name] != "input":
                raise DataError(f"{self.path}: {name!r} is {self.causality[name]}, no input of the unit")
            declared, recorded = self.units[name].replace(" ", ""), record_units.get(name, "").replace(" ", "")
            if declared and recorded and declared != recorded:
                raise Contradiction(
                    f"{self.path}: {name} is in {self.units[name]!r}, the roles file says {record_units[name]!r};"
                    " convert one"
                )


def open_fmu(path: str | Path) -> Fmu:
    """Read the model description; raises DataError where the file is no unit or has no binary for this machine."""
    from fmpy import read_model_description, supported_platforms

    file = Path(path)
    if not file.is_file():
        raise DataError(f"{file}: no such file")
    try:
        description = read_model_description(str(file), validate=False)
        platforms = supported_platforms(str(file))
    except Exception as error:  # the reader raises what its parsers raise: zip, XML, its own
        raise DataError(f"{file}: not a functional mock-up unit ({token(without_quotes(str(error)), 160)})") from None
    if "linux64" not in platforms and "x86_64-linux" not in platforms and "c-code" not in platforms:
        raise DataError(f"{file}: built for {', '.join(platforms) or 'no platform'}; a Linux 64-bit binary is needed")
    units, causality = {}, {}
    for variable in description.modelVariables:
        units[variable.name] = variable.unit or ""
        causality[variable.name] = variable.causality or "local"
    return Fmu(file, units, causality, description)


def run_fmu(unit: Fmu, inputs: dict[str, Array], outputs: Sequence[str], step: float) -> Array:
    """Run from rest on inputs (N,) held over each step of `step` seconds; returns the outputs (N, l) at the samples.

    Raises NotIdentifiable where the unit fails or leaves the finite numbers, naming the time.
    """
    from fmpy import extract, simulate_fmu

    count = len(next(iter(inputs.values())))
    table = np.zeros(count, dtype=[("time", float), *((n, float) for n in inputs)])
    table["time"] = step * np.arange(count)
    for name, values in inputs.items():
        table[name] = values
    with tempfile.TemporaryDirectory() as folder:
        try:
            result = simulate_fmu(
                extract(str(unit.path), unzipdir=folder), model_description=_holding(unit, inputs), input=table,
                output=list(outputs), start_time=0.0, stop_time=float(table["time"][-1]), output_interval=step,
                step_size=step, record_events=False, validate=False, logger=lambda *_: None,
            )  # fmt: skip
        except Exception as error:  # whatever the unit or its loader reports
            raise NotIdentifiable(f"{unit.path}: the unit stopped: {error}") from None
    found = np.column_stack([np.asarray(result[name], float) for name in outputs])[:count]
    if len(found) < count or not np.all(np.isfinite(found)):
        last = len(found) if len(found) < count else int(np.argwhere(~np.isfinite(found))[0][0])
        raise NotIdentifiable(f"{unit.path}: the unit leaves the finite numbers (or ends) at {last * step:g} s")
    return found


def _holding(unit: Fmu, inputs: dict[str, Array]) -> Any:
    """Return the description with which inputs are held over a step.

    In model exchange the reader draws lines between the samples of what is declared continuous; declared discrete it
    holds them, each change an event. A step of a co-simulation holds them by itself.
    """
    if unit.description.coSimulation is not None:
        return unit.description
    description = copy(unit.description)
    description.modelVariables = [copy(v) for v in unit.description.modelVariables]
    for variable in description.modelVariables:
        if variable.name in inputs:
            variable.variability = "discrete"
    return description
