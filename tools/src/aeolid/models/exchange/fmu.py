"""Run a functional mock-up unit (FMI 1 to 3, co-simulation or model exchange) on given inputs, in a box."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Failure, Limits, Reply, call
from aeolid.confined.limits import MIB
from aeolid.errors import Contradiction, DataError, NotIdentifiable
from aeolid.models.exchange.fmu_unpack import unpack
from aeolid.units import conversion

Array = NDArray[np.float64]
_CHILD = "aeolid.models.exchange.fmu_child"
# A description of 16 MiB as a tree of Python objects takes half a gigabyte.
_READING = Limits(memory=1024 * MIB, cpu_s=60, patience_s=120.0, result=64 * MIB)
# What a plant model may take; it may neither write a file, start a program nor open a connection.
RUNNING = Limits(memory=2048 * MIB, cpu_s=1800, patience_s=1800.0, result=512 * MIB, mapped=4096 * MIB)


@dataclass(frozen=True, eq=False)
class Fmu:
    """Hold a unit that was looked at: its file, its variables by name (unit as declared, empty where none), causality.

    Nothing of it has run: that is only what `run_fmu` does.
    """

    path: Path
    units: dict[str, str]
    causality: dict[str, str]

    def require(self, names: Sequence[str], causality: str, record_units: dict[str, str]) -> None:
        """Refuse names that the unit does not have as `causality`, or declares in another unit."""
        for name in names:
            if name not in self.units:
                known = ", ".join([n for n, c in self.causality.items() if c == causality][:20]) or "none"
                raise DataError(f"{self.path}: no {causality} {name!r}; the unit's {causality}s are {known}")
            if causality == "input" and self.causality[name] != "input":
                raise DataError(f"{self.path}: {name!r} is {self.causality[name]}, no input of the unit")
            declared, recorded = self.units[name].replace(" ", ""), record_units.get(name, "").replace(" ", "")
            if declared and recorded and declared != recorded:
                raise Contradiction(
                    f"{self.path}: {name} is in {self.units[name]!r}, the roles file says {record_units[name]!r};"
                    f" {conversion(record_units[name], self.units[name])}, or correct its unit in the roles file"
                )


def open_fmu(path: str | Path) -> Fmu:
    """Read the description of a unit; nothing of the unit itself is run.

    Raises DataError where the file is no unit, has no library for this machine or unpacks to too much.
    """
    file = Path(path)
    try:
        facts, _ = _in_box(file, "describe", {}, _READING)
    except Failure as failure:
        raise DataError(f"{file}: not a functional mock-up unit ({failure})") from None
    variables: list[list[str]] = facts["variables"]
    return Fmu(file, {n: unit for n, unit, _ in variables}, {n: causality for n, _, causality in variables})


def run_fmu(unit: Fmu, inputs: dict[str, Array], outputs: Sequence[str], step: float) -> Array:
    """Run from rest on inputs (N,) held over each step of `step` seconds; returns the outputs (N, l) at the samples.

    Runs native code that came with the unit, in a process that may only compute (the limits are `RUNNING`). Raises
    NotIdentifiable where the unit fails or leaves the finite numbers, naming the time.
    """
    u = np.column_stack(list(inputs.values())).astype(float)
    arguments = {"inputs": list(inputs), "outputs": list(outputs), "step": float(step)}
    try:
        _, arrays = _in_box(unit.path, "simulate", arguments, RUNNING, {"u": u})
    except (Failure, NotIdentifiable) as error:
        raise NotIdentifiable(f"{unit.path}: {error}") from None
    found = np.asarray(arrays.get("y"), dtype=float)
    if found.ndim != 2 or found.shape[1] != len(outputs) or len(found) > len(u):
        raise NotIdentifiable(f"{unit.path}: the unit's results have the wrong shape")
    if len(found) < len(u) or not np.all(np.isfinite(found)):
        last = len(found) if len(found) < len(u) else int(np.argwhere(~np.isfinite(found))[0][0])
        raise NotIdentifiable(f"{unit.path}: the unit leaves the finite numbers (or ends) at {last * step:g} s")
    return found


def _in_box(
    path: Path, function: str, arguments: Mapping[str, Any], limits: Limits, arrays: Mapping[str, Array] | None = None
) -> Reply:
    """Call one function of the child on the unpacked unit, in a folder that goes with the call."""
    with tempfile.TemporaryDirectory(prefix="aeolid-fmu-") as folder:
        unpack(path, Path(folder))
        return call(f"{_CHILD}:{function}", {"folder": folder, **arguments}, limits, arrays)
