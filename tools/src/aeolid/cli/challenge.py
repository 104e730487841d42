"""aeolid challenge: make cases with concealed physics, have them diagnosed blind, count, decide again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from aeolid.cli.challenge_rescore import bar_of_cases, read_rules, rescore_step
from aeolid.cli.common import ForceOption, JsonOption, console, emit_json, one_of, progress_console
from aeolid.cli.durations import seconds_of
from aeolid.errors import UsageError
from aeolid.output import declare
from aeolid.wording import counted

EXAMPLES = (
    "aeolid challenge make proof --cases 60 --seed 7",
    "aeolid challenge make rigs --physics foreign    # needs aeolid[challenge]",
    "aeolid challenge run proof --workers 2    # goes on where it stopped",
    "aeolid challenge score proof --fail-below 0.8",
    "aeolid challenge rescore proof --rules mine.toml    # seconds; --fits diagnoses what this leaves open",
)
STEPS = {
    "make": ("cases", "seed", "samples", "physics", "chain"),
    "run": ("workers", "out", "sham", "timeout", "keep", "rules"),
    "score": ("out", "page", "fail_below"),
    "rescore": ("out", "rules", "fits", "workers", "timeout"),
}


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command("challenge")(challenge)


def challenge(
    step: Annotated[
        str,
        typer.Argument(help="make, run, score, in this order; or rescore.", autocompletion=one_of(*STEPS)),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the cases and the sealed answers.")],
    cases: Annotated[
        int | None, typer.Option("--cases", min=1, max=9999, help="make: number of cases; default 60.")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, max=20_000, help="make: the same seed makes the same bytes; default 1."),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option("--samples", min=1000, max=100_000, help="make: length of each recording; default 6000."),
    ] = None,
    physics: Annotated[
        str | None,
        typer.Option(
            "--physics",
            help="make: own, five plants of this package, or foreign, six rigs that MuJoCo simulates; default own.",
            autocompletion=one_of("own", "foreign"),
        ),
    ] = None,
    chain: Annotated[
        str | None,
        typer.Option(
            "--chain",
            help="make: full, recorded through a measurement chain with small imperfections, or none, as before "
            "version 5 (own physics only); default full.",
            autocompletion=one_of("full", "none"),
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, max=1024, help="run, rescore: cases at a time; default one a core."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="All but make: folder of the results; default DIR/results.")
    ] = None,
    sham: Annotated[
        int | None,
        typer.Option(
            "--sham", min=0, max=1000, help="run: null runs in each diagnosis, which change no verdict; default 0."
        ),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout", parser=seconds_of, metavar="TIME", help="run, rescore: until a case has failed; default 900 s."
        ),
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="run: keep the report and the model of every diagnosis.")
    ] = False,
    rules: Annotated[
        Path | None,
        typer.Option("--rules", metavar="FILE", help="run, rescore: a TOML file of decision rules that differ."),
    ] = None,
    fits: Annotated[
        bool, typer.Option("--fits", help="rescore: diagnose the cases whose margins leave open what the rules do.")
    ] = False,
    page: Annotated[Path | None, typer.Option("--page", help="score: HTML page; default among the results.")] = None,
    fail_below: Annotated[
        float | None, typer.Option("--fail-below", min=0.0, max=1.0, help="score: exit 1 when the recall lies below.")
    ] = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Prove the diagnosis: hide physics in recordings, diagnose them blind, open the answers and count.

    make writes cases without any hint, their answers, and a seal with the hash of both. run diagnoses every case and
    never opens the answers. score checks the seal and prints what was found, missed and wrongly named. rescore decides
    the stored results under other decision rules and prints both tables: those within whose margins the rules stay at
    once, the others with --fits.
    """
    given = {"cases": cases, "seed": seed, "samples": samples, "physics": physics, "chain": chain,
             "workers": workers, "out": out, "sham": sham, "timeout": timeout, "keep": keep or None, "rules": rules,
             "fits": fits or None, "page": page, "fail_below": fail_below}  # fmt: skip
    _check(step, {name for name, value in given.items() if value is not None})
    _check_physics(physics, chain)
    target = out or folder / "results"
    page = page or target / "score.html"
    _declare(step, folder, target, page, json_target, force)
    if step == "make":
        _make(
            folder,
            cases or 60,
            1 if seed is None else seed,
            samples or 6000,
            physics or "own",
            chain != "none",
            json_target,
        )
    elif step == "run":
        _run(
            folder,
            target,
            workers or len(os.sched_getaffinity(0)),
            sham or 0,
            900.0 if timeout is None else timeout,
            keep,
            rules,
            json_target,
        )
    elif step == "rescore":
        if rules is None:
            raise UsageError("rescore needs --rules FILE: the decision rules to decide by")
        most = 900.0 if timeout is None else timeout
        rescore_step(folder, target, rules, (workers or len(os.sched_getaffinity(0))) if fits else 0, most, json_target)
    else:
        _score(folder, target, page, fail_below, json_target)


