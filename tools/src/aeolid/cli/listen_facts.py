"""Sum up a reception: facts for machines, lines for people."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from aeolid.monitor.wording import MOST_MODES, clock_facts, drift_text, times
from aeolid.wording import counted, plus_minus

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.can.reception import Reception
    from aeolid.can.runs import Run
    from aeolid.cli.listen_modes import ModeFollower


def facts_of(
    reception: Reception, nodes: list[Node], reason: str, written: dict[int, dict[str, Any]],
    follower: ModeFollower | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Collect what `--json` writes."""
    assembly, source, elapsed = reception.assembly, reception.source, max(reception.seconds, 1e-9)
    log = reception.log
    return {
        "ended_by": reason,
        "seconds": round(elapsed, 3),
        "frames": reception.frames,
        "frames_per_s": round(reception.frames / elapsed, 1),
        "bus_load_max": reception.busy_s / elapsed,
        "foreign": assembly.foreign,
        "damaged": assembly.damaged,
        "garbled_lines": assembly.garbled,
        "error_frames": reception.errors,
        "overrun": getattr(source, "overrun", 0),
        "interruptions": source.interruptions,
        "seconds_without_bus": round(getattr(source, "away_s", 0.0), 3),
        "log": None if log is None else {"file": log.path, "frames": log.frames},
        "limits": _limit_facts(reception),
        "nodes": [
            _node_facts(n)
            | _left_out(n, reception)
            | _written_facts(written[n.number])
            | {"modes": None if follower is None else follower.facts(n.number)}
            for n in nodes
        ],
    }


def _limit_facts(reception: Reception) -> dict[str, Any]:
    """Tell what a reception held at most, and what met a limit of it."""
    from aeolid.can.limits import TOTAL_BYTES

    memory, assembly = reception.memory, reception.assembly
    return {
        "memory_bytes": memory.now, "memory_bytes_most": memory.peak, "memory_bytes_limit": TOTAL_BYTES,
        "bytes_given_up": memory.given_up, "numbers_forgotten": assembly.forgotten,
        "messages_forgotten": assembly.forgotten_messages,
    }  # fmt: skip


def _left_out(node: Node, reception: Reception) -> dict[str, Any]:
    """Tell what was not taken of a node, and whether two seem to bear its number."""
    recorder = reception.recorder
    short, refused = (table.get(node.number, [0, 0]) for table in (recorder.short, recorder.refused))
    left_out = {
        "messages": node.left_out, "bytes_given_up": node.given_up, "short_runs": short[0], "samples_of_short_runs":
        short[1], "runs_beyond_limit": refused[0], "samples_beyond_limit": refused[1],
    }  # fmt: skip
    return {"left_out": left_out, "contested": node.contested or None, "refused": node.refused or None}


def _written_facts(written: dict[str, Any]) -> dict[str, Any]:
    return {"runs": [_run_facts(run) for run in written["runs"]], "markov": written["markov"]}


def _run_facts(run: Run) -> dict[str, Any]:
    facts: dict[str, Any] = {"samples": run.rows, "lost_values": run.lost, "first_sample": run.first, "file": run.file}
    facts |= {"roles": run.roles, "clock": None if run.clock is None else clock_facts(run.clock)}
    return facts | {"scale_problems": run.scale_problems()}


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


def summary(facts: dict[str, Any]) -> list[str]:
    """Return the lines that are printed at the end."""
    lines = [
        f"{counted(facts['frames'], 'frame')} in {facts['seconds']:.1f} s ({facts['frames_per_s']:.0f}/s)"
        + _troubles(facts)
    ]
    if facts["log"]:
        lines[0] += f" → {facts['log']['file']}"
    for n in facts["nodes"]:
        if n["problem"] or not n["described"]:
            lines.append(f"node {n['node']}: {n['problem'] or 'never described itself'}")
            continue
        samples = sum(r["samples"] for r in n["runs"])
        lost = sum(r["lost_values"] for r in n["runs"])
        text = (
            f"node {n['node']}: {counted(samples, 'sample')}, {counted(lost, 'value')} lost, "
            f"{counted(n['snapshots']['complete'], 'snapshot')}"
        )
        if n["snapshots"]["incomplete"]:
            text += f" (and {n['snapshots']['incomplete']} incomplete)"
        files = [str(r["file"]) for r in n["runs"] if r["file"]] + ([str(n["markov"])] if n["markov"] else [])
        lines.append(text + (f" → {', '.join(files)}" if files else ""))
        lines += [f"  {line}" for line in _limit_lines(n)]
        clocks = [r["clock"] for r in n["runs"] if r["clock"]]
        if clocks:
            lines.append(f"  sample 0 at {clocks[-1]['utc_of_sample_0'][:23]} UTC; {drift_text(clocks[-1])}")
        lines += [f"  {problem}" for run in n["runs"][-1:] for problem in run["scale_problems"]]
        lines += _mode_lines(n["modes"])
    return lines + ([f"modes over time → {facts['poles']}"] if facts.get("poles") else [])


