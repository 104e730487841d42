"""Find the modes of recordings by their outputs alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
    waiting,
)
from aeolid.cli.merged_modes import read_merged, show_merged
from aeolid.cli.pictures import PICTURES, write_picture
from aeolid.errors import UsageError
from aeolid.output import declare

EXAMPLES = (
    "aeolid modes monday.csv --roles roles.toml",
    "aeolid modes monday.csv tuesday.csv --roles roles.toml --decimate 2 --report modes.html --picture modes.svg",
    "aeolid modes turbine.csv --roles roles.toml --blades flap_moment_1..3 --blades edge_moment_1..3",
    "aeolid modes low.csv middle.csv high.csv --roles sensors.toml --references top_x,top_y --report tower.html",
    "aeolid modes low.csv middle.csv high.csv --roles sensors.toml --references top_x,top_y --merge-by preger",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="modes")(modes)


def modes(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="REC...", help="Recordings of one experiment set; with --references one a set-up."),
    ],
    roles: Annotated[
        list[Path],
        typer.Option(
            "--roles",
            help="TOML file that names each channel, its unit and role; with --references one of all, or one a set-up.",
        ),
    ],
    references: Annotated[
        list[str] | None,
        typer.Option(
            "--references",
            metavar="CH1,CH2",
            help="Sensors that every recording has while the others roam: each is a set-up; modes are merged.",
        ),
    ] = None,
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
    decimate: Annotated[int, typer.Option("--decimate", help="Lower the sample rate by this factor first.")] = 1,
    reference: Annotated[
        str | None, typer.Option("--reference", help="Output that shapes are scaled to; default the largest of each.")
    ] = None,
    merge_by: Annotated[
        str | None,
        typer.Option(
            "--merge-by",
            help="How set-ups of --references are merged: poser, mode by mode, the default; or preger, to one model.",
            autocompletion=one_of("poser", "preger"),
        ),
    ] = None,
    blades: BladesOption = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write a self-contained HTML page.")] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            help="Write the stabilisation diagram (.svg, .png or .pdf); shapes, too, where sensors have positions.",
        ),
    ] = None,
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Find modes, shapes and harmonics by outputs alone: operational modal analysis with a stabilisation diagram.

    Inputs of the roles file are left out: modes are those of everything that moves, the loop of a controller included.
    With --references each recording is a set-up, identified by itself; shapes are joined by the sensors that stay.
    """
    if picture is not None and picture.suffix.lower() not in PICTURES:
        raise UsageError(f"--picture {picture}: a picture is written as {', '.join(PICTURES)}")
    files = {"--report": report, "--picture": picture, "--json": json_target}
    declare("modes", force=force, inputs=[*recordings, *roles], files=files)
    if references:
        merged = read_merged(
            recordings, roles, references, resample, blades, outputs=outputs, past=past, largest=largest_order,
            decimate=decimate, reference=reference, by=merge_by or "poser", quiet=json_target == "-",
        )  # fmt: skip
        show_merged(merged, report, picture, json_target)
        return
    if merge_by is not None:
        raise UsageError(f"--merge-by {merge_by} is of set-ups; name the sensors that they share, --references")
    if len(roles) > 1:
        raise UsageError("several --roles are of set-ups with sensors of their own; name what they share, --references")
    from aeolid.api.modal import modes as find
    from aeolid.formats import read_record

    with waiting("reading"):
        layout = load_roles(roles[0], resample)
        records = [read_record(path, layout) for path in recordings]
    with waiting("finding poles over orders and windows"):
        found = find(
            records, outputs=outputs, past=past, largest_order=largest_order, decimate=decimate, reference=reference,
            blades=blades,
        )  # fmt: skip
    if json_target != "-":
        for record in records:
            console.print(extent(record), markup=False, soft_wrap=True)
        console.print(found.summary(), markup=False, soft_wrap=True)
    if report is not None:
        found.report(report)
    if picture is not None:
        _draw(found.to_json(), picture)
    emit_json(found.to_json(), json_target)


def _draw(facts: dict[str, Any], picture: Path) -> None:
    """Write the stabilisation diagram of JSON facts, and below it the shapes where sensors have positions."""
    from aeolid.api.frames import draw_below, height_of
    from aeolid.api.pictures import draw_stabilisation as draw

    write_picture(
        picture, (10.6, 4.6 + height_of(facts)),
        lambda figure: draw_below(facts, figure, lambda upper: draw(facts, upper.subplots())),
    )  # fmt: skip
