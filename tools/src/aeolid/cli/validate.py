"""Validate a model on a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import (
    ForceOption,
    JsonOption,
    ResampleOption,
    RolesOption,
    console,
    emit_json,
    extent,
    load_roles,
    one_of,
    progress_console,
)
from aeolid.errors import UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.models.load import Model
    from aeolid.models.modes import Mode
    from aeolid.record import Record

EXAMPLES = (
    "aeolid validate model.json tuesday.csv --roles roles.toml",
    "aeolid validate model.json tuesday.csv --roles roles.toml --metric one-step --fail-above 0.3",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="validate")(validate)


def validate(
    model_file: Annotated[Path, typer.Argument(metavar="MODEL", help="model.json, .mat, .lin, model.toml, or folder.")],
    recording: Annotated[Path, typer.Argument(metavar="REC", help="Recording, best one the model has not seen.")],
    roles: RolesOption,
    steps: Annotated[
        str, typer.Option("--steps", help="Horizons of the k-step prediction, comma-separated.")
    ] = "5,10,50",
    fail_above: Annotated[
        float | None, typer.Option("--fail-above", help="Exit with 1 when an output's NRMSE exceeds this.")
    ] = None,
    metric: Annotated[
        str,
        typer.Option(
            "--metric",
            help="What --fail-above looks at: free-run or one-step.",
            autocompletion=one_of("free-run", "one-step"),
        ),
    ] = "free-run",
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Measure one-step, k-step and free-run fit, and test the innovations of the predictor."""
    if metric not in ("free-run", "one-step"):
        raise UsageError(f"--metric {metric!r} is neither free-run nor one-step")
    if fail_above is not None and not 0 <= fail_above < float("inf"):
        raise UsageError(f"--fail-above {fail_above:g} is no NRMSE; give a finite number of 0 or more")
    horizons = _horizons(steps)
    declare("validate", force=force, inputs=[model_file, recording, roles], files={"--json": json_target})
    from aeolid.formats import read_record
    from aeolid.identify.mode_names import mode_lines
    from aeolid.identify.stated import stated_doubt, stated_windows
    from aeolid.identify.validation import validate_recording
    from aeolid.models.load import load_model

    doubt, model = stated_doubt(model_file), load_model(model_file)
    windows = stated_windows(_stated(model_file))
    result, record = validate_recording(model, read_record(recording, load_roles(roles, resample)), horizons, windows)
    facts: dict[str, Any] = {"model": str(model_file), "recording": str(recording)} | result.to_json()
    if fail_above is not None and metric == "free-run" and not result.driven:
        raise UsageError(f"{model_file}: the model has no input, and a free run says nothing of it: --metric one-step")
    worst = result.worst_nrmse(metric)
    bad = fail_above is not None and not worst <= fail_above  # a score that is not a number is bad news too
    told = worst if worst < 1e300 else None
    facts["fail_above"] = {"metric": metric, "threshold": fail_above, "worst": told, "bad": bad}
    warned = [*result.notes, *([] if result.divergence is None else [f"WARNING: {result.divergence.text()}"])]
    for text in warned if json_target == "-" else ():
        progress_console.print(text, markup=False, soft_wrap=True)
    modes = _modes(model_file, model, record)
    facts["modes"] = [m.to_json() for m in modes]
    facts["bands_hold"] = None if doubt is None else not doubt
    if json_target != "-":
        console.print(extent(record), markup=False, soft_wrap=True)
        console.print(result.summary(), markup=False)
        console.print("\n".join(mode_lines(modes, record.sample_time_s)), markup=False)
        if doubt:
            console.print(f"WARNING: the model's own deviations do not hold: {doubt}", markup=False)
        if bad:
            console.print(f"worst {metric} NRMSE {worst:.4g} exceeds {fail_above:g}")
    emit_json(facts, json_target)
    if bad:
        raise typer.Exit(1)


def _stated(path: Path) -> Any:
    """Return what an identification said in the model file that it wrote, None where there is nothing."""
    from aeolid.text_files import load_json

    told = load_json(path) if path.suffix.lower() == ".json" else {}
    return told.get("identification") if isinstance(told, dict) else None


def _modes(path: Path, model: Model, record: Record) -> tuple[Mode, ...]:
    """Return the modes that a model file states with their deviations, else those of its poles."""
    from aeolid.api.facts import stated_modes
    from aeolid.identify.harmonics import marked
    from aeolid.models.load import LinearModel
    from aeolid.models.modes import modes_of

    if not isinstance(model, LinearModel):
        return ()
    found = stated_modes(_stated(path))
    if found is not None and any(m.name for m in found):
        return found
    return marked(modes_of(model.state_space) if found is None else found, [record], output_only=not model.inputs)


def _horizons(text: str) -> tuple[int, ...]:
    from aeolid.identify.validation import horizons

    try:
        return horizons([int(part) for part in text.split(",") if part.strip()])
    except ValueError:
        raise UsageError(f"--steps {text!r} is not a list of whole numbers such as 5,10,50") from None