def _limit_lines(n: dict[str, Any]) -> list[str]:
    """Say in words what was not taken of a node, and why."""
    left, lines = n["left_out"], []
    if n["contested"]:
        lines.append(f"two nodes seem to bear this number: {n['contested']}")
    if n["refused"]:
        lines.append(f"not followed any more: it {n['refused']}")
    if left["short_runs"]:
        runs, samples = left["short_runs"], left["samples_of_short_runs"]
        lines.append(f"{runs} runs too short to be a recording were left out ({samples} samples)")
    if left["runs_beyond_limit"]:
        runs, samples = left["runs_beyond_limit"], left["samples_beyond_limit"]
        lines.append(f"{runs} runs were not recorded, it had begun too many ({samples} samples)")
    if left["messages"]:
        lines.append(f"{left['messages']} messages left out")
    if left["bytes_given_up"]:
        lines.append(f"{left['bytes_given_up']} bytes of what waited were given up to save memory")
    return lines


def _mode_lines(modes: dict[str, Any] | None) -> list[str]:
    """Say in words which oscillating modes a node has now, or why none."""
    if modes is None:
        return []
    if modes["waiting"]:
        return [f"  no modes: {modes['waiting']}"]
    swinging = [m for m in modes["modes"] if abs(m["damping"]) < 1]
    turning = [m for m in swinging if m["rotor_order"] or m["tone"]]
    found = [m for m in swinging if m not in turning][:MOST_MODES]
    told = ", ".join(map(_mode_text, found))
    why = modes["no_deviations_because"]
    lines = ["  no oscillating mode"]
    if found:
        lines = [f"  modes (damping): {told}" + (f"; deviations not known: {why}" if why else "")]
    if turning:
        told = ", ".join(f"{m['frequency_hz']:.4g} Hz" + f" ({m['name']})" * bool(m["name"]) for m in turning)
        lines.append(f"  harmonics of the rotor or other steady sines: {told}")
    return lines


def _mode_text(m: dict[str, Any]) -> str:
    """Return a mode in words: its name, frequency and damping in percent."""
    name = f"{m['name']} " if m["name"] else ""
    spread = None if m["damping_std"] is None else 100 * m["damping_std"]
    hertz = plus_minus(m["frequency_hz"], m["frequency_std_hz"])
    return f"{name}{hertz} Hz ({plus_minus(100 * m['damping'], spread)} %)"


def _troubles(facts: dict[str, Any]) -> str:
    told = [
        (facts["damaged"] + facts["garbled_lines"], "damaged"),
        (facts["error_frames"], "error frames"),
        (facts["overrun"], "dropped by the interface"),
    ]
    text = "".join(f", {count} {what}" for count, what in told if count)
    if facts["interruptions"]:
        text += f", the bus broke off {times(facts['interruptions'])} ({facts['seconds_without_bus']:.0f} s without it)"
    return text


def why_nothing(reception: Reception, nodes: list[Node]) -> str:
    """Say what stood in the way of anything usable."""
    assembly = reception.assembly
    others = ", ".join(map(str, sorted(assembly.nodes.keys() - {n.number for n in nodes})))
    problems: list[Callable[[], str | None]] = [
        lambda: next((f"node {n.number} {n.problem}" for n in nodes if n.problem), None),
        lambda: next((f"node {n.number} never described itself" for n in nodes if n.now is None), None),
        lambda: next((f"node {n.number} sent neither samples nor a complete snapshot" for n in nodes), None),
        lambda: f"nothing of the node asked for, but of node {others}" if others else None,
        lambda: f"{counted(assembly.damaged, 'frame')} damaged" if assembly.damaged else None,
        lambda: f"{assembly.garbled} lines were no frames" if assembly.garbled else None,
        lambda: (
            f"{counted(assembly.foreign, 'frame')}, none from a node; is the node's --base another?"
            if assembly.foreign
            else None
        ),
        lambda: reception.source.status or None,
    ]
    ended = None if reception.source.is_log else reception.source.ended
    silence = f"the bus broke off before the first frame ({ended})" if ended else "not one frame; is a node sending?"
    return next((text for problem in problems if (text := problem())), silence)
