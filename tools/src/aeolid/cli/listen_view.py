"""Show a reception on the terminal while it lasts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from aeolid.cli.common import progress_console
from aeolid.monitor.wording import (
    MOST_MODES,
    clock_facts,
    drift_text,
    duration,
    harmonics_text,
    times,
)
from aeolid.wording import plus_minus

if TYPE_CHECKING:
    from aeolid.can import Node
    from aeolid.can.reception import Reception
    from aeolid.cli.listen_modes import ModeFollower

FIT_S = 2.0  # how often drift is worked out anew


@contextmanager
def shown(reception: Reception, follower: ModeFollower | None) -> Iterator[Callable[[], None]]:
    """Keep the progress on the terminal up to date; nothing where standard error is a file."""
    from rich.live import Live

    view: AbstractContextManager[object] = nullcontext()
    if progress_console.is_terminal:
        render = Progress(reception, follower).render
        view = Live(get_renderable=render, console=progress_console, refresh_per_second=4, transient=True)
    with view:
        yield lambda: None


class Progress:
    """Show rates, losses, snapshots and clocks while frames arrive."""

    def __init__(self, reception: Reception, follower: ModeFollower | None = None) -> None:
        self._reception, self._follower = reception, follower
        self._mark = (reception.began, 0, 0.0)  # time, frames and busy time at the last second
        self._rates = (0.0, 0.0)  # frames a second, bus load
        self._seen: dict[int, tuple[int, float]] = {}  # node -> snapshots, time of the newest
        self._drift: dict[int, tuple[float, str]] = {}  # node -> when it was worked out, text

    def render(self) -> Any:
        """Return a line on the bus, a table with one row a node, and what an operator should know."""
        with self._reception.lock:
            return self._render()

    def _render(self) -> Any:
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        now, r = time.monotonic(), self._reception
        since, frames, busy = self._mark
        if now - since >= 1.0:
            self._rates = (r.frames - frames) / (now - since), (r.busy_s - busy) / (now - since)
            self._mark = (now, r.frames, r.busy_s)
        rate, load = self._rates
        head = f"{r.source.name}  {duration(now - r.began)}  {r.frames} frames, {rate:.0f}/s, bus load up to {load:.1%}"
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for heading in ("node", "samples", "lost", "snapshots", "age", "state", "clock"):
            table.add_column(heading, justify="right" if heading in ("samples", "lost", "snapshots", "age") else "left")
        for number, node in sorted(r.assembly.nodes.items()):
            table.add_row(*self._row(number, node, now))
        warnings = (Text(line, style="yellow") for line in self._warnings())
        return Group(Text(head), *warnings, table, *self._modes())

    def _modes(self) -> list[Any]:
        """Return a table of the oscillating modes of each node, and a line for each that has none yet."""
        from rich.table import Table
        from rich.text import Text

        view = {} if self._follower is None else self._follower.view()
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for heading in ("node", "mode", "frequency (Hz)", "damping (%)", "mostly in", "name"):
            table.add_column(heading, justify="right" if heading == "mode" else "left")
        lines = []
        for number, (why, modes) in view.items():
            if why:
                lines.append(Text(f"node {number}: no modes yet, {why}"))
            for m in [m for m in modes if m.is_shown][:MOST_MODES]:
                spread = None if m.mode.damping_std is None else 100 * m.mode.damping_std
                where = max(m.mode.shares, key=lambda name: m.mode.shares[name])
                table.add_row(
                    str(number), str(m.number), plus_minus(m.mode.frequency_hz, m.mode.frequency_std_hz),
                    plus_minus(100 * m.mode.damping, spread), where, m.mode.name,
                )  # fmt: skip
            if turning := harmonics_text(modes):
                lines.append(Text(f"node {number}: harmonics of the rotor or other steady sines: {turning}"))
        return ([table] if table.row_count else []) + lines

    def _warnings(self) -> list[str]:
        r = self._reception
        assembly, source = r.assembly, r.source
        counts = [
            (assembly.damaged, "frames damaged"),
            (assembly.garbled, "lines garbled"),
            (r.errors, "error frames"),
            (getattr(source, "overrun", 0), "frames dropped by the interface: the host is too slow"),
        ]
        told = [f"{count} {what}" for count, what in counts if count]
        if source.interruptions:
            told.append(f"the bus broke off {times(source.interruptions)}")
        return [line for line in (", ".join(told), source.status) if line]

    def _row(self, number: int, node: Node, now: float) -> tuple[str, ...]:
        if node.problem is not None or node.now is None:
            return (str(number), "", "", "", "", node.problem or "waiting for its description", "")
        samples, snapshots = node.now.samples, node.now.snapshots
        done, since = self._seen.get(number, (0, now))
        if snapshots.completed != done:
            since = now
            self._seen[number] = (snapshots.completed, now)
        age = duration(now - since) if snapshots.completed else ""
        count = str(samples.arrived // node.now.description.channels)
        lost = str(samples.lost(node.now.description.sample_every))
        incomplete = f" (+{snapshots.incomplete} incomplete)" if snapshots.incomplete else ""
        state = "ended" if node.stopped else "two of this number" if node.contested else "running"
        return (str(number), count, lost, f"{snapshots.completed}{incomplete}", age, state, self._clock(number, now))

    def _clock(self, number: int, now: float) -> str:
        at, text = self._drift.get(number, (0.0, ""))
        if now - at >= FIT_S:
            runs = self._reception.clocks.runs(number)
            fit = runs[-1].fit() if runs else None
            text = "" if fit is None or fit.drift_ppm is None else drift_text(clock_facts(fit))
            text = text.replace("its clock and the host's agree", "agrees").removeprefix("its clock is ")
            self._drift[number] = (now, text)
        return text
