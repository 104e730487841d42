"""aeolid scales: the offset and scale of each channel, as a controller's settings have them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import JsonOption, console, emit_json, progress_console
from aeolid.errors import DataError, UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.filters.scales import ChannelSums

EXAMPLES = (
    "aeolid scales turbine.outb",
    "aeolid scales frames.log --skip 60",
    "aeolid scales monday.csv --roles roles.toml --c",
)
KEYS = {"input": "input  =", "output": "output =", "scheduling": "scheduling ="}


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("scales")(run)


def run(
    recording: Annotated[
        Path,
        typer.Argument(metavar="REC", help="Recording: of OpenFAST (.out, .outb), a CAN log, or any with --roles."),
    ],
    roles: Annotated[
        Path | None, typer.Option("--roles", help="TOML file that names each channel, its unit and role.")
    ] = None,
    skip: Annotated[
        float | None,
        typer.Option(
            "--skip", help="Seconds at the start to leave out; default 60, at most a quarter of the recording."
        ),
    ] = None,
    c: Annotated[
        bool, typer.Option("--c", help="Entries of the C array of stream.h, in the recording's units.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Print the offset (mean) and scale (standard deviation) of each channel, to be pasted into a controller.

    Lines are those of the settings of port/discon, in its units; without --roles they are the channels that the wrapper
    would tap.
    """
    declare("scales", force=False, inputs=[recording, roles], files={"--json": json})
    if skip is not None and not skip >= 0:
        raise UsageError(f"--skip {skip:g}: a time of 0 s or more is needed")
    facts = _of_roles(recording, roles, skip) if roles is not None else _of_headings(recording, skip)
    if json != "-":
        for line in _lines(facts, c=c):
            console.print(line, soft_wrap=True, markup=False)
    emit_json(facts, json)


def _of_roles(recording: Path, roles: Path, skip: float | None) -> dict[str, Any]:
    from aeolid.formats import read_record
    from aeolid.record import Roles

    record = read_record(recording, Roles.load(roles))
    channels = record.of(*KEYS)
    if not channels:
        raise DataError(f"{roles}: no channel has the role input, output or scheduling")
    wanted = [(c.name, c.unit, c.role) for c in channels]
    return _facts(recording, record.time_s, record.columns([c.name for c in channels]), wanted, skip)


def _of_headings(recording: Path, skip: float | None) -> dict[str, Any]:
    """Find the channels by the names that the wrapper and OpenFAST give them."""
    import numpy as np

    from aeolid.formats import read_table
    from aeolid.formats.controller_channels import find_tapped, role_of

    table = read_table(recording)
    found = find_tapped(table.units)
    if not found or table.time is None:
        raise UsageError(
            f"{recording}: no channel with a heading and unit that the wrapper or OpenFAST uses, or no time; "
            "give --roles"
        )
    wanted = [(t.name, table.units[t.heading], role_of(t.name)) for t in found]
    values = np.column_stack([table.columns[t.heading] for t in found])
    facts = _facts(recording, table.columns[table.time], values, wanted, skip)
    for channel, tapped in zip(facts["channels"], found, strict=True):
        channel["heading"] = tapped.heading
    return facts


def _facts(
    recording: Path, time_s: Any, values: Any, wanted: list[tuple[str, str, str]], skip: float | None
) -> dict[str, Any]:
    """Return mean and deviation of each channel: in its own unit, and as text in the wrapper's where it has one."""
    from aeolid.filters.scales import LEAST, START_S, ChannelSums
    from aeolid.formats.controller_channels import CHANNELS, factor_to

    span = float(time_s[-1] - time_s[0])
    first = min(START_S, span / 4) if skip is None else skip
    sums = ChannelSums.empty(values.shape[1])
    sums.add(values[time_s - time_s[0] >= first])
    channels = []
    for i, (name, unit, role) in enumerate(wanted):
        if sums.count[i] < LEAST:
            raise DataError(
                f"{recording}: channel {name!r} has {sums.count[i]:.0f} samples after {first:g} s; {LEAST} are needed"
            )
        factor = factor_to(name, unit)
        channels.append({"name": name, "unit": unit, "role": role} | _numbers(sums, i, 1.0))
        if factor is not None:
            channels[-1]["wrapper"] = {"unit": CHANNELS[name]} | _numbers(sums, i, factor)
    return {"recording": str(recording), "skipped_s": first, "span_s": span, "channels": channels}


def _numbers(sums: ChannelSums, i: int, factor: float) -> dict[str, Any]:
    from aeolid.filters.scales import fitting

    mean, deviation = float(sums.mean[i]) * factor, float(sums.deviation[i]) * factor
    still = bool(sums.least[i] == sums.most[i])
    offset, scale = (None, None) if still else fitting(mean, deviation)
    return {"mean": mean, "deviation": deviation, "constant": still, "offset": offset, "scale": scale}


def _lines(facts: dict[str, Any], *, c: bool) -> list[str]:
    channels = sorted(facts["channels"], key=lambda channel: list(KEYS).index(channel["role"]))
    mark = "//" if c else "#"
    lines = [
        f"{mark} {facts['recording']}, {facts['skipped_s']:g} to {facts['span_s']:g} s: mean and standard deviation"
    ]
    for channel in channels:
        name, numbers = channel["name"], channel if c else channel.get("wrapper")
        if channel["constant"]:
            text = f"{mark} {name} is constant at {channel['mean']:.7g} {channel['unit']}: excite it, or leave it out"
        elif numbers is None:
            fits = f"offset {channel['offset']} scale {channel['scale']}"
            text = (
                f"# {name}: {fits} {channel['unit']}; no channel of the wrapper in this unit: record:NUMBER needs one"
            )
        elif c:
            text = f'{{"{name}", "{channel["unit"]}", {_literal(numbers["offset"])}, {_literal(numbers["scale"])}}},'
        else:
            fits = f"offset {numbers['offset']} scale {numbers['scale']}"
            text = f"{KEYS[channel['role']]} {name} {fits} # {numbers['unit']}"
            if channel.get("heading", name) != name:
                text += f", from {channel['heading']}"
        lines.append(text)
    if all(channel["constant"] for channel in channels):
        progress_console.print("aeolid: every channel is constant; is it a recording of a turbine that runs?")
    return lines


def _literal(number: str) -> str:
    """Write a number as a C float."""
    return number + ("f" if any(mark in number for mark in ".e") else ".0f")
