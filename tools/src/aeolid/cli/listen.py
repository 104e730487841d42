"""aeolid listen: receive the stream of one or several nodes."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aeolid.cli.common import JsonOption, console, emit_json, progress_console
from aeolid.errors import DataError, UsageError

if TYPE_CHECKING:
    from aeolid.can import Assembly, Node
    from aeolid.can.source import Source
    from aeolid.record import Record

FRAME_BITS = 160  # longest classic frame with a 29-bit identifier, stuffing and spacing included


def register(app: typer.Typer) -> None:
    """Add the sub-command to the application."""
    app.command("listen")(run)


def run(
    bus: Annotated[
        str,
        typer.Option("--bus", help="interface:channel[?key=value&...] of python-can, or a log (.blf, .asc, .log)."),
    ],
    record: Annotated[
        Path | None, typer.Option("--record", help="Write the samples (.csv, .csv.gz, .parquet) and their roles file.")
    ] = None,
    markov: Annotated[
        Path | None, typer.Option("--markov", help="Write the newest complete snapshot (markov.npz).")
    ] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="Stop after so long.")] = None,
    until_end: Annotated[bool, typer.Option("--until-end", help="Stop when every node has ended its stream.")] = False,
    node_id: Annotated[int | None, typer.Option("--node-id", help="Write this node only.")] = None,
    bit_rate: Annotated[int, typer.Option("--bit-rate", help="Of the bus, for the load shown.")] = 500_000,
    json: JsonOption = None,
) -> None:
    """Receive the stream of nodes, show its progress, write recordings and Markov parameters.

    Stops at the end of a log, with --until-end when the nodes end, after --seconds, or on Ctrl-C. What had arrived is
    written in any case; exit code 3 when nothing usable came or the bus broke off.
    """
    from aeolid.can import Assembly, open_source

    _check_targets(record, markov, seconds)
    source, assembly = open_source(bus), Assembly()
    began = time.monotonic()
    try:
        reason = _receive(source, assembly, seconds, until_end, bit_rate)
    finally:
        assembly.close()
        source.close()
    elapsed = time.monotonic() - began
    nodes = [n for n in assembly.nodes.values() if node_id is None or n.number == node_id]
    written = _write(nodes, record, markov, bus)
    facts = _facts(assembly, nodes, reason, elapsed, bit_rate, written)
    emit_json(facts, json)
    if json != "-":
        for line in _summary(facts):
            console.print(line, soft_wrap=True)
    _judge(source, assembly, nodes, reason, markov, facts, until_end)


def _check_targets(record: Path | None, markov: Path | None, seconds: float | None) -> None:
    """Refuse before listening what could not be written afterwards."""
    if record is not None and not record.name.lower().endswith((".csv", ".csv.gz", ".parquet")):
        raise UsageError(f"--record {record}: the suffix is none of .csv, .csv.gz, .parquet")
    for target in (record, markov):
        if target is not None and not target.parent.is_dir():
            raise UsageError(f"{target}: the folder {target.parent} does not exist")
    if seconds is not None and not seconds > 0:
        raise UsageError(f"--seconds {seconds}: a time above 0 is needed")


def _receive(source: Source, assembly: Assembly, seconds: float | None, until_end: bool, bit_rate: int) -> str:
    """Feed the assembly until something ends it; returns end, time, stopped or the reason why the bus broke off."""
    began = time.monotonic()
    with _shown(Progress(assembly, bit_rate, began)):
        try:
            while True:
                assembly.feed(source.read(0.1))
                if source.ended is not None:
                    return "end" if source.is_log or assembly.all_stopped() else source.ended
                if until_end and assembly.all_stopped():
                    _drain(source, assembly)
                    return "end"
                if seconds is not None and time.monotonic() - began >= seconds:
                    return "time"
        except KeyboardInterrupt:
            return "stopped"


def _drain(source: Source, assembly: Assembly) -> None:
    """Take what nodes still had under way: a goodbye is several frames. A second at most: others may go on talking."""
    until = time.monotonic() + 1.0
    while source.ended is None and time.monotonic() < until:
        frames = source.read(0.1)
        if not frames:
            return
        assembly.feed(frames)


def _shown(progress: Progress) -> AbstractContextManager[object]:
    """Keep the progress on the terminal up to date; nothing where standard error is a file."""
    from rich.live import Live

    if not progress_console.is_terminal:
        return nullcontext()
    return Live(get_renderable=progress.render, console=progress_console, refresh_per_second=4, transient=True)


class Progress:
    """Show rates, losses and snapshots while frames arrive."""

    def __init__(self, assembly: Assembly, bit_rate: int, began: float) -> None:
        self._assembly, self._bit_rate = assembly, bit_rate
        self._mark = (began, 0, 0.0)  # time, frames and rate at the last second
        self._seen: dict[int, tuple[int, float]] = {}  # node -> snapshots, time of the newest

    def render(self) -> Any:
        """Return a table with one row a node."""
        from rich.table import Table

        now, frames = time.monotonic(), self._assembly.frames
        if now - self._mark[0] >= 1.0:
            self._mark = (now, frames, (frames - self._mark[1]) / (now - self._mark[0]))
        rate = self._mark[2]
        load = rate * FRAME_BITS / self._bit_rate
        title = f"{frames} frames, {rate:.0f}/s, bus load up to {load:.1%}"
        broken = self._assembly.damaged + self._assembly.garbled
        table = Table(title=title + (f", {broken} damaged" if broken else ""), title_justify="left")
        for heading in ("node", "samples", "lost", "snapshots", "age", "state"):
            table.add_column(heading)
        for number, node in sorted(self._assembly.nodes.items()):
            table.add_row(*self._row(number, node, now))
        return table

    def _row(self, number: int, node: Node, now: float) -> tuple[str, ...]:
        if node.problem is not None or node.now is None:
            return (str(number), "", "", "", "", node.problem or "waiting for its description")
        samples, snapshots = node.now.samples, node.now.snapshots
        done, since = self._seen.get(number, (0, now))
        if snapshots.completed != done:
            since = now
            self._seen[number] = (snapshots.completed, now)
        age = f"{now - since:.0f} s" if snapshots.completed else ""
        count = str(samples.arrived // node.now.description.channels)
        lost = str(samples.lost(node.now.description.sample_every))
        incomplete = f" (+{snapshots.incomplete} incomplete)" if snapshots.incomplete else ""
        state = "ended" if node.stopped else "running"
        return (str(number), count, lost, f"{snapshots.completed}{incomplete}", age, state)


def _write(nodes: list[Node], record: Path | None, markov: Path | None, bus: str) -> dict[int, dict[str, Any]]:
    """Write what was asked for; several nodes or runs get their number into the file's name."""
    from aeolid.can import build_records, write_markov, write_record

    result: dict[int, dict[str, Any]] = {}
    several = len([n for n in nodes if n.configurations()]) > 1
    for node in nodes:
        runs = build_records(node, bus)
        files: dict[str, Any] = {"runs": [], "markov": None}
        result[node.number] = files
        tag = f"-node{node.number}" if several else ""
        for i, (run, lost) in enumerate(runs):
            target = _with_tag(record, tag + (f"-run{i + 1}" if len(runs) > 1 else ""))
            roles = write_record(target, run) if target else None
            files["runs"].append({"samples": len(run), "lost_values": lost, "file": target, "roles": roles})
        snapshot = node.latest_complete()
        target = _with_tag(markov, tag)
        if target and snapshot:
            last: Record | None = runs[-1][0] if runs else None
            write_markov(target, node, snapshot, last, bus)
            files["markov"] = target
    return result


