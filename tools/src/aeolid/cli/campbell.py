"""Draw the modes of several recordings over rotor speed and wind: a Campbell diagram."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import (
    BladesOption,
    ForceOption,
    JsonOption,
    ResampleOption,
    console,
    emit_json,
    extent,
    load_roles,
    one_of,
    read_resample,
    waiting,
)
from aeolid.cli.pictures import PICTURES, write_picture
from aeolid.errors import UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.api.campbell import CampbellDiagram
    from aeolid.record import Record

EXAMPLES = (
    "aeolid campbell wind8.outb wind12.outb wind15.outb wind18.outb --out campbell.svg",
    "aeolid campbell low.csv high.csv --roles roles.toml --blades auto --out campbell.html --json campbell.json",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="campbell")(campbell)


def campbell(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Recordings or simulator runs, one a wind.")],
    roles: Annotated[
        Path | None,
        typer.Option("--roles", help="TOML file that names the channels of all runs; default by their headings."),
    ] = None,
    out: Annotated[
        list[Path] | None,
        typer.Option("--out", help="Where to write the diagram: .svg, .png, .pdf, or a page .html; repeatable."),
    ] = None,
    blades: BladesOption = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option("--outputs", help="Channel to use; repeatable. Default: those of the role output."),
    ] = None,
    past: Annotated[
        str,
        typer.Option(
            "--past",
            help="Past window: samples, seconds (12s), or auto. Longer ones are tried besides.",
            autocompletion=one_of("auto"),
        ),
    ] = "auto",
    largest_order: Annotated[
        int | None, typer.Option("--largest-order", help="Up to which order poles are found; default by the data.")
    ] = None,
    decimate: Annotated[
        int | None,
        typer.Option("--decimate", help="Lower the sample rate by this factor first; default up to 12P are kept."),
    ] = None,
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Follow the modes of a turbine over rotor speed and wind, by outputs alone: a Campbell diagram and its table.

    Each run is analysed by itself, blades in the fixed frame; modes are followed by frequency, damping and shape, and
    multiples of the rotor's speed are drawn as lines, never listed as modes. Without --roles the channels of OpenFAST,
    ROSCO, Bladed, HAWC2 and common SCADA are known by their headings.
    """
    targets = _targets(out or [])
    declare("campbell", force=force, inputs=[*runs, roles], files={**targets, "--json": json_target})
    from aeolid.api.campbell import campbell as find

    with waiting("reading"):
        records, known = _records(runs, roles, resample)
    with waiting("finding and following modes"):
        found = find(
            records, outputs=outputs or (None if blades else known), blades=blades, past=past,
            largest_order=largest_order, decimate=decimate,
        )  # fmt: skip
    if json_target != "-":
        for record in records:
            console.print(extent(record), markup=False, soft_wrap=True)
        console.print(found.summary(), markup=False, soft_wrap=True)
    for path in targets.values():
        _write(found, path)
    emit_json(found.to_json(), json_target)


def _targets(paths: list[Path]) -> dict[str, Path]:
    """Return the files by the option that names each; raises UsageError on an ending that is not written."""
    for path in paths:
        if path.suffix.lower() not in (*PICTURES, ".html"):
            raise UsageError(f"--out {path}: a diagram is written as {', '.join(PICTURES)} or .html")
    return {"--out" if i == 0 else f"--out {path}": path for i, path in enumerate(paths)}


def _records(
    runs: list[Path], roles: Path | None, resample: str | None
) -> tuple[list[Record], list[str] | None]:  # fmt: skip
    """Read the runs, by one roles file or each by its own headings, then with the outputs that show modes.

    Raises UsageError where there is but one run.
    """
    from dataclasses import replace

    from aeolid.formats import read_record

    if len(runs) < 2:
        raise UsageError("a Campbell diagram takes two runs or more, at different winds; aeolid modes takes one")
    if roles is not None:
        layout = load_roles(roles, resample)
        return [read_record(path, layout) for path in runs], None
    from aeolid.begin.rotor_roles import rotor_outputs, rotor_roles

    wanted, records = read_resample(resample), []
    for path in runs:
        layout = rotor_roles(path)
        records.append(read_record(path, layout if wanted is None else replace(layout, resample=wanted)))
    return records, rotor_outputs(layout)


def _write(found: CampbellDiagram, path: Path) -> None:
    if path.suffix.lower() == ".html":
        found.report(path)
        return
    from aeolid.report.campbell_chart import draw, has_wind

    facts = found.to_json()
    wide = 2 if has_wind(facts) else 1
    write_picture(path, (10.6, 5.2), lambda figure: draw(facts, figure.subplots(1, wide, sharey=True)))
