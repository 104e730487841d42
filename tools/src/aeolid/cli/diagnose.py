"""aeolid diagnose: from a case directory to a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from aeolid.cli.common import (
    ForceOption,
    JsonOption,
    Milestones,
    ResampleOption,
    console,
    emit_json,
    extent,
    progress_console,
    read_resample,
)
from aeolid.cli.diagnose_piece import FILES, Asked, asked_rules
from aeolid.cli.durations import seconds_of
from aeolid.cli.pools import (
    InsecureOption,
    SchedulerOption,
    TlsCaOption,
    TlsCertOption,
    TlsKeyOption,
    Where,
    WorkersOption,
)
from aeolid.file_kinds import require_case
from aeolid.output import declare, discard, make_folder
from aeolid.wording import counted

EXAMPLES = (
    "aeolid diagnose my_case --out my_case/diagnosis",
    "aeolid diagnose turbines/* --out diagnoses",
    "aeolid diagnose my_case --out checked --sham 5 --fail-on-mismatch --json -",
)

OR = " — or: "  # between the explanations of a statement that leaves several open


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("diagnose")(run)


def run(
    cases: Annotated[
        list[Path],
        typer.Argument(
            metavar="CASE_DIR...",
            help="Directory with case.toml, the recordings and the baseline model; of several each gets a folder.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", help="Directory for the diagnosis, the report and the corrected model.")
    ],
    sham: Annotated[
        int, typer.Option("--sham", min=0, max=1000, help="Null simulations; none where the baseline is a run.")
    ] = 20,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the bootstrap and the sham runs.")] = 1,
    fail_on_mismatch: Annotated[
        bool, typer.Option("--fail-on-mismatch", help="Exit 1 when a mismatch is found.")
    ] = False,
    report: Annotated[
        bool, typer.Option("--report/--no-report", help="Draw report.html; without it a run takes seconds less.")
    ] = True,
    allow_outside: Annotated[
        bool, typer.Option("--allow-outside", help="Read also files that the case names outside its folder.")
    ] = False,
    allow_fmu: Annotated[
        bool, typer.Option("--allow-fmu", help="Run the native library of a unit, confined; without it, say its hash.")
    ] = False,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit", parser=seconds_of, metavar="TIME", help="Then the best answer so far, and what is left."
        ),
    ] = 3600.0,  # ten times what the slowest recordings known take on two cores; loaded or long ones must not hang
    resample: ResampleOption = None,
    rules: Annotated[
        Path | None,
        typer.Option("--rules", metavar="FILE", help="For studies: a TOML file of decision rules that differ."),
    ] = None,
    margins: Annotated[
        bool, typer.Option("--margins", help="For studies: write how far each rule could move with the same answer.")
    ] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    tls_ca: TlsCaOption = None,
    tls_cert: TlsCertOption = None,
    tls_key: TlsKeyOption = None,
    insecure_scheduler: InsecureOption = False,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Locate what a model leaves out, name it, model it and prove it on sealed data.

    Writes diagnosis.json, report.html, the corrected model and the sealed data before and after; always ends with a
    verdict. Several cases give one table, cases.csv; what an earlier run did from the same files is not done again,
    and --workers or --scheduler do several at a time.
    """
    from aeolid.errors import UsageError

    if not 0 < time_limit < float("inf"):
        raise UsageError(f"--time-limit {time_limit:g} is no time; give the seconds, above 0")
    own = _read_rules(rules)
    asked = Asked(sham, seed, time_limit, allow_outside, allow_fmu, read_resample(resample), report, own, margins)
    where = Where(workers, scheduler, tls_ca, tls_cert, tls_key, insecure_scheduler)
    where.check()
    if len(cases) > 1:
        verdicts = _many(cases, out, asked, where, json_target, force)
    else:
        verdicts = [_one(cases[0], out, asked, json_target, force)]
    if fail_on_mismatch and any(v not in ("no_mismatch", "immaterial", "not_testable") for v in verdicts):
        raise typer.Exit(1)


def _read_rules(path: Path | None) -> dict[str, dict[str, int | float]]:
    """Return the decision rules of a file that differ from the defaults, by section and name."""
    from aeolid.diagnose.rules import differing, load_rules

    return {} if path is None else differing(load_rules(path))


