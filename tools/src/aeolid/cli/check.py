"""aeolid check: show what a case was understood as, before anything is computed."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, ResampleOption, console, emit_json, extent, read_resample
from aeolid.errors import DataError
from aeolid.file_kinds import require_case
from aeolid.output import declare
from aeolid.wording import plain

if TYPE_CHECKING:
    from rich.table import Table

    from aeolid.diagnose.data.case import Case
    from aeolid.record import Record

_NUMBERS = ("missing", "least", "mean", "greatest")
_WORDS = ("channel", "role")
EXAMPLES = ("aeolid check my_case", "aeolid check my_case --picture my_case/check.html --json -")


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("check")(run)


def run(
    case: Annotated[Path, typer.Argument(metavar="CASE_DIR", help="Directory with case.toml.")],
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Write a page (.html) that draws every channel over time.")
    ] = None,
    allow_outside: Annotated[
        bool, typer.Option("--allow-outside", help="Read also files that the case names outside its folder.")
    ] = False,
    allow_fmu: Annotated[bool, typer.Option("--allow-fmu", help="Open also a unit with a native library.")] = False,
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Show what a case was understood as: rate, duration, samples, holes, units, holds, and what looks odd.

    Nothing is computed from it. A baseline that cannot be read is said after the recordings, exit code 3.
    """
    from aeolid.begin.understood import doubts

    require_case(case)
    declare("check", force=force, inputs=[case], files={"--picture": picture, "--json": json_target})
    records, held, fault = _loaded(case, allow_outside, allow_fmu, read_resample(resample))
    run_record = _run_of(held)
    odd = doubts(records, run_record, {} if held is None else held.context)
    files = [("recording", r) for r in records] + ([("baseline run", run_record)] if run_record is not None else [])
    if json_target != "-":
        _show(files, held, odd)
    if picture is not None:
        _draw(case, records, run_record, files, odd, picture)
    emit_json(_facts(files, held, odd, fault), json_target)
    if fault is not None:
        raise fault


def _loaded(
    case: Path, allow_outside: bool, allow_fmu: bool, resample: float | str | None
) -> tuple[tuple[Record, ...], Case | None, DataError | None]:
    """Return the recordings, the whole case, and what is wrong with it where only the recordings can be read."""
    from aeolid.diagnose.data.case import load_case, load_recordings

    try:
        held = load_case(case, allow_outside=allow_outside, allow_fmu=allow_fmu, resample=resample)
        return held.records, held, None
    except DataError as error:
        told = logging.getLogger("aeolid.formats")
        told.disabled = True  # what there is to say of the files has been said
        try:
            return load_recordings(case, allow_outside=allow_outside, resample=resample), None, error
        finally:
            told.disabled = False


def _run_of(held: Case | None) -> Record | None:
    from aeolid.record import Record

    return held.baseline if held is not None and isinstance(held.baseline, Record) else None


def _show(files: list[tuple[str, Record]], held: Case | None, odd: tuple[str, ...]) -> None:
    from rich.measure import Measurement

    from aeolid.begin.understood import holes_of, rows_of, sparkline

    for kind, record in files:
        console.print(f"{kind} {extent(record)}, {holes_of(record).text()}", markup=False, soft_wrap=True)
        rows = rows_of(record)
        drawn = {w: [[*_cells(r), sparkline(record.column(r.name), w)] for r in rows] for w in (24, 16, 10)}
        tables = [_table(drawn[w], True, ()) for w in drawn] + [_table(drawn[10], False, f) for f in ((), _WORDS)]
        unbounded = console.options.update_width(10_000)  # else a measure is cut to the terminal's width
        fitting = (t for t in tables if Measurement.get(console, unbounded, t).minimum <= console.width)
        console.print(next(fitting, None) or _table(drawn[10], False, (*_WORDS, "unit", *_NUMBERS)))
    if held is not None:
        context = ", ".join(f"{k} = {v}" for k, v in held.context.items())
        console.print(f"baseline: {held.kind}, {held.baseline_file}; context: {context or 'none'}", markup=False)
    for text in odd:
        console.print(f"look at this: {text}", markup=False, soft_wrap=True)


def _table(rows: list[list[str]], picture: bool, folded: tuple[str, ...]) -> Table:
    """Return channels as a table; folded: columns whose cells may take several lines."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 1))
    headings = ("channel", "unit", "role", "between samples", *_NUMBERS, "over time")[: 9 if picture else 8]
    for heading in headings:
        may = heading in folded or heading == "between samples"
        justify: Any = "right" if heading in _NUMBERS else "left"
        table.add_column(heading, justify=justify, overflow="fold", no_wrap=not may)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row[: len(headings)]))
    return table


def _cells(row: Any) -> list[str]:
    numbers = (plain(f"{v:.4g}") for v in (row.low, row.mean, row.high))
    return [row.name, row.unit, row.role, row.hold, str(row.missing) if row.missing else "", *numbers]


def _draw(
    case: Path, records: tuple[Record, ...], run_record: Record | None, files: list[tuple[str, Record]],
    odd: tuple[str, ...], picture: Path,
) -> None:  # fmt: skip
    from aeolid.begin.understood import holes_of, rows_of
    from aeolid.report.recordings import render_recordings

    tables = [(f"{kind}: {extent(r)}, {holes_of(r).text()}", [_cells(row) for row in rows_of(r)]) for kind, r in files]
    render_recordings(f"What {case.name} was understood as", records, run_record, tables, odd, picture)
    console.print(f"picture written to {picture}", markup=False, soft_wrap=True)


def _facts(
    files: list[tuple[str, Record]], held: Case | None, odd: tuple[str, ...], fault: DataError | None
) -> dict[str, Any]:
    from aeolid.begin.understood import holes_of, rows_of

    listed = [
        {
            "kind": kind, "file": r.source, "samples": len(r), "sample_time_s": r.sample_time_s,
            "duration_s": len(r) * r.sample_time_s, "begins": r.begins, "holes": holes_of(r).__dict__,
            "channels": [row.to_json() for row in rows_of(r)],
        }
        for kind, r in files
    ]  # fmt: skip
    baseline = None if held is None else {"kind": held.kind, "file": held.baseline_file}
    context = {} if held is None else held.context
    return {"files": listed, "baseline": baseline, "context": context, "look_at": list(odd),
            "fault": None if fault is None else str(fault)}  # fmt: skip
