"""aeolid listen: receive the stream of one or several nodes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import DEFAULT_BASE, BaseOption, JsonOption, check_address, console, emit_json, read_base
from aeolid.errors import DataError, UsageError

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_modes import ModeFollower

PATIENCE = 3  # requests to stop before the process is left to its fate


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("listen")(run)


def run(
    bus: Annotated[
        str,
        typer.Option(
            "--bus",
            help="interface:channel[?key=value&...] of python-can, or a log (.blf, .asc, .log, .mf4, .parquet).",
        ),
    ],
    record: Annotated[
        Path | None,
        typer.Option("--record", help="Write the samples (.csv, .csv.gz, .parquet, .mf4) and their roles file."),
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", help="Write all frames as they came (.blf, .asc, .log, .mf4, .parquet).")
    ] = None,
    markov: Annotated[
        Path | None, typer.Option("--markov", help="Write the newest complete snapshot (markov.npz).")
    ] = None,
    modes: Annotated[
        bool, typer.Option("--modes/--no-modes", help="Follow the modes of each node as samples arrive; default.")
    ] = True,
    poles: Annotated[
        Path | None, typer.Option("--poles", help="Write the modes over time (.csv, .csv.gz, .parquet, .mf4).")
    ] = None,
    poles_every: Annotated[
        float, typer.Option("--poles-every", help="Seconds of the controller between two rows of --poles.")
    ] = 1.0,
    order: Annotated[
        int | None,
        typer.Option(
            "--order", help="Number of states behind the modes; default chosen, with twice the samples again."
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="Stop after so long.")] = None,
    until_end: Annotated[bool, typer.Option("--until-end", help="Stop when every node has ended its stream.")] = False,
    reconnect: Annotated[
        bool | None,
        typer.Option(
            "--reconnect/--no-reconnect",
            help="Open a bus that broke off again, for as long as it takes; default, but not with --until-end.",
        ),
    ] = None,
    node_id: Annotated[int | None, typer.Option("--node-id", help="Write this node only.")] = None,
    base: BaseOption = DEFAULT_BASE,
    bit_rate: Annotated[int, typer.Option("--bit-rate", help="Of the bus, for the load shown.")] = 500_000,
    data_bit_rate: Annotated[
        int, typer.Option("--data-bit-rate", help="Of the data phase of CAN FD, for the load shown.")
    ] = 2_000_000,
    json: JsonOption = None,
) -> None:
    """Receive the stream of nodes, show its progress, write recordings, raw logs and Markov parameters.

    Stops at the end of a log, with --until-end when the nodes end, after --seconds, or on Ctrl-C and SIGTERM. What had
    arrived is written in any case; exit code 3 when nothing usable came, the bus broke off or the disk was full.
    """
    from aeolid.can import RunRecorder, open_source
    from aeolid.can.raw_log import open_raw_log
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_view import shown

    _check(record, log, markov, poles, seconds, bus, min(bit_rate, data_bit_rate))
    _check_modes(modes, poles, poles_every, order)
    identifiers = read_base(base) if node_id is None else check_address(base, node_id)
    source = open_source(bus, reconnect=not until_end if reconnect is None else reconnect)
    raw = open_raw_log(log) if log else None
    recorder = RunRecorder(record, innovations=markov.parent if markov else None, only=node_id)
    rates = {"bit_rate": bit_rate, "data_bit_rate": data_bit_rate}
    reception = Reception(source, recorder, raw, **rates, base=identifiers)
    follower = _follow(reception, poles, poles_every, order, node_id) if modes else None
    with _stop_requests() as requests:
        try:
            with shown(reception, follower):
                reason = reception.run(lambda: bool(requests), seconds, until_end)
        finally:
            source.close()
            if raw is not None:
                _close(raw, reception)
            if follower is not None:
                follower.finish()
                reception.fault = reception.fault or follower.fault
        nodes = [n for n in reception.assembly.nodes.values() if node_id is None or n.number == node_id]
        _finish(reception, nodes, reason, (markov, follower, poles), json, until_end)


def _follow(
    reception: Reception, poles: Path | None, every_s: float, order: int | None, only: int | None
) -> ModeFollower:
    """Have the modes followed while frames are received."""
    from aeolid.cli.listen_modes import COLUMNS, ModeFollower
    from aeolid.formats.growing import growing_suffix, open_growing

    table = None
    if poles is not None:
        names, units = zip(*COLUMNS, strict=True)
        table = open_growing(poles, growing_suffix(poles) or "", names, units)
    follower = ModeFollower(table, order, every_s=every_s, patient=reception.source.is_log, only=only)
    reception.watch = follower.look
    return follower


def _check_modes(modes: bool, poles: Path | None, every_s: float, order: int | None) -> None:
    """Refuse options of the modes that make no sense, and load what they need before there is a bus to listen to."""
    from aeolid.formats.growing import GROWING_SUFFIXES, growing_suffix

    if not modes and (poles is not None or order is not None):
        raise UsageError(f"{'--poles' if poles is not None else '--order'} needs modes; leave --no-modes out")
    if poles is not None and growing_suffix(poles) is None:
        raise UsageError(f"--poles {poles}: the suffix is none of {', '.join(GROWING_SUFFIXES)}")
    if not every_s > 0:
        raise UsageError(f"--poles-every {every_s}: a time above 0 is needed")
    if order is not None and order < 1:
        raise UsageError(f"--order {order}: at least one state is needed")
    if modes:
        import aeolid.identify.live  # noqa: F401


def _check(
    record: Path | None, log: Path | None, markov: Path | None, poles: Path | None, seconds: float | None, bus: str,
    bit_rate: int,
) -> None:  # fmt: skip
    """Refuse before listening what could not be written afterwards."""
    from aeolid.can.raw_log import RAW_SUFFIXES
    from aeolid.formats.growing import GROWING_SUFFIXES, growing_suffix

    if record is not None and growing_suffix(record) is None:
        raise UsageError(f"--record {record}: the suffix is none of {', '.join(GROWING_SUFFIXES)}")
    if log is not None and log.suffix.lower() not in RAW_SUFFIXES:
        raise UsageError(f"--log {log}: the suffix is none of {', '.join(RAW_SUFFIXES)}")
    given = [p for p in (record, log, markov, poles) if p is not None]
    for target in given:
        if not target.parent.is_dir():
            raise UsageError(f"{target}: the folder {target.parent} does not exist")
        if target.is_dir():
            raise UsageError(f"{target}: is a folder; name a file in it")
    names = [str(p.resolve()) for p in [*given, Path(bus)]]
    for name in {n for n in names if names.count(n) > 1}:
        raise UsageError(f"{name}: is named twice; each file needs a name of its own")
    if seconds is not None and not seconds > 0:
        raise UsageError(f"--seconds {seconds}: a time above 0 is needed")
    if bit_rate <= 0:
        raise UsageError(f"a bit rate of {bit_rate}: one above 0 is needed")


@contextmanager
def _stop_requests() -> Iterator[list[int]]:
    """Collect requests to stop (Ctrl-C, SIGTERM, a closed terminal): frames under way and files are finished first."""
    requests: list[int] = []
    kinds = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]

    def ask(number: int, _: Any) -> None:
        requests.append(number)
        if len(requests) >= PATIENCE:
            signal.signal(number, signal.SIG_DFL)

    before = {kind: signal.signal(kind, ask) for kind in kinds if signal.getsignal(kind) is not signal.SIG_IGN}
    try:
        yield requests
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _close(raw: Any, reception: Reception) -> None:
    try:
        raw.close()
    except OSError as error:
        reception.fault = reception.fault or f"{raw.path}: cannot be completed ({error.strerror or error})"


def _finish(
    reception: Reception, nodes: list[Node], reason: str, asked: tuple[Path | None, ModeFollower | None, Path | None],
    json: str | None, until_end: bool,
) -> None:  # fmt: skip
    """Complete the files, tell what there is, and judge it. asked: --markov, the modes, --poles."""
    from aeolid.cli.listen_facts import facts_of, summary

    markov, follower, poles = asked
    written = _write(reception, nodes, markov)
    facts = facts_of(reception, nodes, reason, written, follower) | {"poles": poles}
    emit_json(facts, json)
    if json != "-":
        for line in summary(facts):
            console.print(line, soft_wrap=True, markup=False)
    _judge(reception, nodes, reason, markov, facts, until_end)


def _write(reception: Reception, nodes: list[Node], markov: Path | None) -> dict[int, dict[str, Any]]:
    """Write what was asked for; several nodes or runs get their number into the file's name."""
    from aeolid.can import write_markov
    from aeolid.can.runs import with_tag

    result: dict[int, dict[str, Any]] = {}
    recorder = reception.recorder
    several = len([n for n in nodes if n.configurations()]) > 1
    for node in nodes:
        tag = f"-node{node.number}" if several else ""
        recorder.date(node.number, reception.clocks.runs(node.number))
        try:
            recorder.name(node.number, tag)
        except DataError as error:
            reception.fault = reception.fault or str(error)
        runs = recorder.runs.get(node.number, [])
        target, snapshot = with_tag(markov, tag), node.latest_complete()
        if target and snapshot:
            try:
                write_markov(target, node, snapshot, runs[-1] if runs else None, reception.source.name)
            except DataError as error:  # the other nodes' files are still to be completed
                reception.fault, target = reception.fault or str(error), None
        result[node.number] = {"runs": runs, "markov": target if snapshot else None}
    return result


