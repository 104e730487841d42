"""Find the modes of a model that is periodic in the rotor's angle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import ForceOption, JsonOption, console, emit_json, waiting
from aeolid.cli.pictures import PICTURES, write_picture
from aeolid.errors import UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.api.scheduled import ScheduledModel

EXAMPLES = (
    "aeolid floquet model.json",
    "aeolid floquet model.json --rotor-speed 12.1rpm --report floquet.html --picture floquet.svg --json floquet.json",
    "aeolid floquet model.json --at wind=11 --multiple azimuth3=3",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="floquet")(floquet)


def floquet(
    model_file: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="model.json of `identify --method lpv` whose scheduling is an angle."),
    ],
    rotor_speed: Annotated[
        str | None,
        typer.Option(
            "--rotor-speed",
            help="12.1rpm, 0.2Hz, 1.27rad/s or 72.6deg/s; default that of the recordings. Below 0: it falls.",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="What another scheduling channel stands at; repeatable. Default its mean.",
        ),
    ] = None,
    multiple: Annotated[
        list[str] | None,
        typer.Option(
            "--multiple",
            metavar="ANGLE=K",
            help="An angle that turns K times in a revolution; repeatable. Default 1.",
        ),
    ] = None,
    harmonics: Annotated[
        int | None, typer.Option("--harmonics", help="Harmonics to compute with; default as many as the modes need.")
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write a self-contained HTML page.")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Write at which frequencies modes are seen (.svg, .png or .pdf).")
    ] = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Find the modes of a model that changes with the rotor's angle: Floquet analysis with participation.

    Each mode is seen at several frequencies, multiples of the rotor's speed apart; the one that moves the outputs most
    names it, and the share of each in each output is listed. The speed is taken as constant.
    """
    if picture is not None and picture.suffix.lower() not in PICTURES:
        raise UsageError(f"--picture {picture}: a picture is written as {', '.join(PICTURES)}")
    files = {"--report": report, "--picture": picture, "--json": json_target}
    declare("floquet", force=force, inputs=[model_file], files=files)
    held = {name: _number("--at", name, value) for name, value in _pairs("--at", at)}
    turns = {name: _whole("--multiple", name, value) for name, value in _pairs("--multiple", multiple)}
    model = _scheduled(model_file)
    with waiting("solving for harmonics"):
        found = model.floquet_modes(rotor_speed=rotor_speed, at=held, harmonics=harmonics, multiples=turns)
    if json_target != "-":
        console.print(found.summary(), markup=False, soft_wrap=True)
    if report is not None:
        found.report(report)
    if picture is not None:
        from aeolid.report.floquet import draw

        facts = found.to_json()
        write_picture(picture, (9.0, 1.5 + 0.5 * len(facts["modes"])), lambda figure: draw(facts, figure.subplots()))
    emit_json(found.to_json(), json_target)


def _scheduled(path: Path) -> ScheduledModel:
    """Read a scheduled model; raises UsageError on one of another kind."""
    from aeolid.api.models import load_model
    from aeolid.api.scheduled import ScheduledModel

    model = load_model(path)
    if not isinstance(model, ScheduledModel):
        raise UsageError(
            f"{path} is no scheduled model; identify --method lpv with the rotor's azimuth as scheduling makes one"
        )
    return model


def _pairs(option: str, given: list[str] | None) -> list[tuple[str, str]]:
    """Split NAME=VALUE; raises UsageError on another form and on a name given twice."""
    pairs = [text.rpartition("=")[::2] for text in given or []]
    for (name, value), text in zip(pairs, given or [], strict=True):
        if not name or not value:
            raise UsageError(f"{option} {text}: NAME=VALUE is needed")
    if len({name for name, _ in pairs}) < len(pairs):
        raise UsageError(f"{option}: a name is given twice")
    return pairs


def _number(option: str, name: str, value: str) -> float:
    try:
        found = float(value)
    except ValueError:
        found = float("nan")
    if not abs(found) < 1e12:
        raise UsageError(f"{option} {name}={value}: a number is needed")
    return found


def _whole(option: str, name: str, value: str) -> int:
    if not (value.isascii() and value.isdigit() and len(value) < 4):
        raise UsageError(f"{option} {name}={value}: a whole number is needed")
    return int(value)
