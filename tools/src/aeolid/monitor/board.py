"""Collect what a page or a terminal shows of a reception, while it lasts and in bounded memory.

The reception knows nothing of it. The thread of the modes hands on what it followed (`samples`, `snapshot`, `modes`).
Whoever shows calls `tick` about once a second, which holds the reception's lock while it copies counters, and then
reads `facts` and `series` as often as it likes without ever touching the reception.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from datetime import datetime
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.can.reception import Reception
from aeolid.monitor.history import History
from aeolid.monitor.node_facts import NodeView, node_facts
from aeolid.monitor.remedies import findings
from aeolid.monitor.track import Track, column_of, lag_table, round_to

if TYPE_CHECKING:
    from aeolid.can.node import Configuration, Node
    from aeolid.can.snapshots import MarkovSnapshot
    from aeolid.identify.live import LiveMode

EVENTS = 60  # kept
BUS_RECENT, BUS_WHOLE = 600, 512  # rows, one a second
BusRow = tuple[float, float, float]  # time, largest load, frames a second


class Modes(Protocol):
    """Tell the modes of each node (ModeFollower of the command line)."""

    def view(self) -> dict[int, tuple[str, tuple[LiveMode, ...]]]:
        """Return for each node why it has no modes, and those it has."""

    def facts(self, number: int) -> dict[str, Any] | None:
        """Return facts of a node's modes."""


class Board:
    """Hold the facts of a reception and what has become of them over time."""

    def __init__(self) -> None:
        """Prepare; `watch` says of which reception."""
        self.facts: dict[str, Any] = {}
        self._reception: Reception | None = None
        self._modes: Modes | None = None
        self._only: int | None = None
        self._recording: str | None = None
        self._lock = threading.Lock()  # of the tracks and the history of the bus
        self._tracks: dict[int, Track] = {}
        self._views: dict[int, NodeView] = {}
        self._bus: History[BusRow] = History(BUS_RECENT, BUS_WHOLE, _busier)
        self._mark = (0.0, 0, 0.0)  # time, frames and busy time at the last row
        self._rates = (0.0, 0.0)  # load, frames a second
        self._heard = (0, 0.0)  # frames, and when they last became more
        self._states: dict[str, Any] = {}
        self._events: deque[dict[str, str]] = deque(maxlen=EVENTS)
        self._over = ""

    def watch(
        self, reception: Reception, modes: Modes | None, only: int | None = None, recording: str | None = None
    ) -> None:
        """Name the reception and the modes to show; only: the one node to show; recording: the file samples go to."""
        self._reception, self._modes, self._only, self._recording = reception, modes, only, recording
        self._mark = (reception.began, 0, 0.0)
        self._heard = (0, reception.began)
        self.tick()

    def samples(self, node: int, run: int, now: Configuration, index: NDArray[np.int64], part: Any) -> None:
        """Take samples of a node; part: u, y, e."""
        with self._lock:
            self._track(node, run, now).take_samples(index, part)

    def snapshot(self, node: int, run: int, now: Configuration, snapshot: MarkovSnapshot) -> None:
        """Take a complete snapshot of a node."""
        with self._lock:
            self._track(node, run, now).take_snapshot(snapshot)

    def modes(self, node: int, run: int, time_s: float, modes: tuple[LiveMode, ...]) -> None:
        """Take the modes of a node at a time of its controller."""
        with self._lock:
            if (track := self._tracks.get(node)) is not None:
                track.enter(run)
                track.take_modes(time_s, modes)

    def _track(self, node: int, run: int, now: Configuration) -> Track:
        track = self._tracks.get(node)
        if track is None or track.now is not now:
            track = self._tracks[node] = Track(now, 0.0 if track is None else track.last_s)
            track.run = run
        track.enter(run)
        return track

    def end(self, reason: str) -> None:
        """Note that the reception is over."""
        self._over = reason
        self.tick()

    def tick(self) -> None:
        """Look at the reception: renew `facts`, add a row to the history of the bus, note what has happened."""
        assert self._reception is not None
        views = {} if self._modes is None else self._modes.view()
        more = {} if self._modes is None else {n: self._modes.facts(n) or {} for n in views}
        now = time.monotonic()
        with self._reception.lock:
            bus = self._bus_facts(self._reception, now)
            nodes = [n for n in self._reception.assembly.nodes.values() if self._only in (None, n.number)]
            parts = [self._look_at(node, now) for node in sorted(nodes, key=lambda n: n.number)]
        with self._lock:
            told = []
            for part, node in parts:
                why, modes = views.get(node.number, ("waiting for samples", ()))
                if node.now is not None and not _followable(node) and node.now.snapshots.complete is not None:
                    alone = self._track(node.number, 0, node.now)
                    alone.trouble = why
                    alone.take_snapshot(node.now.snapshots.complete)
                track = self._tracks.get(node.number)
                told.append(node_facts(part, track, why, modes, more.get(node.number, {})))
        facts: dict[str, Any] = {"bus": bus, "nodes": told, "over": self._over}
        facts["ended"] = bool(told) and all(n["state"] == "ended" for n in told)
        facts["findings"] = findings(facts)
        self._note(facts)
        facts["events"] = list(self._events)
        self.facts = facts

    def _look_at(self, node: Node, now: float) -> tuple[dict[str, Any], Node]:
        assert self._reception is not None
        view = self._views.setdefault(node.number, NodeView())
        return view.look(node, self._reception.clocks, now), node

    def _bus_facts(self, r: Reception, now: float) -> dict[str, Any]:
        since, frames, busy = self._mark
        if now - since >= 0.9:
            load, rate = (r.busy_s - busy) / (now - since), (r.frames - frames) / (now - since)
            self._rates, self._mark = (load, rate), (now, r.frames, r.busy_s)
            with self._lock:
                self._bus.push((now - r.began, load, rate))
        if r.frames != self._heard[0]:
            self._heard = r.frames, now
        load, rate = self._rates
        source = r.source
        return {
            "source": source.name, "is_log": source.is_log, "status": source.status, "seconds": now - r.began,
            "frames": r.frames, "frames_per_s": rate, "load": load, "silent_s": now - self._heard[1],
            "damaged": r.assembly.damaged, "garbled": r.assembly.garbled, "errors": r.errors,
            "foreign": r.assembly.foreign, "overrun": getattr(source, "overrun", 0),
            "interruptions": source.interruptions,
            "log": None if r.log is None else {"file": str(r.log.path), "frames": r.log.frames},
            "recording": self._recording,
        }  # fmt: skip

    def _note(self, facts: dict[str, Any]) -> None:
        """Put what has changed since the last tick into the log of events."""
        bus = facts["bus"]
        now: dict[str, Any] = {"bus": "The bus is away." if bus["status"] else "The bus is open."}
        for n in facts["nodes"]:
            name = f"Node {n['node']}"
            words = {"waiting": "waits for its description", "problem": n["problem"], "running": "is running",
                     "silent": "has fallen silent", "ended": "has ended its stream"}  # fmt: skip
            now[name] = f"{name} {words[n['state']]}."
            if n["described"]:
                now[f"{name} run"] = f"{name} counts its samples anew (run {n['runs']})." if n["runs"] > 1 else ""
                for flag, text in n["health"].items():
                    if n["flags"] & int(flag):
                        now[f"{name} flag {flag}"] = f"{name} raised a health flag: {text}."
        stamp = datetime.now().strftime("%H:%M:%S")
        for key, text in now.items():
            if text and self._states.get(key) != text:
                self._events.append({"at": stamp, "text": text})
        self._states = now

    def series(self, node: int, have: dict[str, int], entry: tuple[int, int, int] | None) -> dict[str, Any]:
        """Return what has come to the histories since the counts in `have` (modes, tests, thetas, bus).

        entry: output, channel of a block and lag of the Markov parameter to show over time, None for the largest. All
        numbers are finite or None.
        """
        with self._lock:
            told: dict[str, Any] = {"bus": _part(self._bus, have.get("bus", 0), lambda row: [_r(x) for x in row])}
            track = self._tracks.get(node)
            if track is None:
                return told | {"node": None}
            d = track.now.description
            told |= {"node": node, "key": f"{d.configuration_hash:08x} {id(track)}", "starts": track.starts}
            told["modes"] = _part(track.modes, have.get("modes", 0), _mode_row)
            told["tests"] = _part(
                track.tests, have.get("tests", 0), lambda row: [_r(row[0]), *([_r(x) for x in t] for t in row[1])]
            )
            if track.newest is not None:
                told |= _thetas(track, have, entry)
        return told