def _one(case: Path, out: Path, asked: Asked, json_target: str | None, force: bool) -> str:
    """Diagnose one case and say all of it; returns the verdict."""
    require_case(case)
    declare("diagnose", force=force, inputs=[case], folders={"--out": out}, files={"--json": json_target}, inside=FILES)
    diagnosis, evidence = _written(case, out, asked)
    if json_target != "-":
        _print_verdict(diagnosis)
        _print_free_run(evidence, out)
        _print_next(diagnosis)
        if asked.report:
            console.print(f"  report: {out / 'report.html'}", soft_wrap=True, markup=False)
    for warning in diagnosis.get("warnings", []):
        (progress_console if json_target == "-" else console).print(f"WARNING: {warning}", soft_wrap=True, markup=False)
    emit_json(diagnosis, json_target)
    return str(diagnosis["verdict"])


def _many(cases: list[Path], out: Path, asked: Asked, where: Where, json_target: str | None, force: bool) -> list[str]:
    """Diagnose several cases into one table; returns the verdicts of those that could be read."""
    from aeolid.cli.diagnose_many import diagnose_many, in_turn, names_of, run_many, settings_of, show, written_by
    from aeolid.errors import DataError

    named = names_of(cases)
    if where.workers in (None, 1) and where.scheduler is None:
        files = {"--json": json_target}
        declare("diagnose", force=force, inputs=cases, folders={"--out": out}, files=files, inside=written_by(named))

        def diagnose(case: Path, folder: Path) -> dict[str, Any]:
            require_case(case)
            make_folder(folder)
            return _written(case, folder, asked)[0]

        rows = diagnose_many(named, out, settings_of(asked), in_turn(diagnose))
    else:
        rows = run_many(named, out, asked, where, force, json_target)
    if json_target != "-":
        show(rows, out)
    emit_json({"cases": rows}, json_target)
    read = [str(row["verdict"]) for row in rows if row["fault"] is None]
    if not read:
        raise DataError(f"none of {counted(len(rows), 'case')} could be read; the first: {rows[0]['fault']}")
    return read


def _written(case: Path, out: Path, asked: Asked) -> tuple[dict[str, Any], dict[str, Any]]:
    """Diagnose and draw the report; returns the diagnosis and the evidence behind it."""
    with asked_rules(asked, out):
        diagnosis, evidence = _diagnosed(case, out, asked)
    page = out / "report.html"
    discard(page)  # of an earlier run
    if asked.report:
        from aeolid.report.diagnosis import render_diagnosis

        render_diagnosis(diagnosis, evidence, page)
    return diagnosis, evidence


def _diagnosed(case: Path, out: Path, asked: Asked) -> tuple[dict[str, Any], dict[str, Any]]:
    """Diagnose with a bar and the time left; returns the diagnosis and the evidence behind it."""
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from aeolid.diagnose.conclude import conclude, ended
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.deadline import Deadline
    from aeolid.errors import Contradiction

    columns = (
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=progress_console, transient=True) as bar, Milestones() as plain:
        task = bar.add_task("reading", total=1.0)

        def tell(text: str, share: float) -> None:
            bar.update(task, description=text, completed=share)
            plain.reach(f"{text}, {100 * share:.0f} %")

        def doing(what: str) -> None:
            bar.update(task, description=escape(f"fitting {what}"[:60]))
            plain.at = f"fitting {what}"

        late = Deadline(asked.time_limit, notice=doing)
        try:
            loaded = load_case(
                case, allow_outside=asked.allow_outside, allow_fmu=asked.allow_fmu, resample=asked.resample
            )
            for record in loaded.records:
                progress_console.print(extent(record), markup=False, soft_wrap=True)
            if loaded.kind == "fmu":
                unit = f"running {loaded.baseline_file}, SHA-256 {loaded.baseline_sha256}, in a confined process"
                progress_console.print(unit, markup=False, soft_wrap=True)
            return conclude(loaded, out, sham=asked.sham, seed=asked.seed, progress=tell, deadline=late)
        except Contradiction as error:  # the files themselves disagree about the recording
            return ended("data_fault", case.name, str(error), out)


