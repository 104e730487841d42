"""Write a model as a functional mock-up unit from Python."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.models.equations import Equations


def written_unit(path: Path, equations: Equations, sample_time: float, source: str) -> tuple[str, ...]:
    """Write the unit, named after the file; returns what it leaves out. Raises UsageError on another suffix."""
    from aeolid.models.exchange.c_simulation import as_identifier
    from aeolid.models.exchange.fmu_write import write_fmu

    if path.suffix != ".fmu":
        raise UsageError(f"{path}: a functional mock-up unit is written as .fmu")
    return write_fmu(path, equations, sample_time, name=as_identifier(path.stem), source=Path(source).name)