def _declare(step: str, folder: Path, target: Path, page: Path, json_target: str | None, force: bool) -> None:
    """Say where a step writes; the folder of results is emptied of old diagnoses, so it must be of our making."""
    from aeolid.challenge.run import read_results
    from aeolid.challenge.write import read_seal

    files: dict[str, str | Path | None] = {"--json": json_target}
    if step == "rescore":
        read_results(folder, target)
        declare("challenge rescore", force=force, folders={"--out": target / "rescored"}, files=files, claimed=True)
    elif step == "score":
        read_results(folder, target)  # what is missing is told before where the page would go
        declare("challenge score", force=force, files=files | {"--page": page})
    elif step == "make":
        declare("challenge make", force=force, folders={"DIR": folder}, files=files)
    else:
        if target.resolve() == folder.resolve():
            raise UsageError(f"--out {target}: holds the cases themselves; name another folder")
        read_seal(folder)
        declare("challenge run", force=force, folders={"--out": target}, files=files, claimed=True)


def _check(step: str, given: set[str]) -> None:
    if step not in STEPS:
        raise UsageError(f"there is no step {step!r}; make, run and score follow each other, rescore any run")
    for name in sorted(given - set(STEPS[step])):
        home = " and ".join(s for s, names in STEPS.items() if name in names)
        raise UsageError(f"--{name.replace('_', '-')} goes with {home}, not with {step}")


def _check_physics(physics: str | None, chain: str | None) -> None:
    """Refuse what cannot be simulated before anything is written."""
    if physics not in (None, "own", "foreign"):
        raise UsageError(f"--physics {physics}: is neither own nor foreign")
    if chain not in (None, "full", "none"):
        raise UsageError(f"--chain {chain}: is neither full nor none")
    if physics == "foreign" and chain == "none":
        raise UsageError("--chain none: foreign rigs are always recorded through a chain")
    if physics == "foreign":
        from aeolid.challenge.engine import require_engine

        require_engine()


def _make(
    folder: Path, cases: int, seed: int, samples: int, physics: str, chained: bool, json_target: str | None
) -> None:
    from aeolid.challenge.write import make

    with bar_of_cases("making") as tell:
        seal = make(folder, cases=cases, seed=seed, samples=samples, physics=physics, chained=chained, notice=tell)
    if json_target != "-":
        console.print(f"{counted(cases, 'case')} in {folder}; answers sealed, SHA-256 {seal['sha256']}", soft_wrap=True)
    emit_json(seal, json_target)


def _run(
    folder: Path, target: Path, workers: int, sham: int, timeout: float, keep: bool, rules: Path | None,
    json_target: str | None,
) -> None:  # fmt: skip
    if timeout < 1:
        raise UsageError(f"--timeout {timeout:g} is no time of a second or more")
    from aeolid.challenge.run import run
    from aeolid.fleet.workers import open_pool

    own = None if rules is None else read_rules(rules)
    try:
        with open_pool(workers, threads=workers > 1) as pool, bar_of_cases("diagnosing") as tell:
            results = run(
                folder, target, pool, sham=sham, most_s=timeout, keep=keep, rules=own,
                notice=lambda done, of, result: tell(done, of),
            )  # fmt: skip
    except KeyboardInterrupt:
        progress_console.print(f"stopped; finished cases are kept in {target}: the same command goes on there")
        raise
    failed = [r for r in results if r["outcome"] != "done"]
    if json_target != "-":
        console.print(
            f"{counted(len(results), 'case')} diagnosed, {len(failed)} without a verdict; results in {target}",
            soft_wrap=True,
        )
        for result in failed:
            console.print(f"  {result['case']}: {result['outcome']}: {result['reason']}", markup=False, soft_wrap=True)
    emit_json(results, json_target)


def _score(folder: Path, target: Path, page: Path, fail_below: float | None, json_target: str | None) -> None:
    from aeolid.challenge.page import render, text
    from aeolid.challenge.score import failed, score

    facts = score(folder, target)
    render(facts, page)
    if json_target != "-":
        console.print(text(facts), markup=False, soft_wrap=True)
        console.print(f"page: {page}", markup=False, soft_wrap=True)
    emit_json(facts, json_target)
    if fail_below is not None and failed(facts, fail_below):
        raise typer.Exit(1)
