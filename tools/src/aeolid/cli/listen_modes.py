"""Follow the modes of each node while it is listened to, in a thread of its own: reception never waits for them."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.can.limits import MODES_FINISH_S, MODES_QUEUE_BYTES
from aeolid.cli.listen_rules import find_problem, fresh, live_of, starts_again
from aeolid.errors import AeolidError
from aeolid.formats.growing import GrowingTable

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.can.assembly import Assembly
    from aeolid.can.node import Configuration
    from aeolid.can.samples import SampleTable
    from aeolid.can.snapshots import MarkovSnapshot
    from aeolid.identify.live import LiveMode, LiveModes

Array = NDArray[np.float64]
LOOK_S = 0.25  # how often new samples are looked for
LOOK_VALUES = 8192  # values of a node after which they are, whatever the time
QUEUED = 32_768  # samples that may wait
BATCH = 256  # samples of one piece
WORK_BYTES = 1000  # of a piece, its samples aside
SHARE, SHARE_LEAST = 0.5, 0.02  # of a processor for the modes of all live nodes, each its part, but at least …
CREDIT_S = 5.0  # of processor that a node may take ahead of its part
COLUMNS = (
    ("time_s", "s"), ("node", ""), ("mode", ""), ("frequency_hz", "Hz"), ("frequency_std_hz", "Hz"), ("damping", ""),
    ("damping_std", ""), ("pole_real", ""), ("pole_imag", ""), ("order", ""), ("samples", ""),
)  # fmt: skip


class Observer(Protocol):
    """See, in the thread of the modes, what they are followed from; must not raise. run: restarts of the node."""

    def samples(self, node: int, run: int, now: Configuration, index: NDArray[np.int64], part: Any) -> None:
        """Take samples as the modes do: part holds u (N, r), y (N, l), and e (N, l) or None."""

    def snapshot(self, node: int, run: int, now: Configuration, snapshot: MarkovSnapshot) -> None:
        """Take a complete snapshot; later samples come after the last one in it."""

    def modes(self, node: int, run: int, time_s: float, modes: tuple[LiveMode, ...]) -> None:
        """Take the modes as they are at a time of the controller, every `every_s` seconds."""


@dataclass(eq=False)
class _Followed:
    """Hold how far one node has been looked at (by the reception), and its modes (by the thread)."""

    configuration: Configuration
    live: LiveModes | None = None
    problem: str = ""
    used: int | None = None  # index of the last sample handed on
    tables: int = 0  # runs that were in memory at the last look
    arrived: int = 0
    snapshot: object = None
    restarts: int = 0
    dropped: int = 0  # samples that found no room in the queue
    shown: tuple[LiveMode, ...] = ()
    told: float = -np.inf  # controller's time of the last row of the table
    spent_s: float = 0.0  # of processor
    began: float = field(default_factory=time.monotonic)


@dataclass
class _Work:
    node: int
    followed: _Followed
    run: Callable[[LiveModes], None]
    samples: int = 0
    nbytes: int = WORK_BYTES


class ModeFollower:
    """Take what an assembly has received to the live modes of its nodes."""

    def __init__(
        self, table: GrowingTable | None, order: int | None, *, every_s: float, patient: bool, only: int | None = None,
        observer: Observer | None = None,
    ) -> None:  # fmt: skip
        """Prepare. table: of `COLUMNS`, None to write none; a row for each mode every `every_s` of the controller.

        order: number of states, None to choose; patient: reception waits where the queue is full (a log), else samples
        are left out; only: number of the one node to follow.
        """
        self._observer, self._tells = observer, table is not None or observer is not None
        self.fault: str | None = None  # why the table could not be written
        self._table, self._order, self._every_s, self._patient, self._only = table, order, every_s, patient, only
        self._nodes: dict[int, _Followed] = {}
        self._queue: queue.SimpleQueue[_Work | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._room = threading.Condition()
        self._waiting = 0  # samples in the queue
        self._bytes = 0  # of what is in the queue
        self._until = np.inf  # when the thread leaves the rest undone
        self._looked = 0.0
        self._thread = threading.Thread(target=self._work, name="modes", daemon=True)
        self._thread.start()

    def look(self, assembly: Assembly, last: bool = False) -> None:
        """Hand on what is new; called by the reception after each batch. last: nothing more will come."""
        now = time.monotonic()
        due = last or self._patient or now - self._looked >= LOOK_S
        if due:
            self._looked = now
        for node in list(assembly.nodes.values()):
            if node.now is None or (self._only is not None and node.number != self._only):
                continue
            followed = self._followed(node)
            arrived = node.now.samples.arrived
            if due or arrived - followed.arrived >= LOOK_VALUES:
                followed.arrived = arrived
                try:
                    self._hand_on(node, followed, last)
                except Exception as error:  # whatever modes come to, reception and recording go on
                    followed.problem = f"{type(error).__name__}: {error}"

    def _followed(self, node: Node) -> _Followed:
        followed = self._nodes.get(node.number)
        assert node.now is not None
        if followed is None or followed.configuration is not node.now:
            followed = self._start(node, 0 if followed is None else followed.restarts + 1)
        return followed

    def _start(self, node: Node, restarts: int) -> _Followed:
        """Begin anew: a node's first description, another one, or samples that count from the start again."""
        assert node.now is not None
        followed = _Followed(node.now, restarts=restarts, problem=find_problem(node.now))
        with self._lock:
            self._nodes[node.number] = followed
        return followed

    def _hand_on(self, node: Node, followed: _Followed, last: bool) -> None:
        configuration = followed.configuration
        if followed.problem:
            return
        tables = configuration.samples.newest(followed.used, configuration.description.sample_every)
        if tables:
            if starts_again(tables, followed.used, followed.tables):
                if len(tables) > 1:
                    self._put_samples(node.number, followed, tables[-2], last=True)
                before = followed.snapshot  # of the run that is over
                followed = self._start(node, followed.restarts + 1)
                followed.snapshot = before
            followed.tables = len(tables)
            self._put_samples(node.number, followed, tables[-1], last)
        snapshot = configuration.snapshots.complete
        if snapshot is not None and snapshot is not followed.snapshot:
            work = partial(self._take_snapshot, node.number, followed, snapshot)
            if self._put(_Work(node.number, followed, work, 0, WORK_BYTES + snapshot.theta.nbytes)):
                followed.snapshot = snapshot

    def _take_snapshot(self, number: int, followed: _Followed, snapshot: MarkovSnapshot, live: LiveModes) -> None:
        live.snapshot(snapshot.theta, snapshot.sample_index)
        if self._observer is not None:
            self._observer.snapshot(number, followed.restarts, followed.configuration, snapshot)

    def _put_samples(self, number: int, followed: _Followed, table: SampleTable, last: bool) -> None:
        rows = fresh(table, followed.used, last)
        if not len(rows):
            return
        d = followed.configuration.description
        r, m = d.inputs, d.inputs + d.outputs
        innovations = self._innovations(followed, table.index[rows]) if d.model_set == "varmax" else None
        for start in range(0, len(rows), BATCH):
            part = rows[start : start + BATCH]
            index, values = table.index[part], table.values[part]
            e = None if innovations is None else innovations[start : start + BATCH]

            def add(live: LiveModes, index: Any = index, values: Any = values, e: Any = e) -> None:
                self._add(number, followed, live, index, (values[:, :r], values[:, r:m], e), values[:, m:])

            size = WORK_BYTES + values.nbytes + index.nbytes
            if not self._put(_Work(number, followed, add, len(part), size)):
                followed.dropped += len(part)
        followed.used = int(table.index[rows[-1]])

    @staticmethod
    def _innovations(followed: _Followed, index: NDArray[np.int64]) -> Array | None:
        """Return the innovations (N, l) of these samples in the channels' units, NaN where the node sent none."""
        d = followed.configuration.description
        tables = followed.configuration.innovations.newest(int(index[0]), d.sample_every)
        if not tables:
            return None
        e = np.full((len(index), d.outputs), np.nan)
        at = index - tables[-1].index[0]
        inside = (at >= 0) & (at < len(tables[-1].index))
        e[inside] = tables[-1].values[at[inside]] * d.scale[d.inputs : d.inputs + d.outputs]
        return e

    def _put(self, work: _Work) -> bool:
        """Queue a piece of work; False where the thread is too far behind."""
        with self._room:
            while (self._waiting > QUEUED or self._bytes > MODES_QUEUE_BYTES) and self._thread.is_alive():
                if not self._patient:
                    return False
                self._room.wait(1.0)
            self._waiting += work.samples
            self._bytes += work.nbytes
        self._queue.put(work)
        return True

    def _add(self, number: int, followed: _Followed, live: LiveModes, index: Any, samples: Any, s: Array) -> None:
        """Take samples up to each time at which the table gets rows: what it holds does not hang on the batches."""
        u, y, e = samples
        if self._observer is not None:
            self._observer.samples(number, followed.restarts, followed.configuration, index, samples)
        step = followed.configuration.description.sample_time_s
        while len(index):
            due = np.flatnonzero(index * step >= followed.told + self._every_s)
            stop = int(due[0]) + 1 if self._tells and len(due) else len(index)
            live.add(index[:stop], u[:stop], y[:stop], None if e is None else e[:stop], s[:stop])
            if self._tells and len(due):
                followed.told = float(index[stop - 1] * step)
                self._tell(number, followed, live)
            index, u, y, s, e = index[stop:], u[stop:], y[stop:], s[stop:], None if e is None else e[stop:]

    def _tell(self, number: int, followed: _Followed, live: LiveModes) -> None:
        nan, modes = np.nan, live.modes()
        if self._observer is not None:
            self._observer.modes(number, followed.restarts, followed.told, modes)
        rows = [
            [
                followed.told, number, m.number, m.mode.frequency_hz, _or(m.mode.frequency_std_hz, nan), m.mode.damping,
                _or(m.mode.damping_std, nan), m.mode.eigenvalue.real, m.mode.eigenvalue.imag, live.order, live.samples,
            ]
            for m in modes
        ]  # fmt: skip
        if rows and self._table is not None and self.fault is None:
            try:
                self._table.write(np.array(rows, dtype=np.float64))
            except OSError as error:
                self.fault = f"{self._table.path}: nothing more can be written ({error.strerror or error})"

    def _work(self) -> None:
        while (work := self._queue.get()) is not None:
            followed = work.followed
            with self._room:
                self._waiting -= work.samples
                self._bytes -= work.nbytes
                self._room.notify()
            if followed.problem:
                continue
            if not self._may_work(followed):
                followed.dropped += work.samples
                continue
            began = time.thread_time()
            try:
                live = followed.live = followed.live or live_of(followed.configuration, self._order)
                work.run(live)
                modes = live.modes()
            except Exception as error:
                followed.problem = str(error) if isinstance(error, AeolidError) else f"{type(error).__name__}: {error}"
                modes = ()
            followed.spent_s += time.thread_time() - began
            with self._lock:
                followed.shown = modes

    def _may_work(self, followed: _Followed) -> bool:
        """Tell whether a live node has some of its part of the processor left, and the reception is not over."""
        if self._patient:
            return True
        now, share = time.monotonic(), max(SHARE / max(len(self._nodes), 1), SHARE_LEAST)
        return now < self._until and followed.spent_s < CREDIT_S + share * (now - followed.began)

    def finish(self) -> None:
        """Do what is queued, as far as it takes no longer than a moment on a live bus, and complete the table."""
        self._until = time.monotonic() + MODES_FINISH_S
        self._queue.put(None)
        self._thread.join()
        if self._table is not None:
            try:
                self._table.close()
            except OSError as error:
                self.fault = self.fault or f"{self._table.path}: cannot be completed ({error.strerror or error})"

    def view(self) -> dict[int, tuple[str, tuple[LiveMode, ...]]]:
        """Return for each node why it has no modes, and those it has."""
        with self._lock:
            return {number: (_why(f), f.shown) for number, f in sorted(self._nodes.items())}

    def facts(self, number: int) -> dict[str, Any] | None:
        """Return the facts of a node's modes for machines, None where it was not followed."""
        followed = self._nodes.get(number)
        if followed is None:
            return None
        live = followed.live
        facts: dict[str, Any] = {"waiting": _why(followed) or None, "restarts": followed.restarts}
        if live is None:
            return facts | {"modes": []}
        return facts | {
            "time_s": None if live.last is None else live.last * followed.configuration.description.sample_time_s,
            "order": live.order, "order_reason": live.order_reason, "samples": live.samples, "missing": live.missing,
            "left_out": followed.dropped, "snapshots": live.snapshots,
            "no_deviations_because": _why_no_deviations(live, followed.dropped),
            "microseconds_a_sample": round(1e6 * live.seconds / max(live.samples, 1), 2),
            "modes": [{"mode": m.number} | m.mode.to_json() for m in followed.shown],
        }  # fmt: skip


def _why(followed: _Followed) -> str:
    return followed.problem or (followed.live.waiting if followed.live is not None else "waiting for samples")


def _why_no_deviations(live: LiveModes, dropped: int) -> str | None:
    """Say why there are no standard deviations, with how many samples came too fast; None where there are some."""
    fast = f" ({dropped} samples came faster than the modes can be followed here)" if dropped else ""
    return live.note + fast if live.note else None


def _or(value: float | None, other: float) -> float:
    return other if value is None else value
