"""Diagnose models against recordings."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api.diagnosis import Diagnosis
from aeolid.api.models import as_records, core_of
from aeolid.api.progress import Progress, Show, shown
from aeolid.api.session import public
from aeolid.durations import seconds_given
from aeolid.errors import Contradiction, UsageError
from aeolid.record import Record

if TYPE_CHECKING:
    from aeolid.api.from_diagnose import Case
    from aeolid.api.models import HasCore


@public
def diagnose(
    records: Record | Sequence[Record],
    baseline: HasCore | Record | Sequence[Record] | str | Path,
    *,
    title: str = "diagnosis",
    context: Mapping[str, Any] | None = None,
    same_inputs: bool = False,
    sham: int = 20,
    seed: int = 1,
    time_limit: float | str = 3600.0,
    progress: Progress = None,
) -> Diagnosis:
    """Locate what a model leaves out, name it, model it and prove it on sealed data.

    The same as `aeolid diagnose`, without a folder: same recordings, model and seed, same answer. A last part of the
    recordings is sealed before anything is fitted, and what is found is tested on it.

    Parameters
    ----------
    records : Record or sequence of Record
        One recording, or several of the same machine.
    baseline : Equations, LinearModel, Record, sequence of Record, or name of a model file
        What is doubted: equations, a state-space model, or a simulator's run as a recording of the same channels, or
        several runs in other wind.
    title : str
        What the report calls the diagnosis.
    context : mapping, optional
        What is known of the machine, as [context] of case.toml: machine, blades, rated_speed_rad_s,
        gearbox_ratio, offshore, closed_loop.
    same_inputs : bool
        Whether a simulator's run had the recorded inputs and wind, sample by sample. Only for a baseline that is one
        run; a model is always given the recorded inputs.
    sham : int
        Null simulations of the whole procedure, 0 to 1000; none are made where the baseline is a run.
    seed : int
        Seed of the bootstrap and the null runs.
    time_limit : float or str
        Seconds, or a time with a unit ("10min"), after which the best answer so far is given, with what is left.
    progress : bool or callable, optional
        By default a bar on a terminal and in a notebook; True shows it always, False never; a function is called with
        a text and the share done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    DataError
        Where recordings and model do not go together: a missing channel, another unit, another sample time.
    UsageError
        Where an argument has another type or value.
    """
    if not isinstance(sham, int) or not 0 <= sham <= 1000:
        raise UsageError(f"sham = {sham!r} is not a whole number of 0 to 1000")
    if seed < 0:
        raise UsageError(f"seed = {seed!r} is below 0")
    time_limit = seconds_given("time_limit", time_limit)
    if not isinstance(time_limit, int | float) or not 0 < time_limit < float("inf"):
        raise UsageError(f"time_limit = {time_limit!r} is no time; give the seconds, above 0")
    found = as_records(records)
    with shown(progress) as show:
        show("reading", 0.0)
        return _concluded(
            lambda: _case(found, baseline, title, context, same_inputs), title, sham, seed, time_limit, show
        )


def _case(
    records: Sequence[Record], baseline: Any, title: str, context: Mapping[str, Any] | None, same_inputs: bool
) -> Case:
    from aeolid.api.from_diagnose import make_case
    from aeolid.models.load import LinearModel
    from aeolid.models.lpv_prediction import LpvModel

    source = str(getattr(baseline, "source", "") or baseline if isinstance(baseline, str | Path) else "baseline")
    model: Any = baseline
    more: Sequence[Record] = ()
    if isinstance(baseline, list | tuple):
        baseline, *more = as_records(baseline)
        model = baseline
    if not isinstance(baseline, Record):
        core = core_of(baseline)
        if isinstance(core, LpvModel):
            raise UsageError(
                "a scheduled model is no baseline of a diagnosis; at(...) freezes it at an operating point"
            )
        model = core.state_space if isinstance(core, LinearModel) else core
    digest = baseline.sha256 if isinstance(baseline, Record) else _digest(model)
    return make_case(
        records, model, title=title, source=source, sha256=digest, context=context, same_inputs=same_inputs,
        more_runs=more,
    )  # fmt: skip


def _digest(model: Any) -> str:
    """Return the SHA-256 of a model as it would be written."""
    import json

    from aeolid.models.equations import Equations
    from aeolid.models.equations_file import to_toml

    text = to_toml(model) if isinstance(model, Equations) else json.dumps(model.to_json())
    return hashlib.sha256(text.encode("utf-8", errors="backslashreplace")).hexdigest()


def _concluded(case: Any, title: str, sham: int, seed: int, time_limit: float, show: Show) -> Diagnosis:
    """Diagnose in a folder of its own and take in what that leaves there."""
    from aeolid.api.from_diagnose import Deadline, conclude, ended

    late = Deadline(time_limit, notice=lambda what: show(f"fitting {what}", None))
    with tempfile.TemporaryDirectory(prefix="aeolid-") as name:
        folder = Path(name)
        try:
            facts, evidence = conclude(case(), folder, sham=sham, seed=seed, progress=show, deadline=late)
        except Contradiction as error:  # recording and model themselves disagree about a channel
            facts, evidence = ended("data_fault", title, str(error), folder)
        files = {
            str(path.relative_to(folder)): path.read_text(encoding="utf-8")
            for path in sorted(folder.rglob("*")) if path.is_file()
        }  # fmt: skip
    return Diagnosis(facts, evidence, files)