def _judge(
    reception: Reception,
    nodes: list[Node],
    reason: str,
    markov: Path | None,
    facts: dict[str, Any],
    until_end: bool,
) -> None:
    """End with one sentence and code 3 when nothing usable came, the bus broke off or something was not written."""
    from aeolid.cli.listen_facts import why_nothing

    source = reception.source
    if reception.fault or reason == "full":
        why = reception.fault or "no room is left on the disk"
        raise DataError(f"{why}; reception has stopped, and what had arrived until then is kept as far as it went")
    usable = any(n["runs"] or n.get("snapshots", {}).get("complete") for n in facts["nodes"])
    if not usable:
        raise DataError(f"{source.name}: nothing usable arrived: {why_nothing(reception, nodes)}")
    if reason not in ("end", "time", "stopped"):
        raise DataError(
            f"{source.name}: the bus broke off before the nodes ended their stream ({reason});"
            f" what had arrived until then is kept"
        )
    if source.is_log and source.ended and source.ended.startswith("damaged"):
        raise DataError(f"{source.name}: the log is {source.ended}; what came before is kept")
    if until_end and reason == "time":
        raise DataError(f"{source.name}: the time was up before every node had ended its stream; what arrived is kept")
    if markov is not None and not any(n["markov"] for n in facts["nodes"]):
        raise DataError(f"{source.name}: no complete snapshot arrived, so {markov} was not written; listen longer")
