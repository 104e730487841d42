"""Identify a model from recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import FILTERS, ForceOption, JsonOption, RolesOption, console, emit_json, one_of, waiting
from aeolid.errors import UsageError
from aeolid.output import declare

if TYPE_CHECKING:
    from aeolid.identify.lpv import LpvIdentification
    from aeolid.identify.ort import OrtIdentification
    from aeolid.identify.result import Identification
    from aeolid.record import Record

EXAMPLES = (
    "aeolid identify monday.csv --roles roles.toml --past 30 --out model.json",
    "aeolid identify monday.csv tuesday.csv --roles roles.toml --past 30 --report model.html --out model.json",
    "aeolid identify received.csv --roles received.roles.toml --past 30 --markov markov.npz --out model.json",
)
METHODS = ("varx", "varmax", "lpv", "lpv-kernel", "ort", "fir")
SCHEDULED = METHODS[2:4]


def register(app: typer.Typer) -> None:
    """Add the sub-command."""
    app.command(name="identify")(identify)


def identify(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings of one experiment set.")],
    roles: RolesOption,
    past: Annotated[
        int, typer.Option("--past", help="Past window p in samples, about one period of the slowest mode.")
    ],
    out: Annotated[Path, typer.Option("--out", help="Where to write the model (model.json).")],
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="varx; varmax: a short window does; lpv, lpv-kernel: depends on a measured scheduling; "
            "ort: closed loop without a test signal, a measured disturbance; fir: open loop, coloured noise.",
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
            help="Input that acts within the sample; repeatable. ort: disturbance that does, default all, or none.",
        ),
    ] = None,
    regularize: Annotated[
        str,
        typer.Option("--regularize", help="gcv, none, or a relative λ in 0 … 1.", autocompletion=one_of("gcv", "none")),
    ] = "gcv",
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
    response: Annotated[
        str | None,
        typer.Option(
            "--response",
            help="ort: of the disturbance, fit (default) or theorem (paper 002).",
            autocompletion=one_of("fit", "theorem"),
        ),
    ] = None,
    stable: Annotated[bool, typer.Option("--stable", help="Move poles on or outside the unit circle inside.")] = False,
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
    report: Annotated[Path | None, typer.Option("--report", help="Write a self-contained HTML page.")] = None,
    json_target: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Identify a model by predictor-based subspace identification, from open- or closed-loop recordings."""
    _check_method(method)
    own = _given(passes=passes, forgetting=forget)
    _check_passes(own, method, markov)
    doubt = _given(uncertainty=uncertainty, bootstrap_runs=bootstrap_runs, bootstrap_seed=bootstrap_seed)
    _check_uncertainty(doubt, method, markov)
    scheduled = _given(
        scheduling=scheduling, varying=varying, kernel_rows=kernel_rows, kernel_selection=kernel_selection,
        offsets=offsets, memory_gb=memory,
    )  # fmt: skip
    _check_scheduled(scheduled, method, markov, stable)
    finish = _given(order_criterion=order_criterion, refined=refine, solution=solution)
    _check_finish(finish, method, order)
    joint = _given(joint_order=joint_order, response=response)
    _check_ort_and_fir(joint, method, markov, regularize, stable)
    files = {"--out": out, "--report": report, "--json": json_target}
    declare("identify", force=force, inputs=[*recordings, roles, markov], files=files)
    from aeolid.formats import read_record
    from aeolid.record import Roles

    table = Roles.load(roles)
    with waiting("reading"):
        records = [read_record(path, table) for path in recordings]
    with waiting(f"identifying from {sum(map(len, records))} samples"):
        common: dict[str, Any] = {
            "past": past, "future": future, "order": _order(order), "feedthrough": feedthrough or (),
            "regularization": _regularization(regularize), "decimation": decimate,
        }  # fmt: skip
        if method == "ort":
            common["feedthrough"] = () if feedthrough == ["none"] else feedthrough
        result = _run(method, records, common, own | doubt | scheduled | joint | finish, markov, stable)
    emit_json(result.model_json(), str(out))
    if json_target != "-":
        console.print(result.summary(), markup=False)
        console.print(f"model written to {out}")
    if report is not None:
        from aeolid.report import identification_facts, render_identification

        title = f"Identification of {', '.join(p.name for p in recordings)}"
        render_identification(identification_facts(result.model_json(), title=title), report)
    emit_json(result.to_json(), json_target)


