"""Share what the sub-commands have in common: JSON output, console, shared options."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from aeolid.errors import UsageError

FILTERS = ("rls", "els", "fast-rls", "lattice")  # aeolid.filters.METHODS, not imported for the sake of --help

console = Console(highlight=False)
progress_console = Console(stderr=True, highlight=False)

RolesOption = Annotated[Path, typer.Option("--roles", help="TOML file that names each channel, its unit and role.")]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the same facts as JSON to this file, or - for standard output."),
]


@contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show on the terminal what is being done and for how long, where the time left cannot be told."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True) as bar:
        bar.add_task(text, total=None)
        yield


def one_of(*values: str) -> Callable[[str], list[str]]:
    """Return what completes an option that takes one of these values."""

    def complete(incomplete: str) -> list[str]:
        return [value for value in values if value.startswith(incomplete)]

    return complete


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
    try:
        Path(target).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{target}: cannot be written ({error.strerror})") from None


def plain(value: Any) -> Any:
    """Turn numpy numbers and arrays into what JSON knows."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} is not JSON")
