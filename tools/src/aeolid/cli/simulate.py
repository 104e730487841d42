"""Simulate a model on the inputs of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from aeolid.cli.common import (
    ForceOption,
    JsonOption,
    ResampleOption,
    RolesOption,
    console,
    emit_json,
    load_roles,
    one_of,
    progress_console,
)
from aeolid.errors import UsageError
from aeolid.output import declare
from aeolid.wording import counted

EXAMPLES = ("aeolid simulate model.json tuesday.csv --roles roles.toml --out simulated.csv",)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="simulate")(simulate)


def simulate(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="model.json, .mat, .lin, model.toml, or folder.")],
    recording: Annotated[Path, typer.Argument(metavar="REC", help="Recording with the model's inputs.")],
    roles: RolesOption,
    out: Annotated[Path, typer.Option("--out", help="Where to write the outputs (.csv, .csv.gz or .parquet).")],
    initial: Annotated[
        str,
        typer.Option(
            "--initial",
            help="First state: estimate (of equations those that the file leaves free), model or zero.",
            autocompletion=one_of("estimate", "model", "zero"),
        ),
    ] = "estimate",
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Run a model free on the recorded inputs and write its outputs."""
    if initial not in ("estimate", "model", "zero"):
        raise UsageError(f"--initial {initial!r} is none of estimate, model, zero")
    files = {"--out": out, "--json": json_target}
    declare("simulate", force=force, inputs=[model_file, recording, roles], files=files)
    import numpy as np

    from aeolid.formats import read_record, write_table
    from aeolid.identify.free_run import run_free
    from aeolid.models.load import load_model

    model = load_model(model_file)
    run = run_free(model, read_record(recording, load_roles(roles, resample)), initial)
    record, y, wild = run.record, run.y, run.divergence
    names, finite = [s.name for s in model.outputs], np.isfinite(y)
    told = np.where(finite, y, np.nan)
    columns = {"time_s": record.time_s} | {n: told[:, i] for i, n in enumerate(names)}
    write_table(out, columns, {"time_s": "s"} | {s.name: s.unit for s in model.outputs})
    facts: dict[str, Any] = {"model": str(model_file), "recording": str(recording), "samples": len(record)}
    facts |= {"outputs": names, "divergence": None if wild is None else wild.to_json()}
    facts["notes"] = list(run.notes)
    lines, left = (
        [f"{counted(len(record), 'sample')} written to {out}", *run.notes],
        " Values that are not finite are left empty.",
    )
    warning = "" if wild is None else f"WARNING: {wild.text()}" + ("" if finite.all() else left)
    lines += [warning] if warning else []
    if run.start:
        facts["start"] = run.start
        lines.append("  starts as the recording shows: " + ", ".join(f"{n} {v:.6g}" for n, v in run.start.items()))
    if run.score is not None:
        facts["free_run"] = run.score.to_json()
        lines += [f"  {n}: {run.score.text(n)}" for n in names]
    if json_target != "-":
        console.print("\n".join(lines), markup=False, soft_wrap=True)
    for text in [*run.notes, *([warning] if warning else [])] if json_target == "-" else ():
        progress_console.print(text, markup=False, soft_wrap=True)
    emit_json(facts, json_target)
