"""Convert a model between file formats, into C for the controller, or into a functional mock-up unit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json, one_of
from aeolid.errors import UsageError
from aeolid.output import declare, write_text
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.models.state_space import StateSpace

EXAMPLES = (
    "aeolid convert model.json model.mat",
    "aeolid convert model.json observer.h --precision f32 --name tower",
    "aeolid convert linearised.lin model.json --sample-time 0.1",
    "aeolid convert model.json continuous.mat --continuous",
    "aeolid convert diagnosis/model plant.fmu --sample-time 0.05",
)
WRITABLE = (".json", ".mat", ".h", ".fmu")


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="convert")(convert)


def convert(
    model_file: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="model.json, MATLAB .mat, OpenFAST linearisation .lin, model.toml (equations), or a folder of one.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="What to write: .json, .mat, .h (a Kalman observer in C; of equations their simulation)"
            " or .fmu (FMI 2.0, co-simulation).",
        ),
    ],
    sample_time: Annotated[
        float | None,
        typer.Option(
            "--sample-time",
            help="Discretise a continuous-time model, or resample one, inputs held; s. Also the Ts of a .mat, and the"
            " step of a simulation.",
        ),
    ] = None,
    continuous: Annotated[
        bool, typer.Option("--continuous", help="Write a discrete-time model in continuous time, inputs held.")
    ] = False,
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
    """Convert a model: MATLAB files, OpenFAST linearisations, a Kalman observer in C, a functional mock-up unit."""
    suffix = out.suffix.lower()
    if suffix not in WRITABLE:
        raise UsageError(f"{out}: a model is written as .json, .mat, .h or .fmu")
    if (suffix != ".h" and precision) or (suffix not in (".h", ".fmu") and name):
        raise UsageError(f"--precision and --name belong to C (.h; --name also to .fmu), not to {out.name}")
    if continuous and (sample_time is not None or suffix not in (".json", ".mat")):
        raise UsageError("--continuous writes a model as .json or .mat, without --sample-time")
    if sample_time is not None and not 0 < sample_time < 1e6:
        raise UsageError(f"--sample-time {sample_time:g} is not a time in seconds above 0")
    declare("convert", force=force, inputs=[model_file], files={"OUT": out, "--json": json_target})
    if suffix == ".fmu" or _holds_equations(model_file):
        if precision:
            raise UsageError("--precision belongs to a Kalman observer; simulations compute in double")
        facts = _simulation(model_file, out, sample_time, name, [*(inputs or []), *(outputs or [])])
        if json_target != "-":
            console.print(_told(facts), markup=False)
        emit_json(facts, json_target)
        return
    from aeolid.models.exchange.files import read_with_notes
    from aeolid.models.exchange.select import select

    whole, notes = read_with_notes(model_file, sample_time)
    model, dropped = _in_time(select(whole, inputs or [], outputs or []), 0.0 if continuous else sample_time)
    if suffix == ".h":
        prefix = name or re.sub(r"\W", "_", out.stem, flags=re.ASCII)
        _write_observer(out, model, whole, bool(dropped), prefix, precision or "f32", model_file.name)
    elif suffix == ".mat":
        from aeolid.models.exchange.matlab import write_mat

        write_mat(out, model)
    else:
        emit_json(model.to_json(), str(out))
    facts = _facts(model, model_file, out) | {"notes": [*notes, *dropped]}
    if json_target != "-":
        console.print(_summary(facts), markup=False)
    emit_json(facts, json_target)


def _holds_equations(path: Path) -> bool:
    return path.suffix == ".toml" or (path.is_dir() and (path / "model.toml").is_file())


def _simulation(
    model_file: Path, out: Path, sample_time: float | None, name: str | None, chosen: list[str]
) -> dict[str, Any]:
    """Write a simulation of a model as C header or mock-up unit; returns what is told."""
    from aeolid.models.exchange.c_simulation import as_identifier, c_simulation
    from aeolid.models.exchange.fmu_write import write_fmu
    from aeolid.models.exchange.simulated import equations_to_simulate

    if out.suffix.lower() not in (".h", ".fmu"):
        raise UsageError(f"{out}: equations are written as .h (a simulation in C) or .fmu")
    if chosen:
        raise UsageError("--input and --output choose among those of a linear model; a simulation has all")
    model, prefix = equations_to_simulate(model_file, sample_time), name or as_identifier(out.stem)
    if out.suffix.lower() == ".fmu":
        notes = write_fmu(out, model, sample_time or 0.0, name=prefix, source=model_file.name)
    else:
        text, notes = c_simulation(model, sample_time or 0.0, name=prefix, source=model_file.name)
        write_text(out, text)
    signals = {
        kind: [{"name": s.name, "unit": s.unit} for s in having]
        for kind, having in (("inputs", model.inputs), ("outputs", model.outputs))
    }
    step = model.sample_time_s or sample_time
    return {"model": str(model_file), "written": str(out), "order": len(model.states), "sample_time_s": step,
            "parameters": len(model.parameters), "notes": list(notes)} | signals  # fmt: skip


def _told(facts: dict[str, Any]) -> str:
    lines = [f"{facts['written']}: {counted(facts['order'], 'state')}, "
        f"{counted(facts['parameters'], 'parameter')}, a sample every"
             f" {facts['sample_time_s']:g} s"]  # fmt: skip
    for kind in ("inputs", "outputs"):
        lines += [f"  {kind[:-1]} {s['name']} [{s['unit'] or '-'}]" for s in facts[kind]]
    return "\n".join([*lines, *(f"note: {note}" for note in facts["notes"])])


def _in_time(model: StateSpace, sample_time: float | None) -> tuple[StateSpace, tuple[str, ...]]:
    """Return a model with a sample time, 0 for continuous time, None for its own; and what that took from it."""
    from aeolid.models.continuous import to_continuous, to_sample_time

    if sample_time is None:
        return model, ()
    found = to_sample_time(model, sample_time) if sample_time else to_continuous(model)
    lost = model.K is not None and found.K is None
    return found, ("the Kalman gain belongs to the model's own samples and is left out",) if lost else ()


def _write_observer(
    out: Path, model: StateSpace, whole: StateSpace, resampled: bool, prefix: str, precision: str, source: str
) -> None:
    """Write an observer in C of what was chosen of a whole model."""
    from aeolid.models.exchange.c_observer import c_observer

    if resampled:
        raise UsageError(
            f"--sample-time: an observer runs at the {whole.sample_time_s:g} s that its Kalman gain was made for;"
            " identify the model from recordings of the other rate"
        )
    if whole.K is not None and model.K is None:
        kept = ", ".join(s.name for s in whole.outputs)
        raise UsageError(f"--output: an observer needs all outputs that its Kalman gain was made for: {kept}")
    write_text(out, c_observer(model, name=prefix, precision=precision, source=source))


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
    lines = [f"{facts['written']}: {counted(facts['order'], 'state')}, {time}, {gain} a Kalman gain"]
    for kind in ("inputs", "outputs"):
        lines += [f"  {kind[:-1]} {s['name']} [{s['unit'] or '-'}] about {s['offset']:g}" for s in facts[kind]]
    return "\n".join([*lines, *(f"note: {note}" for note in facts["notes"])])
