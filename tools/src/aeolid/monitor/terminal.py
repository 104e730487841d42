"""Show the facts of a board on the terminal: what the page shows, without its charts."""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from aeolid.monitor.board import Board
from aeolid.monitor.wording import duration, times

EVERY_S = 0.5


class Terminal:
    """Keep the facts on a terminal up to date in a thread of its own; a file gets only the last ones."""

    def __init__(self, board: Board, console: Console) -> None:
        """Begin."""
        self._board, self._console = board, console
        self._closing = threading.Event()
        self._live = Live(get_renderable=self._render, console=console, auto_refresh=False, transient=False)
        self._thread = threading.Thread(target=self._run, name="terminal", daemon=True)
        if console.is_terminal:
            self._live.start()
        self._thread.start()

    def _render(self) -> RenderableType:
        return render(self._board.facts)

    def _run(self) -> None:
        while not self._closing.wait(EVERY_S):
            with suppress(Exception):  # whatever becomes of the display, the reception goes on
                self._board.tick()
                if self._console.is_terminal:
                    self._live.refresh()

    def farewell(self, reason: str) -> None:
        """Show the last facts."""
        self._closing.set()
        self._thread.join()
        with suppress(Exception):
            self._board.end(reason)

    def close(self) -> None:
        """Leave the last facts on the terminal, with the modes of what still waited when the last frame had come."""
        self._closing.set()
        self._thread.join()
        with suppress(Exception):
            self._board.tick()
        if self._console.is_terminal:
            self._live.stop()
        else:
            self._console.print(self._render())


def render(facts: dict[str, Any]) -> RenderableType:
    """Return the facts as rich shows them; every text is shown as it is, no markup in it is obeyed."""
    bus = facts["bus"]
    head = (
        f"{bus['source']}  {duration(bus['seconds'])}  {bus['frames']} frames, {bus['frames_per_s']:.0f}/s,"
        f" bus load up to {bus['load']:.1%}"
    )
    if bus["interruptions"]:
        head += f"; the bus broke off {times(bus['interruptions'])}"
    parts: list[RenderableType] = [Text(head)]
    parts += [_finding(f) for f in facts["findings"]]
    for node in facts["nodes"]:
        parts += [Text(""), *_node(node)]
    return Group(*parts)


def _finding(f: dict[str, Any]) -> Text:
    where = "" if f["node"] is None else f"node {f['node']}: "
    text = Text("! " if f["level"] == "alarm" else "· ", style="bold yellow" if f["level"] == "alarm" else "dim")
    text.append(where + f["what"], style="yellow" if f["level"] == "alarm" else "")
    return text.append(" " + f["remedy"], style="not bold")


def _node(n: dict[str, Any]) -> list[RenderableType]:
    if not n["described"] or n["problem"]:
        return [Text(f"node {n['node']}: {n['problem'] or 'waiting for its description'}", style="bold")]
    s = n["snapshots"]
    age = "none yet" if s["age_s"] is None else f"the newest {duration(s['age_s'])} old"
    lines = [
        Text(f"node {n['node']}  {n['state']}  {settings(n)}", style="bold"),
        Text(
            f"samples {n['samples']}, values lost {n['lost']} ({n['lost_share']:.2%});"
            f" snapshots {s['complete']} (+{s['incomplete']} incomplete), {age}"
            + (f"; {n['clock']}" if n["clock"] else "")
        ),
        Text("health: " + (raised(n) or "no flag raised") + "; " + counters(n)),
    ]
    return [*lines, *_modes(n), *_tests(n["innovations"])]


def settings(n: dict[str, Any]) -> str:
    """Say how a node's filter is set."""
    return (
        f"{n['method']}, {n['model_set']}, p = {n['past']}, sample time {n['sample_time_s']:g} s,"
        f" λ = {n['forgetting']:g}, ρ = {n['regularisation']:g}"
    )


def raised(n: dict[str, Any]) -> str:
    """Name the health flags that are raised."""
    return ", ".join(text for flag, text in n["health"].items() if n["flags"] & int(flag))


def counters(n: dict[str, Any]) -> str:
    """List a node's own counters."""
    return ", ".join(f"{name} {value}" for name, value in n["counters"].items() if name != "SampleIndex")


def _table(*headings: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("output", "mostly in", "name") else "right")
    return table


def _modes(n: dict[str, Any]) -> list[RenderableType]:
    if n["modes_waiting"]:
        return [Text(f"no modes yet: {n['modes_waiting']}")]
    table = _table("mode", "frequency (Hz)", "95 %", "damping (%)", "95 %", "mostly in", "name")
    for m in n["modes"]:
        row = [str(m["mode"]), m["frequency"], m["frequency_95"], m["damping_percent"], m["damping_95"]]
        table.add_row(*(Text(cell) for cell in [*row, m["mostly_in"], m["name"]]))
    turning = [Text(f"harmonics of the rotor or other steady sines: {n['harmonics']}")] if n["harmonics"] else []
    return [table if n["modes"] else Text("no oscillating mode"), *turning]


def _tests(t: dict[str, Any]) -> list[RenderableType]:
    if not t["rows"]:
        return [Text(f"innovations: {t['waiting']}", style="dim")]
    high = "" if t["high"] is None else f"{t['low']:.3g} … {t['high']:.3g}"
    table = _table("output", "std of e", f"Ljung–Box Q (< {t['bound']:.3g})", f"s²/s₀² ({high})", "outside")
    for row in t["rows"]:
        marks = ["!" if out else "" for out in row["now"]]
        table.add_row(
            Text(row["output"]), Text(f"{row['deviation']} {row['unit']}"), Text(row["whiteness"] + marks[0]),
            Text(row["ratio"] + marks[1]), Text(f"{row['outside'][0]}, {row['outside'][1]} of {t['blocks']}"),
        )  # fmt: skip
    return [table, Text(t["caution"], style="dim")] if t["caution"] else [table]