def _print_verdict(diagnosis: dict[str, Any]) -> None:
    """Say verdict, parameters and sealed proof in a few lines; names come from files, so nothing in them is markup."""
    from rich.markup import escape

    from aeolid.diagnose.hypotheses.catalogue import in_words
    from aeolid.wording import odds, spoken

    alternatives = diagnosis["statement"].split(OR) if diagnosis["verdict"] == "ambiguous" else []
    said = diagnosis["statement"] if len(alternatives) < 2 else "more than one explanation fits; one of"
    console.print(f"[bold]{diagnosis['verdict']}[/bold]: {escape(in_words(spoken(said)))}", soft_wrap=True)
    for text in alternatives if len(alternatives) > 1 else []:
        console.print(f"  - {in_words(spoken(text))}", soft_wrap=True, markup=False)
    for text in told_once(diagnosis.get("data_notes", ())):
        console.print(f"  data: {text}", soft_wrap=True, markup=False)
    named = [effect["id"] for effect in diagnosis["effects"]]
    for effect in diagnosis["effects"]:
        _print_values(effect, named.count(effect["id"]) > 1)
    sealed = diagnosis["sealed"]
    if sealed["nrmse_before"]:
        low, high = sealed["interval"]
        console.print(f"  sealed data: {sealed['data']}", markup=False)
        console.print(
            f"  log-likelihood gain {sealed['log_likelihood_gain']:.1f} (90 % interval {low:.1f} … {high:.1f}),"
            f" {odds(sealed['log_likelihood_gain'])} for the corrected model",
            soft_wrap=True,
        )
        for name, before in sealed["nrmse_before"].items():
            console.print(
                f"  {name}: normalised error {before:.3g} before, {sealed['nrmse_after'][name]:.3g} after", markup=False
            )


def told_once(notes: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the notes on the data as text, one line for what is the same in several recordings of a channel.

    >>> told_once([{"channel": f"u ({i}.csv)", "finding": "2 of 9 are missing"} for i in range(3)])
    ['u (3 recordings): 2 of 9 are missing']
    """
    places: dict[tuple[str, str], list[str]] = {}
    for note in notes:
        name, _, file = note["channel"].removesuffix(")").partition(" (")
        places.setdefault((name, note["finding"]), []).append(file)
    found = []
    for (name, finding), files in places.items():
        where = files[0] if len(files) == 1 else counted(len(files), "recording")
        found.append(f"{name} ({where}): {finding}" if files[0] else f"{name}: {finding}")
    return found


def _print_values(effect: dict[str, Any], placed: bool = False) -> None:
    """Say the values of an effect, each by what it means, and what to set in which simulator.

    placed: with where it enters, as two explanations may be one effect at two places.
    """
    from aeolid.diagnose.hypotheses.catalogue import meaning_of, name_of
    from aeolid.report.numbers import OPEN, is_loose
    from aeolid.wording import place, plain, plus_minus

    where = place(effect["location"]["entry"]) if placed else ""
    called = f"{name_of(effect['id'])}, {where}" if where else name_of(effect["id"])
    for name, value in effect["parameters"].items():
        told = "beyond what these data resolve" if value["value"] is None else f"{value['value']:.4g}"
        unit = "" if value["unit"] in ("", "1") else f" {value['unit']}"
        if value["std"] is None or value["value"] is None:
            spread = ""
        elif is_loose(value["value"], value["std"]):
            spread, unit = f"{unit} ({OPEN})", ""
        else:
            told, spread = plus_minus(value["value"], value["std"]), ""
        meaning = meaning_of(effect["id"], name)
        label = f"{meaning} ({name})" if meaning else name
        console.print(f"  {called}: {label} = {plain(told + spread)}{unit}", soft_wrap=True, markup=False)
    for row in effect.get("settings", []):
        console.print(f"  in {row['simulator']}: set {row['set']}", soft_wrap=True, markup=False)


def _print_next(diagnosis: dict[str, Any]) -> None:
    """Say what to record next, where there is something to decide."""
    from aeolid.diagnose.hypotheses.catalogue import in_words
    from aeolid.wording import spoken

    if diagnosis["next_experiment"]:
        text = in_words(spoken(diagnosis["next_experiment"]["text"]))
        console.print(f"  record next: {text}", soft_wrap=True, markup=False)


def _print_free_run(evidence: dict[str, Any], out: Path) -> None:
    """Say what the corrected model's own values are worth, where they are not those just told."""
    file = out / "model" / "model.toml"
    for o in (evidence.get("free_run") or {"outputs": []})["outputs"]:
        told = (
            f"{o['one_step']:.3g} {o['unit']} with these values, {o['free_run']:.3g} {o['unit']} with those of {file}"
        )
        console.print(
            f"  {o['name']}: a free run on the selection data has an error of {told}", soft_wrap=True, markup=False
        )
