"""Read a linear model from any file that holds one."""

from __future__ import annotations

from pathlib import Path

from aeolid.errors import DataError
from aeolid.models import state_space
from aeolid.models.state_space import StateSpace

FOREIGN = (".mat", ".lin")


def read_state_space(path: str | Path, sample_time_s: float | None = None) -> StateSpace:
    """Read model.json, a MATLAB file or an OpenFAST linearisation, told by the suffix.

    sample_time_s: for a .mat file that does not say its own. Raises DataError that names file and entry or line.
    """
    return read_with_notes(path, sample_time_s)[0]


def read_with_notes(path: str | Path, sample_time_s: float | None = None) -> tuple[StateSpace, tuple[str, ...]]:
    """Return the model as `read_state_space` does, and what the file says it is not good for."""
    suffix = Path(path).suffix.lower()
    if suffix == ".mat":
        from aeolid.models.exchange.matlab import read_mat_model

        return read_mat_model(path, sample_time_s), ()
    if suffix == ".lin":
        from aeolid.models.exchange.openfast import read_lin

        found = read_lin(path)
        return found.model, found.notes()
    if suffix == ".toml":
        raise DataError(f"{path}: equations; a linear model (.json, .mat or .lin) is needed here")
    return state_space.from_json(state_space.read_json(path), str(path)), ()
