"""Take models of any kind: objects of the interface, of the package below it, or names of files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from aeolid.api.session import public
from aeolid.errors import UsageError
from aeolid.record import Record

if TYPE_CHECKING:
    from aeolid.api.equations import Equations
    from aeolid.api.linear import LinearModel
    from aeolid.api.scheduled import ScheduledModel
    from aeolid.models.load import Model


class HasCore(Protocol):
    """Say what every model of the interface has."""

    @property
    def core(self) -> Model:
        """Return the model that runs."""
        ...


AnyModel = HasCore | str | Path


@public
def load_model(path: str | Path) -> LinearModel | ScheduledModel | Equations:
    """Read a model: model.json, .mat, .lin, model.toml, or a folder with one of them.

    Parameters
    ----------
    path : str or pathlib.Path
        The file or folder.

    Returns
    -------
    LinearModel, ScheduledModel or Equations

    Raises
    ------
    DataError
        Where the file is missing or is no model; the text names file and key or line.
    """
    from aeolid.api.equations import Equations
    from aeolid.api.linear import LinearModel
    from aeolid.api.scheduled import ScheduledModel
    from aeolid.models.equations import Equations as CoreEquations
    from aeolid.models.load import load_model as load
    from aeolid.models.lpv_prediction import LpvModel

    core = load(_named(path))
    if isinstance(core, CoreEquations):
        return Equations(core, source=str(path))
    facts, between = _stated(Path(path))
    if isinstance(core, LpvModel):
        return ScheduledModel(core.state_space, facts=facts, intersample=between, source=str(path))
    return LinearModel(core.state_space, facts=facts, intersample=between, source=str(path))  # type: ignore[attr-defined]


def core_of(model: Any) -> Model:
    """Return the model that runs; raises UsageError on anything else."""
    from aeolid.models.equations import Equations as CoreEquations
    from aeolid.models.load import LinearModel as CoreLinear
    from aeolid.models.lpv_prediction import LpvModel
    from aeolid.models.state_space import StateSpace

    if isinstance(model, str | Path):
        model = load_model(model)
    if isinstance(model, StateSpace):
        return CoreLinear(model)
    found: Any = getattr(model, "core", model)
    if not isinstance(found, CoreEquations | CoreLinear | LpvModel):
        raise UsageError(
            f"model is a {type(model).__name__}; a model is needed: of identify, Equations.load or load_model"
        )
    return found


def as_record(given: Any, what: str = "record") -> Record:
    """Return a recording; raises UsageError on anything else."""
    if isinstance(given, Record):
        return given
    remedy = "; Record.from_pandas makes one of it" if hasattr(given, "columns") else "; read and Record make one"
    raise UsageError(f"{what} is a {type(given).__name__}; a Record is needed{remedy}")


def as_records(given: Any) -> list[Record]:
    """Return one recording or several as a list; raises UsageError on anything else."""
    if isinstance(given, Sequence) and not isinstance(given, str):
        if not given:
            raise UsageError("records is empty; at least one recording is needed")
        return [as_record(one, f"records[{i}]") for i, one in enumerate(given)]
    return [as_record(given, "records")]


def _named(path: Any) -> Path:
    if not isinstance(path, str | Path):
        raise UsageError(f"path is a {type(path).__name__}; a str or pathlib.Path is needed")
    return Path(path)


def _stated(path: Path) -> tuple[dict[str, Any] | None, str | None]:
    """Return what an identification wrote beside the model: its facts, and how inputs go on within a sample."""
    from aeolid.models.state_space import read_json

    source = path / "model.json" if path.is_dir() else path
    data = read_json(source) if source.suffix == ".json" else {}
    facts, between = data.get("identification"), data.get("intersample")
    return facts if isinstance(facts, dict) else None, between if isinstance(between, str) else None
