"""aeolid node: a controller in software on a virtual CAN bus."""

from __future__ import annotations

import json as json_module
import signal
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import (
    DEFAULT_BASE,
    FILTERS,
    BaseOption,
    ForceOption,
    JsonOption,
    check_address,
    console,
    emit_json,
    one_of,
    progress_console,
)
from aeolid.cli.durations import seconds_of
from aeolid.errors import UsageError
from aeolid.output import declare, private_path
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.can.software_node import Feed, SoftwareNode

EXAMPLES = (
    "aeolid node --turbine --past 30 --bus tcp:29536 --wait",
    "aeolid node --recording monday.csv --roles roles.toml --speed 10",
)


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("node")(run)


def run(
    recording: Annotated[Path | None, typer.Option("--recording", help="Recording to play.")] = None,
    roles: Annotated[Path | None, typer.Option("--roles", help="Its roles file.")] = None,
    turbine: Annotated[bool, typer.Option("--turbine", help="Simulate the built-in turbine in closed loop.")] = False,
    samples: Annotated[int | None, typer.Option("--samples", help="At most so many samples.", min=1)] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of the turbine's wind and excitation.")] = 0,
    method: Annotated[
        str, typer.Option("--method", help="Filter: rls, els, fast-rls or lattice.", autocompletion=one_of(*FILTERS))
    ] = "rls",
    varmax: Annotated[
        bool, typer.Option("--varmax", help="Feed the residual back: a VARMAX predictor, as els has it anyway.")
    ] = False,
    past: Annotated[int, typer.Option("--past", help="Past window p in samples.")] = 20,
    forget: Annotated[
        float | None, typer.Option("--forget", help="Forgetting factor, 0.5 to 1; default 1, fast-rls 0.999.")
    ] = None,
    regularize: Annotated[float, typer.Option("--regularize", help="Weight of the start at zero.")] = 0.1,
    feedthrough: Annotated[
        list[str] | None, typer.Option("--feedthrough", help="Input whose present value acts at once; repeatable.")
    ] = None,
    bus: Annotated[
        str, typer.Option("--bus", help="pty, tcp:PORT on the loopback (0: any free), can:INTERFACE.")
    ] = "tcp:0",
    speed: Annotated[str, typer.Option("--speed", help="Multiple of real time, or max: as the bus drains.")] = "1",
    wait: Annotated[bool, typer.Option("--wait", help="Start when a listener has connected.")] = False,
    node_id: Annotated[int, typer.Option("--node-id", help="0 to 253; with 11-bit identifiers 0 to 3.")] = 1,
    base: BaseOption = DEFAULT_BASE,
    force_base: Annotated[
        bool,
        typer.Option("--force-base", help="Send at a --base that CANopen or J1939 use: none of their devices is here."),
    ] = False,
    snapshot_every: Annotated[
        float,
        typer.Option("--snapshot-every", parser=seconds_of, metavar="TIME", help="Seconds between two snapshots."),
    ] = 10.0,
    sample_every: Annotated[int, typer.Option("--sample-every", help="Send every k-th sample, 0: none.")] = 1,
    share: Annotated[float, typer.Option("--share", help="Of the bit rate, in percent; 0: no limit.")] = 5.0,
    bit_rate: Annotated[int, typer.Option("--bit-rate", help="Of the bus in bit/s.")] = 500_000,
    repair: Annotated[int, typer.Option("--repair", help="Repair frames per 100 parameters.")] = 25,
    innovations: Annotated[bool, typer.Option("--innovations", help="Send innovations too.")] = False,
    seal: Annotated[
        bool, typer.Option("--seal/--no-seal", help="Seal each sample with a CRC-32; serial adapters need it.")
    ] = True,
    fd: Annotated[bool, typer.Option("--fd", help="Send CAN FD frames.")] = False,
    fd_ratio: Annotated[
        int, typer.Option("--fd-ratio", help="CAN FD: data bit rate over nominal bit rate.", min=1, max=16)
    ] = 1,
    dump: Annotated[Path | None, typer.Option("--dump", help="Write the last theta as float32.")] = None,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Run the C filters in a process of their own and stream what they find on a virtual CAN bus.

    The first line on standard output is the address that `aeolid listen --bus` takes.
    """
    declare("node", force=force, inputs=[recording, roles], files={"--dump": dump, "--json": json})
    feed = _choose_feed(recording, roles, turbine, samples, seed)
    _check_filter(feed, method, varmax, past, forget, len(set(feedthrough or [])))
    options = ["--method", method, "--past", past, "--regularize", regularize, "--bus", bus, "--speed", speed]
    options += (["--varmax"] if varmax else []) + ([] if forget is None else ["--forget", forget])
    options += ["--base", _base_to_send_at(base, node_id, force_base), "--node-id", node_id]
    options += ["--force-base"] if force_base else []
    options += ["--snapshot-every", snapshot_every, "--sample-every", sample_every]
    options += ["--share", share, "--bit-rate", bit_rate, "--repair", repair]
    options += ["--feedthrough", _feedthrough_mask(feed, feedthrough or [])]
    options += (["--wait"] if wait else []) + (["--innovations"] if innovations else [])
    options += ["--seal" if seal else "--no-seal", *(["--fd"] if fd else []), "--fd-ratio", fd_ratio]
    with nullcontext() if dump is None else private_path(dump) as partial:
        health = _run(feed, [str(o) for o in [*options, *(["--dump", partial] if partial else [])]])
    facts = json_module.loads(health)
    emit_json(facts, json)
    if json != "-" and facts:
        progress_console.print(_sum_up(facts), soft_wrap=True)


def _base_to_send_at(base: str, node_id: int, forced: bool) -> int:
    from aeolid.can.identifiers import check_free

    value = check_address(base, node_id)
    if not forced:
        check_free(value)
    return value


def _check_filter(feed: Feed, method: str, varmax: bool, past: int, forget: float | None, present: int) -> None:
    """Refuse before the process starts what its filter would refuse."""
    from aeolid.filters.settings import FORGETTING, block_length, check_memory, check_sizes, choose_model_set

    model_set = choose_model_set(method, "varmax" if varmax else None)
    check_sizes(len(feed.inputs), len(feed.outputs), past, (), feed.sample_time_s, model_set)
    regressors = past * block_length(len(feed.inputs), len(feed.outputs), model_set) + present
    check_memory(method, past, FORGETTING.get(method, 1.0) if forget is None else forget, regressors)


def _sum_up(facts: dict[str, Any]) -> str:
    """Put the counters of a node into words; a CAN interface has some of its own."""
    rejected = facts["not_finite"] + facts["range"] + facts["time"]
    text = (
        f"{counted(facts['samples'], 'sample')}, {rejected} rejected, {counted(facts['gaps'], 'gap')}, "
        f"{counted(facts['snapshots'], 'snapshot')},"
        f" {counted(facts['sent'], 'frame')}, {facts['dropped'] + facts['overrun']} dropped"
    )
    interface = facts.get("interface", {})
    if interface.get("lost"):
        text += f"; the interface was down, away or in bus-off {interface['lost']} times ({interface['down']} refusals)"
    if interface.get("full"):
        text += f"; its queue was full {interface['full']} times (ip link set … txqueuelen 100 makes it longer)"
    return text


def _choose_feed(recording: Path | None, roles: Path | None, turbine: bool, samples: int | None, seed: int) -> Feed:
    from aeolid.can.software_node import feed_from_record, feed_from_turbine

    if turbine == (recording is not None):
        raise UsageError("exactly one of --recording and --turbine is needed")
    if recording is None:
        return feed_from_turbine(10_000 if samples is None else samples, seed)
    if roles is None:
        raise UsageError("--recording needs --roles")
    from aeolid.formats import read_record
    from aeolid.record import Roles

    return feed_from_record(read_record(recording, Roles.load(roles)), samples)


def _feedthrough_mask(feed: Feed, names: list[str]) -> int:
    known = [c.name for c in feed.inputs]
    for name in names:
        if name not in known:
            raise UsageError(f"--feedthrough {name}: the inputs are {', '.join(known) or 'none'}")
    return sum(1 << known.index(name) for name in set(names))


def _run(feed: Feed, options: list[str]) -> str:
    """Start the process, feed it, collect it; returns its health line."""
    from aeolid.can.software_node import SoftwareNode

    with _interrupted_by("SIGTERM", "SIGHUP"):
        node = SoftwareNode(feed, options)
        try:
            console.print(node.address, soft_wrap=True, markup=False)
            console.file.flush()
            try:
                _pump(node, feed)
                return node.finish()
            except KeyboardInterrupt:
                node.interrupt()
            return node.finish()
        finally:
            node.kill()


@contextmanager
def _interrupted_by(*names: str) -> Iterator[None]:
    """Take these signals as Ctrl-C is taken: the node's process must not outlive this one."""

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    kinds = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {kind: signal.signal(kind, interrupt) for kind in kinds if signal.getsignal(kind) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _pump(node: SoftwareNode, feed: Feed) -> None:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    if not progress_console.is_terminal:
        for rows in feed.rows:
            node.feed(rows)
        return
    columns = (
        TextColumn("samples"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("samples", total=feed.samples)
        for rows in feed.rows:
            node.feed(rows)
            progress.update(task, completed=node.fed)