def _r(value: Any) -> float | None:
    return round_to(float(value))


def _busier(older: BusRow, row: BusRow) -> BusRow:
    return row[0], max(older[1], row[1]), max(older[2], row[2])


def _followable(node: Node) -> bool:
    """Tell whether the modes' thread hands on what comes of a node."""
    assert node.now is not None
    return node.now.description.sample_every == 1


def _mode_row(row: tuple[float, NDArray[np.float32]]) -> list[Any]:
    return [_r(row[0]), [[int(m[0]), *(_r(x) for x in m[1:])] for m in row[1]]]


def _part(history: History[Any], have: int, tell: Any) -> dict[str, Any]:
    fresh, rows = history.since(have)
    return {"fresh": fresh, "count": history.count, "rows": [tell(row) for row in rows]}


def _thetas(track: Track, have: dict[str, int], entry: tuple[int, int, int] | None) -> dict[str, Any]:
    """Return the newest parameters where they are new, and one of them over time."""
    newest = track.newest
    assert newest is not None
    told: dict[str, Any] = {}
    if have.get("matrix", 0) != track.thetas.count:
        told["matrix"] = {"count": track.thetas.count, "values": lag_table(newest.theta_scaled, track.now)}
    column = None if entry is None else column_of(entry[1], entry[2], track.now)
    if entry is None or column is None or not 0 <= entry[0] < newest.theta_scaled.shape[0]:
        output, column = divmod(int(np.nanargmax(abs(newest.theta_scaled))), newest.theta_scaled.shape[1])
        entry = (output, *_place(column, track))
    output, at = entry[0], column
    told["entry"] = list(entry)
    told["thetas"] = _part(track.thetas, have.get("thetas", 0), lambda row: [_r(row[0]), _r(row[1][output, at])])
    return told


def _place(column: int, track: Track) -> tuple[int, int]:
    """Return channel and lag of a column of theta."""
    d = track.now.description
    width = (d.regressors - len(d.feedthrough)) // d.past
    if column >= d.past * width:
        return d.feedthrough[column - d.past * width], 0
    return column % width, d.past - column // width
