"""Identify a model from recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import (
    BladesOption,
    ForceOption,
    JsonOption,
    ResampleOption,
    RolesOption,
    SafeConsole,
    console,
    emit_json,
    extent,
    load_roles,
    one_of,
    progress_console,
    waiting,
)
from aeolid.cli.identify_structure import fit_structure
from aeolid.identify.request import Request
from aeolid.identify.request_checks import METHODS
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.record import Roles

    Result = Identification | LpvIdentification | OrtIdentification

EXAMPLES = (
    "aeolid identify monday.csv --roles roles.toml --past 30 --out model.json",
    "aeolid identify monday.csv tuesday.csv --roles roles.toml --past 30 --report model.html --out model.json",
    "aeolid identify monday.csv --roles roles.toml --outputs all --out modes.json",
    "aeolid identify monday.csv --roles roles.toml --structure model.toml --out fitted.toml",
    "aeolid identify received.csv --roles received.roles.toml --past 30 --markov markov.npz --out model.json",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="identify")(identify)


def identify(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of one experiment set.")],
    roles: RolesOption,
    out: Annotated[Path, typer.Option("--out", help="Where to write the model (model.json).")],
    past: Annotated[
        str,
        typer.Option(
            "--past",
            help="Past window p: samples, seconds (12s), or auto: varx, varmax. About a period of the slowest mode.",
            autocompletion=one_of("auto"),
        ),
    ] = "auto",
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="varx; varmax: a short window does; lpv, lpv-kernel: depends on a measured scheduling; "
            "ort: a measured disturbance as instrument (as an input of varx it mostly tells more); "
            "fir: open loop, coloured noise.",
            autocompletion=one_of(*METHODS),
        ),
    ] = "varx",
    future: Annotated[int | None, typer.Option("--future", help="Future window f; default p.")] = None,
    order: Annotated[
        str, typer.Option("--order", help="Number of states, or auto.", autocompletion=one_of("auto"))
    ] = "auto",
    order_criterion: Annotated[
        str | None,
        typer.Option(
            "--order-criterion",
            help="varx, varmax: held-out (default), aic, bic or gap decides on the order.",
            autocompletion=one_of("held-out", "aic", "bic", "gap"),
        ),
    ] = None,
    markov: Annotated[Path | None, typer.Option("--markov", help="Streamed Markov parameters (markov.npz).")] = None,
    feedthrough: Annotated[
        list[str] | None,
        typer.Option(
            "--feedthrough",
            help="Input that acts within the sample; repeatable; none, or auto (default; lpv: none): those that the "
            "recording shows. ort: disturbance that does, default all, or none.",
            autocompletion=one_of("auto", "none"),
        ),
    ] = None,
    regularize: Annotated[
        str,
        typer.Option("--regularize", help="gcv, none, or a relative λ in 0 … 1.", autocompletion=one_of("gcv", "none")),
    ] = "gcv",
    missing: Annotated[
        str | None,
        typer.Option(
            "--missing",
            help="varx, varmax: auto (default) draws single missing cells from the others, or leave-out.",
            autocompletion=one_of("auto", "leave-out"),
        ),
    ] = None,
    detrend: Annotated[
        str | None,
        typer.Option(
            "--detrend",
            help="varx, varmax: none, offset of each recording (default), linear, or high-pass.",
            autocompletion=one_of("none", "offset", "linear", "high-pass"),
        ),
    ] = None,
    robust: Annotated[
        str | None,
        typer.Option(
            "--robust",
            help="varx, varmax: spikes of outputs taken for missing: auto (default), always, or never.",
            autocompletion=one_of("auto", "always", "never"),
        ),
    ] = None,
    solution: Annotated[
        str | None,
        typer.Option(
            "--solution",
            help="varx, singular data: Markov parameters that are smallest, pivoted (on fewest channels), or auto.",
            autocompletion=one_of("auto", "smallest", "pivoted"),
        ),
    ] = None,
    decimate: Annotated[int, typer.Option("--decimate", help="Lower the sample rate by this factor first.")] = 1,
    passes: Annotated[
        int | None, typer.Option("--passes", help="varmax: passes of extended least squares, 0 to 1000; default 3.")
    ] = None,
    forget: Annotated[
        float | None, typer.Option("--forget", help="varmax: forgetting of the first pass, 0.9 to 1; default 1.")
    ] = None,
    delay: Annotated[
        list[str] | None,
        typer.Option(
            "--delay",
            help="varx, varmax, fir: NAME=SAMPLES by which an input acts late, repeatable; auto (default), or none.",
            autocompletion=one_of("auto", "none"),
        ),
    ] = None,
    angle: Annotated[
        list[str] | None,
        typer.Option(
            "--angle",
            help="Channel to replace by its cosine and sine; repeatable. auto: those that wrap (default), or none.",
            autocompletion=one_of("auto", "none"),
        ),
    ] = None,
    scheduling: Annotated[
        list[str] | None, typer.Option("--scheduling", help="lpv: channel to schedule with; default those of the role.")
    ] = None,
    varying: Annotated[
        str | None, typer.Option("--varying", help="lpv: matrices that depend on it, of A,B,C,D,K; default A,B,K.")
    ] = None,
    kernel_rows: Annotated[
        int | None, typer.Option("--kernel-rows", help="lpv-kernel: rows of the kernel to use; default all.")
    ] = None,
    kernel_selection: Annotated[
        str | None,
        typer.Option(
            "--kernel-selection",
            help="lpv-kernel: greedy (default), or the first rows.",
            autocompletion=one_of("greedy", "first"),
        ),
    ] = None,
    scheduling_scaling: Annotated[
        str | None,
        typer.Option(
            "--scheduling-scaling",
            help="lpv: range (default: mean 0, within 0.1), none, centre, standard, or auto by held-out error.",
            autocompletion=one_of("auto", "range", "none", "centre", "standard"),
        ),
    ] = None,
    kernel_tolerance: Annotated[
        float | None,
        typer.Option(
            "--kernel-tolerance", help="lpv-kernel: take rows until what is left is below this, of the largest; 0 to 1."
        ),
    ] = None,
    offsets: Annotated[
        bool | None, typer.Option("--offsets/--no-offsets", help="lpv: free constants; default where means matter.")
    ] = None,
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine", help="Prediction-error steps. lpv: default on; varx, varmax: default off."
        ),
    ] = None,
    memory: Annotated[
        float | None, typer.Option("--memory", help="lpv: refuse what needs more gigabytes; default 4.")
    ] = None,
    joint_order: Annotated[
        int | None, typer.Option("--joint-order", help="ort: states of plant and controller together; default auto.")
    ] = None,
    deterministic_order: Annotated[
        int | None,
        typer.Option(
            "--deterministic-order", help="ort: states of what the disturbance explains; default the joint order."
        ),
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(
            "--response",
            help="ort: of the disturbance, fit (default) or theorem (paper 002).",
            autocompletion=one_of("fit", "theorem"),
        ),
    ] = None,
    stable: Annotated[bool, typer.Option("--stable", help="Move poles on or outside the unit circle inside.")] = False,
    allow_unstable: Annotated[
        bool, typer.Option("--allow-unstable", help="Write a model that is unstable or whose free run diverges.")
    ] = False,
    uncertainty: Annotated[
        str | None,
        typer.Option(
            "--uncertainty",
            help="varx, varmax: asymptotic (default), bootstrap, or none of the deviations.",
            autocompletion=one_of("asymptotic", "bootstrap", "none"),
        ),
    ] = None,
    bootstrap_runs: Annotated[
        int | None, typer.Option("--bootstrap-runs", help="Runs of the bootstrap, 20 to 10000; default 200.")
    ] = None,
    bootstrap_seed: Annotated[
        int | None, typer.Option("--bootstrap-seed", help="Seed of the bootstrap; default 0.")
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--outputs",
            help="varx, varmax: channel to identify by itself, without inputs; repeatable, or all of the role output.",
            autocompletion=one_of("all"),
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option("--reference", help="varx, varmax: output that mode shapes are scaled to; default the largest."),
    ] = None,
    blades: BladesOption = None,
    structure: Annotated[
        Path | None,
        typer.Option("--structure", help="model.toml: fit its free values instead; --out then is a model.toml."),
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write a self-contained HTML page.")] = None,
    resample: ResampleOption = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Identify a model by predictor-based subspace identification, from open- or closed-loop recordings."""
    request = Request(
        past=past, method=method, future=future, order=order, order_criterion=order_criterion, feedthrough=feedthrough,
        regularize=regularize, missing=missing, detrend=detrend, robust=robust, solution=solution, decimate=decimate,
        passes=passes, forget=forget, delay=delay, angle=angle, scheduling=scheduling, varying=varying,
        kernel_rows=kernel_rows, kernel_selection=kernel_selection, kernel_tolerance=kernel_tolerance,
        scheduling_scaling=scheduling_scaling, offsets=offsets, refine=refine, memory=memory, joint_order=joint_order,
        deterministic_order=deterministic_order, response=response, stable=stable, allow_unstable=allow_unstable,
        uncertainty=uncertainty, bootstrap_runs=bootstrap_runs, bootstrap_seed=bootstrap_seed,
        outputs=outputs, reference=reference, blades=blades,
    )  # fmt: skip
    if structure is not None:
        fit_structure(structure, recordings, roles, out, json_target, resample, request, [markov, report], force)
        return
    request.check(streamed=markov is not None)
    files = {"--out": out, "--report": report, "--json": json_target}
    declare("identify", force=force, inputs=[*recordings, roles, markov], files=files)
    shown = progress_console if json_target == "-" else console
    result = _identified(recordings, load_roles(roles, resample), markov, request, shown)
    emit_json(result.model_json(), str(out))
    if json_target != "-":
        console.print(result.summary(), markup=False)
        console.print(f"model written to {out}")
    if report is not None:
        _report(result, recordings, report)
    emit_json(result.to_json(), json_target)


def _identified(
    recordings: list[Path], roles: Roles, markov: Path | None, request: Request, shown: SafeConsole
) -> Result:
    """Read the recordings, say how much was read, and identify; shows what takes its time."""
    from aeolid.formats import read_record
    from aeolid.identify.run import identify_records
    from aeolid.identify.streamed import StreamedMarkov

    with waiting("reading"):
        records = [read_record(path, roles) for path in recordings]
        streamed = None if markov is None else StreamedMarkov.load(markov)
    for record in records:
        shown.print(extent(record), markup=False, soft_wrap=True)
    return identify_records(records, request, streamed, waiting)


def _report(result: Result, recordings: list[Path], report: Path) -> None:
    from aeolid.report import identification_facts, render_identification

    title = f"Identification of {', '.join(p.name for p in recordings)}"
    render_identification(identification_facts(result.model_json(), title=title), report)
