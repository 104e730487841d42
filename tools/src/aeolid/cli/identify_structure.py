"""Fit the free values of equations: `aeolid identify --structure model.toml`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from aeolid.cli.common import console, emit_json, extent, load_roles, progress_console, waiting
from aeolid.errors import UsageError
from aeolid.identify.request import Request
from aeolid.output import declare, write_text

if TYPE_CHECKING:
    from aeolid.diagnose.data.case import Case


def fit_structure(
    structure: Path, recordings: Sequence[Path], roles: Path, out: Path, json_target: str | None,
    resample: str | None, request: Request, others: Sequence[Path | None], force: bool,
) -> None:  # fmt: skip
    """Read equations and recordings, fit, write the fitted model.toml and tell its values with their deviations.

    request, others: options of other methods, of which none may be given. Raises UsageError.
    """
    if asdict(request) != asdict(Request()) or any(others):
        raise UsageError(
            "--structure fits equations; of the other options only --resample, --json and --force go with it"
        )
    if out.suffix != ".toml":
        raise UsageError(f"{out}: equations are written as .toml")
    declare(
        "identify", force=force, inputs=[*recordings, roles, structure], files={"--out": out, "--json": json_target}
    )
    from aeolid.diagnose.estimate import estimate
    from aeolid.models.equations_file import to_toml

    case = _case(structure, recordings, roles, resample)
    shown = progress_console if json_target == "-" else console
    for record in case.records:
        shown.print(extent(record), markup=False, soft_wrap=True)
    with waiting("fitting"):
        found = estimate(case)
    write_text(out, to_toml(found.model))
    if json_target != "-":
        console.print(found.summary(), markup=False, soft_wrap=True)
        console.print(f"model written to {out}", markup=False, soft_wrap=True)
    emit_json({"structure": str(structure), "written": str(out)} | found.to_json(), json_target)


def _case(structure: Path, recordings: Sequence[Path], roles: Path, resample: str | None) -> Case:
    from aeolid.diagnose.data.case import make_case
    from aeolid.formats import read_record
    from aeolid.models import equations_file
    from aeolid.record import file_sha256

    with waiting("reading"):
        wanted = load_roles(roles, resample)
        records = [read_record(path, wanted) for path in recordings]
        model = equations_file.load(structure)
    return make_case(records, model, title=structure.name, source=str(structure), sha256=file_sha256(structure))
