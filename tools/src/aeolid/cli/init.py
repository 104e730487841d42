"""aeolid init: roles and a case, guessed from the files somebody has."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json
from aeolid.errors import UsageError
from aeolid.output import declare, write_text
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.begin.make import Beginning

EXAMPLES = (
    "aeolid init turbine.csv",
    "aeolid init turbine.csv --baseline simulation.outb",
    "aeolid init turbine.csv --baseline model.json --out my_case",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("init")(run)


def run(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording of any format that is read.")],
    baseline: Annotated[
        Path | None,
        typer.Option(
            "--baseline", help="What it is compared with: a simulator's recording, model.json, .toml or .fmu."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the files; default: that of the recording.")
    ] = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Guess roles, units and a case from names and values; writes roles.toml and case.toml, with comments, to correct.

    Headings of OpenFAST, ROSCO, Bladed, HAWC2 and common SCADA are known. Existing files are never replaced.
    """
    from aeolid.begin.make import CASE, ROLES, RUN_ROLES, begin

    folder = recording.parent if out is None else out
    there = [folder / n for n in (ROLES, RUN_ROLES, CASE) if (folder / n).exists() or (folder / n).is_symlink()]
    if there and not force:
        raise UsageError(f"{there[0]}: exists already and is not replaced; name another folder with --out")
    made = begin(recording, baseline, folder)
    declare(
        "init", force=force, inputs=[recording, baseline], folders={"--out": folder}, files={"--json": json_target},
        inside=tuple(made.files),
    )  # fmt: skip
    for name, content in made.files.items():
        write_text(folder / name, content)
    following = _next(made, recording, baseline, folder)
    if json_target != "-":
        _show(made, folder, following)
    emit_json(_facts(made, folder, following), json_target)


def _show(made: Beginning, folder: Path, following: list[str]) -> None:
    from rich.table import Table

    for found, guesses in made.sides:
        table = Table(
            title=f"{found.path.name}: {counted(len(guesses.used), 'channel')} in use", title_justify="left", box=None
        )
        for heading in ("heading", "is", "unit", "role"):
            table.add_column(heading, overflow="fold")
        from rich.text import Text

        for g in guesses.used:
            unit = f"{g.unit} (guessed)" if g.why else g.unit
            table.add_row(Text(g.heading), Text(g.name), Text(unit), Text(g.role))
        console.print(table)
        for note in found.notes:
            console.print(f"note: {note}", markup=False, soft_wrap=True)
    for f in made.facts:
        console.print(f"  {f.key} = {f.value}{'' if f.sure else ' (left out)'}: {f.why}", markup=False, soft_wrap=True)
    console.print(f"written: {', '.join(str(folder / n) for n in made.files)}", markup=False, soft_wrap=True)
    if made.missing:
        console.print(_missing(made), markup=False, soft_wrap=True)
    console.print("Next:" if following else "", markup=False)
    for line in following:
        console.print(f"  {line}", markup=False, soft_wrap=True)


def _missing(made: Beginning) -> str:
    """Say what was not recognised, and what follows from that."""
    if made.missing == ("input",):
        return "No input was recognised: modes come from the outputs alone; for more, give an input its role by hand."
    return f"No {' and no '.join(made.missing)} was recognised: give roles by hand."


def _next(made: Beginning, recording: Path, baseline: Path | None, folder: Path) -> list[str]:
    """Return the commands that go on from here."""
    place, outside = shlex.quote(str(folder)), " --allow-outside" if made.outside else ""
    lines = [f"aeolid check {place}{outside}"]
    if baseline is None:
        roles, model = shlex.quote(str(folder / "roles.toml")), shlex.quote(str(folder / "model.json"))
        file = shlex.quote(str(recording))
        alone = [f"aeolid modes {file} --roles {roles}"] if made.missing == ("input",) else []
        first = f"give at least one channel of {folder / 'roles.toml'} the role output, others input, with their units"
        by_hand = [] if made.sides[0][1].used else [first]
        identify = f"aeolid identify {file} --roles {roles} --out {model}"
        return [*by_hand, *alone, identify, f"aeolid check {place}{outside}"]  # the case's model comes from identify
    native = " --allow-fmu" if baseline.suffix.lower() == ".fmu" else ""
    target = shlex.quote(str(folder / "diagnosis"))
    return [*lines, f"aeolid diagnose {place}{outside}{native} --out {target}"]


def _facts(made: Beginning, folder: Path, following: list[str]) -> dict[str, Any]:
    sides = [
        {
            "file": str(found.path),
            "channels": [{"heading": g.heading, "name": g.name, "unit": g.unit, "role": g.role, "guessed": g.why}
                         for g in guesses.used],
            "left_out": [{"heading": h, "why": why} for h, why in guesses.left],
            "unknown": list(found.others), "notes": list(found.notes),
        }
        for found, guesses in made.sides
    ]  # fmt: skip
    context = {f.key: {"value": f.value, "why": f.why, "used": f.sure} for f in made.facts}
    files = [str(folder / n) for n in made.files]
    return {"files": files, "sides": sides, "context": context, "missing": list(made.missing), "next": following}
