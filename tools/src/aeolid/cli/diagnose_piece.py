"""Diagnose one case without a word, as a worker does that has no screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aeolid.errors import DataError

FILES = ("diagnosis.json", "model/model.toml", "sealed_before_after.csv", "evidence.json", "report.html")


@dataclass(frozen=True)
class Asked:
    """Hold the options that an answer depends on, as the command names them."""

    sham: int
    seed: int
    time_limit: float
    allow_outside: bool
    allow_fmu: bool
    resample: float | str | None
    report: bool


def _silent(text: str, share: float) -> None:
    """Take what a screen would show."""


def require_case(case: Path) -> None:
    """Raise DataError where a folder holds no case."""
    if not (case / "case.toml").is_file():
        raise DataError(
            f"{case / 'case.toml'}: no such file; a case is a folder with case.toml, recordings, their roles and a"
            " model: aeolid init RECORDING writes one, aeolid example . two"
        )


def diagnose_piece(piece: tuple[str, str], asked: Asked, out: str, inside: Sequence[str], force: bool) -> Any:
    """Diagnose the case of a name into a folder of that name in `out`; returns the content of diagnosis.json.

    piece: name and folder of the case; inside: what the whole command writes within `out`.
    """
    from aeolid.diagnose.conclude import conclude, ended
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.deadline import Deadline
    from aeolid.errors import Contradiction
    from aeolid.output import declare, discard, make_folder

    name, case = piece[0], Path(piece[1])
    require_case(case)
    declare("diagnose", force=force, inputs=[case], folders={"--out": Path(out)}, inside=inside)
    folder = Path(out) / name
    make_folder(folder)
    options = {"allow_outside": asked.allow_outside, "allow_fmu": asked.allow_fmu, "resample": asked.resample}
    try:
        held = load_case(case, **options)  # type: ignore[arg-type]
        late = Deadline(asked.time_limit)
        diagnosis, evidence = conclude(held, folder, sham=asked.sham, seed=asked.seed, progress=_silent, deadline=late)
    except Contradiction as error:  # the files themselves disagree about the recording
        diagnosis, evidence = ended("data_fault", case.name, str(error), folder)
    discard(folder / "report.html")  # of an earlier run
    if asked.report:
        from aeolid.report.diagnosis import render_diagnosis

        render_diagnosis(diagnosis, evidence, folder / "report.html")
    return diagnosis