def _with_tag(path: Path | None, tag: str) -> Path | None:
    if path is None:
        return None
    stem, dot, rest = path.name.partition(".")
    return path.with_name(stem + tag + dot + rest)


def _facts(
    assembly: Assembly,
    nodes: list[Node],
    reason: str,
    elapsed: float,
    bit_rate: int,
    written: dict[int, dict[str, Any]],
) -> dict[str, Any]:
    return {
        "ended_by": reason,
        "seconds": round(elapsed, 3),
        "frames": assembly.frames,
        "frames_per_s": round(assembly.frames / max(elapsed, 1e-9), 1),
        "bus_load_max": assembly.frames * FRAME_BITS / max(elapsed, 1e-9) / bit_rate,
        "foreign": assembly.foreign,
        "damaged": assembly.damaged,
        "garbled_lines": assembly.garbled,
        "nodes": [_node_facts(n) | written[n.number] for n in nodes],
    }


def _node_facts(node: Node) -> dict[str, Any]:
    facts: dict[str, Any] = {"node": node.number, "messages": node.messages, "problem": node.problem}
    facts |= {"ended": node.stopped, "health_flags": node.flags, "health": node.counters, "described": False}
    if node.now is None:
        return facts
    d, snapshots = node.now.description, node.now.snapshots
    best = snapshots.complete or snapshots.latest
    return facts | {
        "described": True,
        "configuration_hash": f"{d.configuration_hash:08x}",
        "model_set": d.model_set,
        "past": d.past,
        "sample_time_s": d.sample_time_s,
        "inputs": d.names[: d.inputs],
        "outputs": d.names[d.inputs : d.inputs + d.outputs],
        "snapshots": {
            "complete": snapshots.completed,
            "incomplete": snapshots.incomplete,
            "damaged": snapshots.damaged,
            "sample_index": best.sample_index if best else None,
            "repaired": snapshots.repaired,
            "missing": len(best.missing) if best else d.parameters,
        },
    }


