"""Follow the modes of a fleet over time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import ForceOption, JsonOption, RolesOption, console, emit_json, progress_console
from aeolid.cli.pools import (
    InsecureOption,
    SchedulerOption,
    TlsCaOption,
    TlsCertOption,
    TlsKeyOption,
    Where,
    WorkersOption,
)
from aeolid.cli.publishing import PublishOption, publish_once, targets_of
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.output import declare, make_folder
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.fleet.plan import Plan
    from aeolid.record import Roles

EXAMPLES = (
    "aeolid fleet recordings --roles roles.toml --past 30 --out trends",
    'aeolid fleet "park/*/2026-*.csv" --roles roles.toml --past 30 --window 1w --models --out trends',
    "aeolid fleet park --roles roles.toml --past 12s --out above_rated --keep status=1 --keep wind=12..",
    "aeolid fleet park --roles roles.toml --past 12s --out trends --diagnose my_case --workers 2",
)

FILES = ("modes.parquet", "fleet.json", "report.html")


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="fleet")(fleet)


def fleet(
    recordings: Annotated[
        list[str], typer.Argument(metavar="DIR|GLOB...", help="Folders (searched to the bottom), patterns or files.")
    ],
    roles: RolesOption,
    past: Annotated[str, typer.Option("--past", help="Past window p in samples, or in seconds (12s).")],
    out: Annotated[Path, typer.Option("--out", help="Folder for the table, the page and the cache of factors.")],
    order: Annotated[str, typer.Option("--order", help="Number of states, or auto: one for each turbine.")] = "auto",
    group: Annotated[
        str | None,
        typer.Option(
            "--group",
            help="Regular expression on the path with (?P<turbine>…), (?P<period>…) or (?P<start>…), a date. "
            "Turbine is by default the folder's name.",
        ),
    ] = None,
    window: Annotated[
        str | None, typer.Option("--window", help="Length of a period, for example 1d, 6h, 30min; default 1d.")
    ] = None,
    feedthrough: Annotated[
        list[str] | None, typer.Option("--feedthrough", help="Input that acts within the sample; repeatable.")
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(
            "--keep", metavar="CHANNEL=LOW..HIGH", help="Use samples of this range or state only; all of several."
        ),
    ] = None,
    models: Annotated[
        bool, typer.Option("--models", help="Write the model of each period, models/TURBINE/PERIOD.json.")
    ] = False,
    diagnose: Annotated[
        Path | None,
        typer.Option(
            "--diagnose", metavar="CASE_DIR", help="Hold each turbine's recordings against the baseline of this case."
        ),
    ] = None,
    fail_on_change: Annotated[
        bool, typer.Option("--fail-on-change", help="Exit 1 when a mode has moved by more than chance.")
    ] = False,
    publish: PublishOption = None,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
    insecure_scheduler: InsecureOption = False,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Map recordings to models of each turbine and period and follow their modes; a second run does what is new."""
    where = Where(workers, scheduler, tls_ca, tls_cert, tls_key, insecure_scheduler)
    where.check()
    targets = targets_of(publish)
    from aeolid.fleet.plan import find_recordings
    from aeolid.fleet.run import run_fleet
    from aeolid.fleet.tables import mode_rows, write_models, write_modes
    from aeolid.report.fleet import render_fleet

    paths = find_recordings(recordings, out)
    plan = _plan(roles, past, paths, order, group, window, feedthrough, keep)
    files = {"--json": json_target}
    declare("fleet", force=force, inputs=[roles, *paths], folders={"--out": out}, files=files, inside=FILES)
    if models:
        make_folder(out / "models")
    try:
        with where.open(len(paths)) as pool, _progress() as notice:
            facts = run_fleet(paths, plan, out, pool, notice)
    except KeyboardInterrupt:
        progress_console.print(f"stopped; what is finished is kept in {out / 'cache'}: the same command goes on there")
        raise
    write_modes(out / "modes.parquet", mode_rows(facts["periods"]))
    if models:
        write_models(out / "models", facts["periods"])
    emit_json(facts, str(out / "fleet.json"))
    render_fleet(facts, out / "report.html")
    if json_target != "-":
        console.print(_text(facts, out, models), markup=False)
    if targets:
        from aeolid.publish.rows import rows_of_fleet

        publish_once(targets, rows_of_fleet(facts))
    if diagnose is not None:
        members = _members(facts, plan, paths)
        facts["diagnoses"] = _diagnose(diagnose, roles, members, out, where, force, json_target != "-")
    emit_json(facts, json_target)
    if fail_on_change and facts["moved"]:
        raise typer.Exit(1)
    if fail_on_change and len(facts["untested"]) == facts["turbines"]:
        raise NotIdentifiable(f"--fail-on-change: no mode of any turbine could be tested; {facts['untested'][0]}")


