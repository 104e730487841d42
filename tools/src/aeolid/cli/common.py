"""Share what the sub-commands have in common: JSON output, console, shared options."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from aeolid import output
from aeolid.display import visible_lines
from aeolid.durations import read_duration
from aeolid.errors import UsageError
from aeolid.wording import counted

if TYPE_CHECKING:
    from aeolid.record import Record, Roles

FILTERS = ("rls", "els", "fast-rls", "lattice")  # aeolid.filters.METHODS, not imported for the sake of --help
BLOCKS = ("levinson", "block-lattice")  # aeolid.identify.block_markov.BLOCK_METHODS, likewise
_QUIET_S = 30.0  # that a long run may be silent


class SafeConsole(Console):
    """Write text as `visible_lines` does, wherever it comes from: only styles of our own act on the terminal."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of a renderable, what is unseen in their text written out."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else visible_lines(text), style, control)


console = SafeConsole(highlight=False)
progress_console = SafeConsole(stderr=True, highlight=False)

_NONE = Path(os.devnull, "none")  # what no call can name


def _roles_given(context: typer.Context, value: Path) -> Path:
    """Return the roles file; refuse a call without one by what makes it."""
    if value == _NONE and not context.resilient_parsing:  # a shell that completes has not all words yet
        raise UsageError(
            "--roles is missing: the TOML file that says what the columns are; aeolid init RECORDING writes one,"
            " guessed from the headings"
        )
    return value


RolesOption = Annotated[
    Path,
    typer.Option(
        "--roles", help="TOML file that names each channel, its unit and role. Required.",
        default_factory=lambda: _NONE, show_default=False, callback=_roles_given,
    ),
]  # fmt: skip
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the same facts as JSON to this file, or - for standard output."),
]
ResampleOption = Annotated[
    str | None,
    typer.Option(
        "--resample",
        help="Bring channels of several rates, or uneven ones, to one sample time in seconds, or auto: the slowest.",
        autocompletion=lambda incomplete: [v for v in ("auto",) if v.startswith(incomplete)],
    ),
]
BladesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--blades",
        help="Blade channels to bring to the fixed frame: RootMyb1..3, or A,B,C; repeatable; auto, or none. Default: "
        "those with `blade` in the roles file.",
        autocompletion=lambda incomplete: [v for v in ("auto", "none") if v.startswith(incomplete)],
    ),
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace also inputs, and files that this command did not write.")
]


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show on the terminal what is being done and for how long, where the time left cannot be told."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True) as bar:
        bar.add_task(text, total=None)
        yield


class Milestones:
    """Write what is done on standard error, a line each, where that is no terminal and a bar would not show.

    As a context it also says every half minute what it is still at, so that a long run is never silent.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start the time; clock: growing seconds."""
        self._clock, self._begun, self._last = clock, clock(), clock()
        self._over = threading.Event()
        self.at = ""

    def reach(self, text: str) -> None:
        """Write the beginning of a step."""
        self.at, self._last = text, self._clock()
        if not progress_console.is_terminal:
            progress_console.print(f"{self._last - self._begun:.0f} s: {text}", markup=False, soft_wrap=True)

    def still(self) -> None:
        """Write what it is at, if nothing was written for half a minute."""
        if self.at and self._clock() - self._last >= _QUIET_S:
            self.reach(self.at)

    def __enter__(self) -> Self:
        """Begin to watch over silence."""
        threading.Thread(target=self._watch, daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        """End to watch."""
        self._over.set()

    def _watch(self) -> None:
        while not self._over.wait(_QUIET_S / 6):
            self.still()


def one_of(*values: str) -> Callable[[str], list[str]]:
    """Return what completes an option that takes one of these values."""

    def complete(incomplete: str) -> list[str]:
        return [value for value in values if value.startswith(incomplete)]

    return complete


def load_roles(path: Path, resample: str | None = None) -> Roles:
    """Read a roles file; resample: what --resample says, which goes before the file. Raises UsageError, DataError."""
    from dataclasses import replace

    from aeolid.record import Roles

    roles = Roles.load(path)
    wanted = read_resample(resample)
    return roles if wanted is None else replace(roles, resample=wanted)


def read_resample(text: str | None) -> float | str | None:
    """Read what --resample says: auto, or seconds above 0. Raises UsageError."""
    if text in (None, "auto"):
        return text
    seconds = read_duration(text or "")
    if seconds is None or not 0 < seconds < 1e6:
        raise UsageError(f"--resample {text}: neither auto nor a sample time in seconds such as 0.05, or 50ms")
    return seconds


def extent(record: Record) -> str:
    """Say in a line how much was read: samples, rate, duration, first instant, missing cells."""
    step, count = record.sample_time_s, len(record)
    seconds = step * count
    length = (
        f"{seconds:.4g} s"
        if seconds < 120
        else f"{seconds / 60:.4g} min"
        if seconds < 7200
        else f"{seconds / 3600:.4g} h"
    )
    rate = f"{1 / step:.4g} samples a second" if step < 1 else f"a sample every {step:.4g} s"
    began = f", from {record.begins}" if record.begins else ""
    lost = int(np.count_nonzero(np.isnan(record.values)))
    gaps = f", {counted(lost, 'cell')} missing" if lost else ""
    return f"{record.source}: {counted(count, 'sample')}, {rate}, {length}{began}{gaps}"


DEFAULT_BASE = "0x1CFF4000"  # aeolid.can.wire.BASE
BaseOption = Annotated[
    str,
    typer.Option("--base", help="Where the identifiers begin; 0x680: 11 bits, nodes 0 to 3."),
]


def read_base(text: str) -> int:
    """Read the base of the identifiers, decimal or hexadecimal; raises UsageError where it leaves no room."""
    from aeolid.can.wire import choose_layout

    try:
        base = int(text, 0)
    except ValueError:
        raise UsageError(f"--base {text}: a number is needed, such as {DEFAULT_BASE}") from None
    choose_layout(base)
    return base


def check_address(base: str, node_id: int) -> int:
    """Return the base of the identifiers as a number; raises UsageError where the node has no place above it."""
    from aeolid.can.wire import choose_layout

    value = read_base(base)
    last = choose_layout(value).nodes - 1
    if not 0 <= node_id <= last:
        raise UsageError(f"--node-id {node_id}: above base {base} nodes are 0 to {last}")
    return value


def emit_json(facts: Any, target: str | None) -> None:
    """Write facts as JSON to the file `target`, to standard output for '-', nowhere for None.

    Raises UsageError where the file cannot be written.
    """
    if target is None:
        return
    text = json.dumps(facts, indent=1, default=plain, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    output.write_text(target, text)


def plain(value: Any) -> Any:
    """Turn numpy numbers and arrays into what JSON knows."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} is not JSON")
