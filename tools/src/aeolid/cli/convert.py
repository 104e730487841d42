"""Convert a linear model between file formats, or into C for the controller."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json, one_of
from aeolid.errors import UsageError
from aeolid.output import declare, write_text

if TYPE_CHECKING:
    from aeolid.models.state_space import StateSpace

EXAMPLES = (
    "aeolid convert model.json model.mat",
    "aeolid convert model.json observer.h --precision f32 --name tower",
    "aeolid convert linearised.lin model.json --sample-time 0.1",
)
WRITABLE = (".json", ".mat", ".h")


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="convert")(convert)


def convert(
    model_file: Annotated[
        Path, typer.Argument(metavar="MODEL", help="model.json, MATLAB .mat or OpenFAST linearisation .lin.")
    ],
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="What to write: .json, .mat or .h (Kalman observer in C).")
    ],
    sample_time: Annotated[
        float | None,
        typer.Option(
            "--sample-time", help="Discretise a continuous-time model, inputs held; s. Also the Ts of a .mat."
        ),
    ] = None,
    inputs: Annotated[
        list[str] | None, typer.Option("--input", help="Keep this input, NEW=NAME renames it; repeat for several.")
    ] = None,
    outputs: Annotated[
        list[str] | None, typer.Option("--output", help="Keep this output, NEW=NAME renames it; repeat for several.")
    ] = None,
    precision: Annotated[
        str | None,
        typer.Option(
            "--precision", help="Numbers of the C observer: f32 (default) or f64.", autocompletion=one_of("f32", "f64")
        ),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Prefix in C; default: the name of the file.")] = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Convert a linear model: MATLAB files, OpenFAST linearisations, a Kalman observer in C."""
    suffix = out.suffix.lower()
    if suffix not in WRITABLE:
        raise UsageError(f"{out}: a model is written as .json, .mat or .h")
    if suffix != ".h" and (precision, name) != (None, None):
        raise UsageError(f"--precision and --name belong to a C observer (.h), not to {out.name}")
    if sample_time is not None and not 0 < sample_time < 1e6:
        raise UsageError(f"--sample-time {sample_time:g} is not a time in seconds above 0")
    declare("convert", force=force, inputs=[model_file], files={"OUT": out, "--json": json_target})
    from aeolid.models.exchange.files import read_with_notes
    from aeolid.models.exchange.select import select

    whole, notes = read_with_notes(model_file, sample_time)
    model = select(whole, inputs or [], outputs or [])
    model = _at_sample_time(model, sample_time, model_file)
    if suffix == ".h":
        from aeolid.models.exchange.c_observer import c_observer

        if whole.K is not None and model.K is None:
            kept = ", ".join(s.name for s in whole.outputs)
            raise UsageError(f"--output: an observer needs all outputs that its Kalman gain was made for: {kept}")
        prefix = name or re.sub(r"\W", "_", out.stem, flags=re.ASCII)
        write_text(out, c_observer(model, name=prefix, precision=precision or "f32", source=model_file.name))
    elif suffix == ".mat":
        from aeolid.models.exchange.matlab import write_mat

        write_mat(out, model)
    else:
        emit_json(model.to_json(), str(out))
    facts = _facts(model, model_file, out) | {"notes": list(notes)}
    if json_target != "-":
        console.print(_summary(facts), markup=False)
    emit_json(facts, json_target)


def _at_sample_time(model: StateSpace, sample_time: float | None, source: Path) -> StateSpace:
    from aeolid.models.load import discretise

    if sample_time is None:
        return model
    if model.sample_time_s > 0 and abs(model.sample_time_s - sample_time) > 1e-9 * sample_time:
        raise UsageError(
            f"{source}: the model has a sample time of {model.sample_time_s:g} s already; it is not resampled to "
            f"--sample-time {sample_time:g}"
        )
    return discretise(model, sample_time)


def _facts(model: StateSpace, source: Path, out: Path) -> dict[str, Any]:
    signals = {
        kind: [{"name": s.name, "unit": s.unit, "offset": s.offset} for s in having]
        for kind, having in (("inputs", model.inputs), ("outputs", model.outputs))
    }
    return {"model": str(source), "written": str(out), "order": model.order, "sample_time_s": model.sample_time_s,
            "kalman_gain": model.K is not None} | signals  # fmt: skip


def _summary(facts: dict[str, Any]) -> str:
    step = facts["sample_time_s"]
    time = f"sample time {step:g} s" if step else "continuous time"
    gain = "with" if facts["kalman_gain"] else "without"
    lines = [f"{facts['written']}: {facts['order']} states, {time}, {gain} a Kalman gain"]
    for kind in ("inputs", "outputs"):
        lines += [f"  {kind[:-1]} {s['name']} [{s['unit'] or '-'}] about {s['offset']:g}" for s in facts[kind]]
    return "\n".join([*lines, *(f"note: {note}" for note in facts["notes"])])