def _summary(facts: dict[str, Any]) -> list[str]:
    lines = [f"{facts['frames']} frames in {facts['seconds']:.1f} s ({facts['frames_per_s']:.0f}/s)"]
    for n in facts["nodes"]:
        if n["problem"] or not n["described"]:
            lines.append(f"node {n['node']}: {n['problem'] or 'never described itself'}")
            continue
        samples = sum(r["samples"] for r in n["runs"])
        lost = sum(r["lost_values"] for r in n["runs"])
        text = f"node {n['node']}: {samples} samples, {lost} values lost, {n['snapshots']['complete']} snapshots"
        files = [str(r["file"]) for r in n["runs"] if r["file"]] + ([str(n["markov"])] if n["markov"] else [])
        lines.append(text + (f" → {', '.join(files)}" if files else ""))
    return lines


def _judge(
    source: Source,
    assembly: Assembly,
    nodes: list[Node],
    reason: str,
    markov: Path | None,
    facts: dict[str, Any],
    until_end: bool,
) -> None:
    """End with one sentence and code 3 when nothing usable came or the bus broke off."""
    usable = any(n["runs"] or n.get("snapshots", {}).get("complete") for n in facts["nodes"])
    if not usable:
        raise DataError(f"{source.name}: nothing usable arrived: {_why_nothing(assembly, nodes)}")
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


def _why_nothing(assembly: Assembly, nodes: list[Node]) -> str:
    problems: list[Callable[[], str | None]] = [
        lambda: next((f"node {n.number} {n.problem}" for n in nodes if n.problem), None),
        lambda: next((f"node {n.number} never described itself" for n in nodes if n.now is None), None),
        lambda: next((f"node {n.number} sent neither samples nor a complete snapshot" for n in nodes), None),
        lambda: f"{assembly.damaged} frames damaged" if assembly.damaged else None,
        lambda: f"{assembly.garbled} lines were no frames" if assembly.garbled else None,
        lambda: f"{assembly.foreign} frames, none from a node" if assembly.foreign else None,
    ]
    return next((text for problem in problems if (text := problem())), "not one frame; is a node sending?")
