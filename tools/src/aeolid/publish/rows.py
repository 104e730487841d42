"""Turn the facts of a monitor or a fleet into rows of measurements: the one source of every form they are sent in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Number = float | int
_EPOCH = 1e8  # times above this are seconds since 1970
LEVELS = ("alarm", "warning", "note")  # of what the monitor finds


@dataclass(frozen=True)
class Row:
    """Hold values of one thing at one time: measurement, tags that tell things apart, finite values by name.

    time_s: since 1970, None for now.
    """

    measurement: str
    tags: Mapping[str, str]
    values: Mapping[str, Number]
    time_s: float | None = None


def rows_of_monitor(facts: Mapping[str, Any]) -> tuple[Row, ...]:
    """Return the rows of a monitor's board: the bus, each node, its modes and innovations, findings by level."""
    if not facts:
        return ()
    found = list(_bus(facts.get("bus") or {}))
    levels = [str(f.get("level")) for f in facts.get("findings") or []]
    found += [_row("findings", {"level": level}, {"open": levels.count(level)}) for level in LEVELS]
    for node in facts.get("nodes") or []:
        found += _node(node)
    return tuple(row for row in found if row.values)


def _row(measurement: str, tags: Mapping[str, Any], values: Mapping[str, Any], time_s: float | None = None) -> Row:
    """Keep what is a finite number; a truth is 0 or 1."""
    kept = {k: int(v) if isinstance(v, bool) else v for k, v in values.items() if isinstance(v, int | float)}
    finite = {k: v for k, v in kept.items() if math.isfinite(v)}
    return Row(measurement, {k: str(v) for k, v in tags.items()}, finite, time_s)


def _bus(bus: Mapping[str, Any]) -> Iterator[Row]:
    names = ("load", "frames_per_s", "silent_s", "frames", "damaged", "garbled", "errors", "foreign", "overrun")
    values = {name: bus.get(name) for name in names} | {"interruptions": bus.get("interruptions")}
    yield _row("bus", {"source": bus.get("source", "")}, values | {"open": not bus.get("status")})


def _node(node: Mapping[str, Any]) -> Iterator[Row]:
    tags = {"node": node["node"]}
    snapshots = node.get("snapshots") or {}
    values = {k: node.get(k) for k in ("samples", "lost", "lost_share", "flags", "refused", "runs", "silent_s")}
    values |= {"running": node.get("state") == "running", "snapshots": snapshots.get("complete")}
    values |= {"snapshots_incomplete": snapshots.get("incomplete"), "snapshot_age_s": snapshots.get("age_s")}
    yield _row("node", tags, values)
    for mode in node.get("modes") or []:
        own = {"mode": mode["mode"], "mostly_in": mode.get("mostly_in", "")}
        names = ("frequency_hz", "frequency_std_hz", "damping", "damping_std")
        yield _row("mode", tags | own, {name: mode.get(name) for name in names})
    for row in (node.get("innovations") or {}).get("rows") or []:
        texts = {k: _number(row.get(k)) for k in ("deviation", "whiteness", "ratio")}
        yield _row("innovation", tags | {"output": row["output"]}, texts)


def _number(text: Any) -> float:
    try:
        return float(text)
    except (TypeError, ValueError):
        return math.nan


def rows_of_fleet(facts: Mapping[str, Any]) -> tuple[Row, ...]:
    """Return the rows of a fleet: each mode of each period at its time where the recordings have a date; each change.

    A change is that of a track's frequency until the newest period; `moved` is 1 where it is more than chance.
    """
    found = []
    for period in facts.get("periods") or []:
        when = _dated(period["middle_s"])
        for mode in period["modes"]:
            if abs(mode["damping"]) >= 1:
                continue
            tags = {"turbine": period["turbine"], "mode": mode["track"], "name": mode.get("name") or ""}
            names = ("frequency_hz", "frequency_std_hz", "damping", "damping_std")
            found.append(_row("fleet_mode", tags, {name: mode.get(name) for name in names}, when))
    for track in facts.get("tracks") or []:
        onset = track["frequency_hz"].get("onset") or {}
        tags = {"turbine": track["turbine"], "mode": track["track"], "name": track["name"]}
        values = {"change_hz": onset.get("change"), "change_std_hz": onset.get("change_std")}
        found.append(_row("fleet_change", tags, values | {"moved": track["moved"]}, _dated(track["until_s"])))
    return tuple(row for row in found if row.values)


def _dated(time_s: float) -> float | None:
    return float(time_s) if time_s >= _EPOCH else None


def prometheus_text(rows: Sequence[Row]) -> str:
    """Return rows in Prometheus' text exposition format 0.0.4, one metric a value: aeolid_node_samples{node="3"} 12.

    All are gauges: counters of a node begin anew with every run of it, which a counter's rules would take for resets
    of ours.
    """
    metrics: dict[str, list[str]] = {}
    for row in rows:
        listed = ",".join(f'{_label(k)}="{_quoted(v)}"' for k, v in row.tags.items())
        for name, value in row.values.items():
            metric = _label(f"aeolid_{row.measurement}_{name}")
            metrics.setdefault(metric, []).append(f"{metric}{{{listed}}} {_spelt(value)}")
    return "".join(f"# TYPE {metric} gauge\n" + "\n".join(lines) + "\n" for metric, lines in metrics.items())


def _label(text: str) -> str:
    return "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in text)


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _spelt(value: Number) -> str:
    return str(value) if isinstance(value, int) else repr(float(value))


def line_protocol(rows: Sequence[Row], now_s: float) -> str:
    """Return rows in InfluxDB's line protocol, times in ns: aeolid_mode,mode=1,node=3 damping=0.02 1709290800000000000.

    now_s: the time of rows that have none. Values are all written as floats: a field keeps the type it first had.
    """
    lines = []
    for row in rows:
        tags = "".join(f",{_escaped(k)}={_escaped(v)}" for k, v in sorted(row.tags.items()) if v)
        fields = ",".join(f"{_escaped(k)}={_spelt(float(v))}" for k, v in row.values.items())
        at = now_s if row.time_s is None else row.time_s
        lines.append(f"aeolid_{row.measurement}{tags} {fields} {round(at * 1e3) * 1_000_000}")
    return "\n".join(lines) + "\n" if lines else ""


def _escaped(text: str) -> str:
    """Return a tag or key as the protocol wants it; a line end would begin another line."""
    plain = text.replace("\r", " ").replace("\n", " ").rstrip("\\")
    return plain.replace(",", "\\,").replace("=", "\\=").replace(" ", "\\ ")
