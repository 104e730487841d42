"""aeolid filter: replay a recording through the C filters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.cli.common import BLOCKS, FILTERS, ForceOption, JsonOption, RolesOption, console, emit_json, one_of
from aeolid.errors import UsageError
from aeolid.output import declare, replacing

if TYPE_CHECKING:
    from aeolid.filters import FilterResult
    from aeolid.identify.block_markov import BlockMarkov
    from aeolid.record import Record

REGULARIZE = 0.1
EXAMPLES = (
    "aeolid filter monday.csv --roles roles.toml --method rls --past 20 --out m.npz",
    "aeolid filter monday.csv --roles roles.toml --method lattice --past 50 --precision f64 --out m.npz",
    "aeolid filter monday.csv --roles roles.toml --method levinson --past 50 --out m.npz",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("filter")(run)


def run(
    recording: Annotated[Path, typer.Argument(metavar="REC", help="Recording to replay.")],
    roles: RolesOption,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help=f"Filter: {', '.join(FILTERS)}; or the whole recording at once: {', '.join(BLOCKS)}.",
            autocompletion=one_of(*FILTERS, *BLOCKS),
        ),
    ],
    past: Annotated[int, typer.Option("--past", help="Past window p in samples.")],
    out: Annotated[Path, typer.Option("--out", help="Where the Markov parameters go (.npz).")],
    forget: Annotated[
        float | None, typer.Option("--forget", help="Forgetting factor, 0.5 to 1; default 1, fast-rls 0.999.")
    ] = None,
    regularize: Annotated[
        float, typer.Option("--regularize", help="Weight of the start at zero, 1e-8 to 1e8.")
    ] = REGULARIZE,
    precision: Annotated[
        str, typer.Option("--precision", help="f32 as in a controller, or f64.", autocompletion=one_of("f32", "f64"))
    ] = "f32",
    varmax: Annotated[
        bool, typer.Option("--varmax", help="Feed the residual back: a VARMAX predictor, as els has it anyway.")
    ] = False,
    feedthrough: Annotated[
        list[str] | None, typer.Option("--feedthrough", help="Input whose present value acts at once; repeatable.")
    ] = None,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Replay a recording through the C filters and write its Markov parameters.

    levinson and block-lattice are block recursions on the host (paper 003) that take no setting but --past and
    --feedthrough. The file holds theta (outputs x regressors, oldest block first, the channels' units), innovation
    (samples x outputs), health and the settings.
    """
    if method not in (*FILTERS, *BLOCKS):
        raise UsageError(f"--method {method}: there are {', '.join((*FILTERS, *BLOCKS))}")
    if method in BLOCKS and (forget is not None or varmax or regularize != REGULARIZE or precision != "f32"):
        raise UsageError(f"--method {method} takes the whole recording: leave out all but --past and --feedthrough")
    declare("filter", force=force, inputs=[recording, roles], files={"--out": out, "--json": json})
    from aeolid.formats import read_record
    from aeolid.record import Roles

    record = read_record(recording, Roles.load(roles))
    if method in BLOCKS:
        from aeolid.identify.block_markov import estimate_block, save_block_markov

        block = estimate_block(record, past=past, method=method, feedthrough=tuple(feedthrough or ()))
        with replacing(out) as handle:
            save_block_markov(handle, block, record)
        _tell(recording, record, block, out, json)
        return
    from aeolid.filters import filter_record, save_markov

    result = filter_record(
        record,
        past=past,
        method=method,
        model_set="varmax" if varmax else None,
        forgetting=forget,
        regularisation=regularize,
        precision=precision,
        feedthrough=tuple(feedthrough or ()),
    )
    with replacing(out) as handle:
        save_markov(handle, result, record)
    _tell(recording, record, result, out, json)


def _tell(path: Path, record: Record, result: FilterResult | BlockMarkov, out: Path, json: str | None) -> None:
    """Say what was written, to people and as JSON."""
    emit_json({"source": record.source, "sha256": record.sha256, "out": out, **result.to_json()}, json)
    if json != "-":
        console.print(f"{path}: {result.summary()} → {out}")
