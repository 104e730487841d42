"""Receive nodes as listen and monitor do: the options they share, one reception with its files, and its judgement."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid import output
from aeolid.cli.common import check_address, console, emit_json, progress_console, read_base
from aeolid.cli.durations import seconds_of
from aeolid.errors import DataError, UsageError

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_modes import ModeFollower, Observer

PATIENCE = 3  # requests to stop before the process is left to its fate
Stop = Callable[[], bool]
Over = Callable[[], None]  # says that the reception is over
Show = Callable[["Reception", "ModeFollower | None", Stop], AbstractContextManager[Over]]

BusOption = Annotated[
    str,
    typer.Option(
        "--bus",
        help="interface:channel of python-can (?key=value&key=value adds settings), or a log "
        "(.blf, .asc, .log, .mf4, .parquet).",
    ),
]
RecordOption = Annotated[
    Path | None,
    typer.Option("--record", help="Write the samples (.csv, .csv.gz, .parquet, .mf4) and their roles file."),
]
LogOption = Annotated[
    Path | None, typer.Option("--log", help="Write all frames as they came (.blf, .asc, .log, .mf4, .parquet).")
]
MarkovOption = Annotated[Path | None, typer.Option("--markov", help="Write the newest complete snapshot (markov.npz).")]
PolesOption = Annotated[
    Path | None, typer.Option("--poles", help="Write the modes over time (.csv, .csv.gz, .parquet, .mf4).")
]
PolesEveryOption = Annotated[
    float,
    typer.Option(
        "--poles-every",
        parser=seconds_of,
        metavar="TIME",
        help="Seconds of the controller between two rows of --poles.",
    ),
]
OrderOption = Annotated[
    int | None,
    typer.Option("--order", help="Number of states behind the modes; default chosen, with twice the samples again."),
]
UntilEndOption = Annotated[bool, typer.Option("--until-end", help="Stop when every node has ended its stream.")]
ReconnectOption = Annotated[
    bool | None,
    typer.Option(
        "--reconnect/--no-reconnect",
        help="Open a bus that broke off again, for as long as it takes; default, but not with --until-end.",
    ),
]
BitRateOption = Annotated[int, typer.Option("--bit-rate", help="Of the bus, for the load shown.")]
DataBitRateOption = Annotated[
    int, typer.Option("--data-bit-rate", help="Of the data phase of CAN FD, for the load shown.")
]


@dataclass(frozen=True)
class Wanted:
    """Hold the options of a reception, as listen names them. seconds: from `time_option`, which is named in errors."""

    bus: str
    record: Path | None
    log: Path | None
    markov: Path | None
    modes: bool
    poles: Path | None
    poles_every: float
    order: int | None
    seconds: float | None
    until_end: bool
    reconnect: bool | None
    node_id: int | None
    base: str
    bit_rate: int
    data_bit_rate: int
    json: str | None
    time_option: str = "--seconds"
    command: str = "listen"
    force: bool = False


def receive(wanted: Wanted, show: Show, observer: Observer | None = None) -> None:
    """Receive until something ends it, then complete the files, tell what there is, and judge it.

    show: keeps people informed meanwhile, given the reception, its modes and whether a stop was asked for; what it
    yields is called when the last frame has come, so that they hear of it while files are closed; observer: sees what
    the modes are followed from. Raises UsageError before anything is opened, DataError when nothing usable
    came, the bus broke off or something could not be written.
    """
    from aeolid.can.library import import_without_mdf4

    import_without_mdf4()
    from aeolid.can import RunRecorder, leftover, open_source
    from aeolid.can.raw_log import open_raw_log
    from aeolid.can.reception import Reception

    w = wanted
    _check(w)
    _check_modes(w)
    base = read_base(w.base) if w.node_id is None else check_address(w.base, w.node_id)
    again = not w.until_end if w.reconnect is None else w.reconnect
    source = open_source(w.bus, reconnect=again, notice=_say)
    with ExitStack() as opened, _stop_requests() as requests:
        opened.callback(source.close)
        w = _declared(w, source.is_log)
        opened.callback(leftover.discard, fresh := [])
        completed = leftover.completed_by(w.log, w.bus)
        raw = open_raw_log(w.log, leftover.second_spool(completed) if completed else None) if w.log else None
        fresh += [] if completed or raw is None else [w.log]
        if raw is not None:
            opened.callback(raw.close)
        recorder = RunRecorder(w.record, innovations=w.markov.parent if w.markov else None, only=w.node_id)
        reception = Reception(source, recorder, raw, bit_rate=w.bit_rate, data_bit_rate=w.data_bit_rate, base=base)
        follower = _follow(reception, w, observer) if w.modes else None
        if follower is not None:
            opened.callback(follower.finish)
        fresh += [w.poles]
        with show(reception, follower, lambda: bool(requests)) as over:
            opened.pop_all()  # from here on they are closed in their order
            try:
                reason = reception.run(lambda: bool(requests), w.seconds, w.until_end)
                over()
            finally:
                _close_all(reception, raw, follower)
        if completed and reason == "end" and source.ended == "end of file" and reception.fault is None:
            completed.unlink(missing_ok=True)  # all of it is in the log
        _record_grown(w.log, w.poles)
        nodes = [n for n in reception.assembly.nodes.values() if w.node_id is None or n.number == w.node_id]
        _finish(reception, nodes, reason, (w.markov, follower, w.poles), w.json, w.until_end)


def _record_grown(*paths: Path | None) -> None:
    for grown in [path for path in paths if path is not None and path.is_file()]:
        output.record_written(grown)


def _say(text: str) -> None:
    progress_console.print(text, soft_wrap=True, markup=False)


def _declared(w: Wanted, is_log: bool) -> Wanted:
    """Say what is written; returns the options with names that are free.

    What came over a bus does not come again: where a name is taken, all files of the reception get the next number
    that is free. A log can be read again, so its files may replace those of the same command.
    """
    from aeolid.can import leftover

    names = {"--record": w.record, "--log": w.log, "--markov": w.markov, "--poles": w.poles}
    completed = leftover.check(w.log, w.bus, is_log=is_log, force=w.force)
    if not is_log and not w.force:
        k = output.free_number(names.values())
        names = {option: None if path is None else output.numbered(path, k) for option, path in names.items()}
        if k > 1:
            told = ", ".join(str(path) for path in names.values() if path is not None)
            progress_console.print(f"aeolid: the name is taken, so this is number {k}: {told}", soft_wrap=True)
            for hint in leftover.hints(w.log, k):
                progress_console.print(f"aeolid: {hint}", soft_wrap=True, markup=False)
    inputs = [w.bus] if is_log else []
    once = not is_log or completed  # and never again
    output.declare(w.command, force=w.force, inputs=inputs, several=names, files={"--json": w.json}, unrepeatable=once)
    record, log, markov, poles = names.values()
    return replace(w, record=record, log=log, markov=markov, poles=poles)


def _follow(reception: Reception, w: Wanted, observer: Observer | None) -> ModeFollower:
    """Have the modes followed while frames are received."""
    from aeolid.cli.listen_modes import COLUMNS, ModeFollower
    from aeolid.formats.growing import growing_suffix, open_growing

    table = None
    if w.poles is not None:
        names, units = zip(*COLUMNS, strict=True)
        table = open_growing(w.poles, growing_suffix(w.poles) or "", names, units)
    follower = ModeFollower(
        table, w.order, every_s=w.poles_every, patient=reception.source.is_log, only=w.node_id, observer=observer
    )
    reception.watch = follower.look
    return follower


def _check_modes(w: Wanted) -> None:
    """Refuse options of the modes that make no sense, and load what they need before there is a bus to listen to."""
    from aeolid.formats.growing import GROWING_SUFFIXES, growing_suffix

    if not w.modes and (w.poles is not None or w.order is not None):
        raise UsageError(f"{'--poles' if w.poles is not None else '--order'} needs modes; leave --no-modes out")
    if w.poles is not None and growing_suffix(w.poles) is None:
        raise UsageError(f"--poles {w.poles}: the suffix is none of {', '.join(GROWING_SUFFIXES)}")
    if not w.poles_every > 0:
        raise UsageError(f"--poles-every {w.poles_every}: a time above 0 is needed")
    if w.order is not None and w.order < 1:
        raise UsageError(f"--order {w.order}: at least one state is needed")
    if w.modes and not Path(w.bus).is_file():  # a log waits
        import aeolid.identify.live  # noqa: F401


def _check(w: Wanted) -> None:
    """Refuse before listening what could not be written afterwards."""
    from aeolid.can.raw_log import RAW_SUFFIXES
    from aeolid.formats.growing import GROWING_SUFFIXES, growing_suffix

    if w.record is not None and growing_suffix(w.record) is None:
        raise UsageError(f"--record {w.record}: the suffix is none of {', '.join(GROWING_SUFFIXES)}")
    if w.log is not None and w.log.suffix.lower() not in RAW_SUFFIXES:
        raise UsageError(f"--log {w.log}: the suffix is none of {', '.join(RAW_SUFFIXES)}")
    given = [p for p in (w.record, w.log, w.markov, w.poles) if p is not None]
    for target in given:
        if not target.parent.is_dir():
            raise UsageError(f"{target}: the folder {target.parent} does not exist")
        if target.is_dir():
            raise UsageError(f"{target}: is a folder; name a file in it")
    names = [str(p.resolve()) for p in [*given, Path(w.bus)]]
    for name in {n for n in names if names.count(n) > 1}:
        raise UsageError(f"{name}: is named twice; each file needs a name of its own")
    for target in given:
        if target.is_symlink():
            raise UsageError(f"{target}: is a link; name the file itself")
    if w.seconds is not None and not w.seconds > 0:
        raise UsageError(f"{w.time_option} {w.seconds}: a time above 0 is needed")
    rate = min(w.bit_rate, w.data_bit_rate)
    if rate <= 0:
        raise UsageError(f"a bit rate of {rate}: one above 0 is needed")


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


def _close_all(reception: Reception, raw: Any, follower: ModeFollower | None) -> None:
    """Let go of the bus, and complete what grows with the frames."""
    reception.source.close()
    if raw is not None:
        _close(raw, reception)
    if follower is not None:
        follower.finish()
        reception.fault = reception.fault or follower.fault


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
    reception: Reception, nodes: list[Node], reason: str, markov: Path | None, facts: dict[str, Any], until_end: bool
) -> None:  # fmt: skip
    """End with one sentence and code 3 when nothing usable came, the bus broke off or something was not written."""
    from aeolid.can.recorder import say_twins
    from aeolid.cli.listen_facts import why_nothing

    source = reception.source
    if reception.fault or reason == "full":
        why = reception.fault or "no room is left on the disk"
        raise DataError(f"{why}; reception has stopped, and what had arrived until then is kept as far as it went")
    contested = next((n for n in facts["nodes"] if n["contested"]), None)
    if contested:
        raise DataError(say_twins(source.name, contested["node"], contested["contested"]))
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
