"""Diagnose one case without a word, as a worker does that has no screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aeolid.errors import AeolidError, Contradiction
from aeolid.file_kinds import require_case

MARGINS = "margins.json"
FILES = ("diagnosis.json", "model/model.toml", "sealed_before_after.csv", "evidence.json", "report.html", MARGINS)


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
    rules: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # what differs, by section and name
    margins: bool = False


@contextmanager
def asked_rules(asked: Asked, folder: Path) -> Iterator[None]:
    """Let the decision rules hold that were asked for; write their margins to a folder where asked for, too."""
    from aeolid.diagnose.rules import rules_of, with_rules
    from aeolid.diagnose.rules.margins import noting_margins
    from aeolid.output import discard, write_json

    rules, path = rules_of(asked.rules, "--rules"), folder / MARGINS
    if not asked.margins:
        discard(path)  # of an earlier run
        with with_rules(rules):
            yield
        return
    with noting_margins(rules) as margins:
        yield
    write_json(path, {"schema": 1, "rules": dict(asked.rules), "margins": margins.to_json()})


def _silent(text: str, share: float) -> None:
    """Take what a screen would show."""


def diagnose_piece(piece: tuple[str, str], asked: Asked, out: str, inside: Sequence[str], force: bool) -> Any:
    """Diagnose the case of a name into a folder of that name in `out`; returns diagnosis.json's content or its error.

    piece: name and folder of the case; inside: what the whole command writes within `out`.
    """
    from aeolid.output import declare, make_folder

    name, case, folder = piece[0], Path(piece[1]), Path(out) / piece[0]
    try:
        require_case(case)
        declare("diagnose", force=force, inputs=[case], folders={"--out": Path(out)}, inside=inside)
        make_folder(folder)
        with asked_rules(asked, folder):
            return _diagnosed(name, case, folder, asked)
    except AeolidError as error:  # what is wrong with one case is a line of the table
        return error


def _diagnosed(name: str, case: Path, folder: Path, asked: Asked) -> dict[str, Any]:
    from aeolid.diagnose.conclude import conclude, ended
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.deadline import Deadline
    from aeolid.output import discard

    try:
        held = load_case(case, allow_outside=asked.allow_outside, allow_fmu=asked.allow_fmu, resample=asked.resample)
        late = Deadline(asked.time_limit)
        diagnosis, evidence = conclude(held, folder, sham=asked.sham, seed=asked.seed, progress=_silent, deadline=late)
    except Contradiction as error:  # the files themselves disagree about the recording
        diagnosis, evidence = ended("data_fault", name, str(error), folder)
    discard(folder / "report.html")  # of an earlier run
    if asked.report:
        from aeolid.report.diagnosis import render_diagnosis

        render_diagnosis(diagnosis, evidence, folder / "report.html")
    return diagnosis