def _diagnose(
    template: Path, roles: Path, members: dict[str, list[Path]], out: Path, where: Where, force: bool, told: bool
) -> list[dict[str, Any]]:
    """Diagnose each turbine with the baseline of a case; returns the rows of their table."""
    from aeolid.cli.diagnose_many import run_many, show
    from aeolid.cli.diagnose_piece import Asked
    from aeolid.fleet.cases import write_cases

    cases = write_cases(template, roles, members, out / "cases")
    asked = Asked(0, 1, 3600.0, True, False, None, True)  # null simulations of each turbine would take days
    rows = run_many(cases, out / "diagnoses", asked, where, force)
    if told:
        show(rows, out / "diagnoses")
    return rows


def _members(facts: dict[str, Any], plan: Plan, paths: list[Path]) -> dict[str, list[Path]]:
    """Return the recordings of each turbine that were used, in the order of their names."""
    left = {row["name"] for row in facts["skipped"] if row["kind"] == "recording"}
    found: dict[str, list[Path]] = {}
    for path in sorted(paths):
        if str(path) not in left:
            found.setdefault(plan.place(path)[0], []).append(path)
    return found


def _plan(
    roles: Path, past: str, paths: list[Path], order: str, group: str | None, window: str | None,
    feedthrough: list[str] | None, keep: list[str] | None,
) -> Plan:  # fmt: skip
    from aeolid.fleet.keep import parse_keep
    from aeolid.fleet.plan import Plan, names_period, parse_window
    from aeolid.record import Roles

    try:
        states = None if order == "auto" else int(order)
    except ValueError:
        raise UsageError(f"--order {order!r} is neither a whole number nor auto") from None
    length = None if window is None and names_period(group) else parse_window(window or "1d")
    held = Roles.load(roles)
    rules = tuple(parse_keep(text, held) for text in keep or ())
    return Plan(held, _samples(past, held, paths), states, tuple(feedthrough or ()), group, length, rules)


def _samples(past: str, roles: Roles, paths: list[Path]) -> int:
    """Return the window in samples; of one in seconds by the sample time of the first recording that can be read."""
    from aeolid.durations import read_duration
    from aeolid.errors import AeolidError
    from aeolid.formats import read_record
    from aeolid.identify.choose_past import read_past

    step = roles.sample_time_s
    if read_duration(past, bare=False) is None:
        found = read_past(past, 1.0)
        if found is None:
            raise UsageError("--past auto is for identify; give the fleet one window, in samples (30) or seconds (12s)")
        return found
    for path in paths if step is None else ():
        try:
            step = read_record(path, roles).sample_time_s
            break
        except AeolidError:  # the run says of each recording why it cannot be read
            continue
    return read_past(past, step or 1.0) or 1


@contextmanager
def _progress() -> Iterator[Any]:
    """Show a bar with the time left for each stage on standard error."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:>10}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    stages: dict[str, Any] = {}
    with Progress(*columns, console=progress_console, disable=not progress_console.is_terminal) as bar:

        def notice(stage: str, done: int, of: int) -> None:
            if stage not in stages:
                stages[stage] = bar.add_task(stage, total=of)
            bar.update(stages[stage], completed=done)

        yield notice


def _text(facts: dict[str, Any], out: Path, models: bool) -> str:
    from aeolid.fleet.onset import conclusions

    lines = [
        f"{facts['usable']} of {counted(facts['recordings'], 'recording')} used "
        f"({counted(facts['reused'], 'factor')} from an earlier run), "
        f"{counted(facts['turbines'], 'turbine')}, {counted(len(facts['periods']), 'period')}"
    ]
    lines += [f"  {turbine}: {reason}" for turbine, reason in facts["order_reasons"].items()]
    if facts["moved"]:
        lines += ["modes that moved:", *(f"  {text}" for text in conclusions(facts))]
    elif len(facts["periods"]) > facts["turbines"]:
        lines += conclusions(facts)
    lines += [f"note: {note}" for note in facts["notes"]]
    if facts["skipped"]:
        lines.append(f"{len(facts['skipped'])} left out:")
        lines += [f"  {row['kind']} {row['name']}: {row['reason']}" for row in facts["skipped"][:20]]
    if len(facts["skipped"]) > 20:
        lines.append(f"  and {len(facts['skipped']) - 20} more, see {out / 'report.html'}")
    written = "modes.parquet, fleet.json and report.html"
    return "\n".join([*lines, f"{written} written to {out}" + (", models to its folder models" if models else "")])