def _run(
    method: str, records: list[Record], common: dict[str, Any], own: dict[str, Any], markov: Path | None, stable: bool
) -> Identification | LpvIdentification | OrtIdentification:
    """Identify; common: options of every method, own: those of this one."""
    if method in SCHEDULED:
        from aeolid.identify.lpv import identify_lpv

        return identify_lpv(records, method=method, **common, **own)
    if method == "ort":
        from aeolid.identify.ort import identify_ort

        common = {key: value for key, value in common.items() if key != "regularization"}
        return identify_ort(records, stable=stable, **common, **own)
    if method == "fir":
        from aeolid.identify.fir import identify_fir

        return identify_fir(records, **common)
    from aeolid.identify.streamed import StreamedMarkov
    from aeolid.identify.varmax import identify_varmax
    from aeolid.identify.varx import identify_varx

    streamed = None if markov is None else StreamedMarkov.load(markov)
    run: Callable[..., Identification] = identify_varx if method == "varx" else identify_varmax
    return run(records, markov=streamed, stable=stable, **common, **own)


def _check_method(method: str) -> None:
    if method in METHODS:
        return
    if method in FILTERS:
        raise UsageError(f"{method} is a filter: aeolid filter --method {method}, and what it writes to --markov here")
    raise UsageError(f"method {method!r} is unknown; this release has {', '.join(METHODS)}")


def _given(**options: Any) -> dict[str, Any]:
    """Return the options that were given."""
    return {name: value for name, value in options.items() if value is not None}


def _check_scheduled(given: dict[str, Any], method: str, markov: Path | None, stable: bool) -> None:
    """Refuse options of scheduled models elsewhere, and with them what only time-invariant ones have."""
    if given and method not in SCHEDULED:
        option = "--" + next(iter(given)).removesuffix("_gb").replace("_", "-")
        raise UsageError(f"{option} belongs to --method lpv and lpv-kernel")
    if method in SCHEDULED and (markov is not None or stable):
        option = "--stable" if stable else "--markov"
        raise UsageError(f"{option} is for time-invariant models; leave it out with --method {method}")


def _check_ort_and_fir(given: dict[str, Any], method: str, markov: Path | None, regularize: str, stable: bool) -> None:
    """Refuse options of ort elsewhere, and with ort and fir what they do not have."""
    if given and method != "ort":
        raise UsageError(f"--{next(iter(given)).replace('_', '-')} belongs to --method ort")
    if method in ("ort", "fir") and markov is not None:
        raise UsageError(f"--markov holds a predictor with outputs; --method {method} takes recordings only")
    if method == "ort" and regularize != "gcv":
        raise UsageError("--regularize has no meaning with --method ort; leave it out")
    if method == "fir" and stable:
        raise UsageError("--stable is not for --method fir: a plant it can identify forgets, lengthen --past instead")


def _check_passes(given: dict[str, Any], method: str, markov: Path | None) -> None:
    """Refuse options of the VARMAX passes where no pass is run."""
    if given and method != "varmax":
        raise UsageError("--passes and --forget belong to --method varmax")
    if given and markov is not None:
        raise UsageError("with --markov no pass is run; leave --passes and --forget out")


def _check_uncertainty(given: dict[str, Any], method: str, markov: Path | None) -> None:
    """Refuse a choice of uncertainty where the method has its own, and options of a bootstrap without one."""
    if given and method not in METHODS[:2]:
        option = "--" + next(iter(given)).replace("_", "-")
        raise UsageError(f"{option} is for --method varx and varmax; --method {method} has deviations of its own")
    chosen = given.get("uncertainty", "asymptotic")
    if chosen != "bootstrap" and len(given) > ("uncertainty" in given):
        raise UsageError(f"--bootstrap-runs and --bootstrap-seed need --uncertainty bootstrap, not {chosen}")
    if chosen == "bootstrap" and markov is not None:
        raise UsageError("--uncertainty bootstrap needs the recording's own regression; leave it or --markov out")


def _check_finish(given: dict[str, Any], method: str, order: str) -> None:
    """Refuse criteria and prediction-error steps where the method has none, and a criterion where it cannot decide."""
    if "solution" in given and method != "varx":
        raise UsageError(f"--solution is for --method varx; leave it out with --method {method}")
    if "refined" in given and method not in METHODS[:4]:
        raise UsageError(f"--refine is for --method varx, varmax, lpv and lpv-kernel, not {method}; leave it out")
    if "order_criterion" not in given:
        return
    if method not in METHODS[:2]:
        raise UsageError(f"--order-criterion is for --method varx and varmax; --method {method} chooses its own way")
    if order != "auto":
        raise UsageError(f"--order-criterion decides where --order is auto, not {order}; leave one of them out")


def _order(text: str) -> int | None:
    if text == "auto":
        return None
    try:
        return int(text)
    except ValueError:
        raise UsageError(f"--order {text!r} is neither a whole number nor auto") from None


def _regularization(text: str) -> str | float:
    if text in ("gcv", "none"):
        return text
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--regularize {text!r} is none of gcv, none or a number") from None
