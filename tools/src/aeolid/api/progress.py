"""Show how far a long call is: a bar on a terminal, one in a notebook, or a function of the caller's."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

from aeolid.display import visible
from aeolid.errors import UsageError

Progress = bool | Callable[[str, float], object] | None
Show = Callable[[str, float | None], None]  # what is being done, and the share done, None where it is not known
_LEAST_S = 0.2  # between two pictures in a notebook: each is a message to the browser


@contextmanager
def shown(progress: Progress) -> Iterator[Show]:
    """Give a function that shows what is being done; what it drew is gone at the end.

    progress: None shows a bar where somebody looks on (a terminal or a notebook), False none, True lines also where
    standard error is no terminal; a function is called with the text and the share done, 0 to 1.
    """
    if progress is False:
        yield lambda text, share: None
    elif callable(progress):
        yield _handed_to(progress)
    elif progress is not None and progress is not True:
        raise UsageError(f"progress is a {type(progress).__name__}; True, False, None or a function is needed")
    elif in_notebook():
        with _in_notebook() as show:
            yield show
    elif sys.stderr.isatty():
        with _on_terminal() as show:
            yield show
    elif progress:
        yield _in_lines()
    else:
        yield lambda text, share: None


def in_notebook() -> bool:
    """Tell whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    found = shell.get_ipython() if shell is not None else None
    return found is not None and hasattr(found, "kernel")


def _handed_to(function: Callable[[str, float], object]) -> Show:
    last = [0.0]

    def show(text: str, share: float | None) -> None:
        last[0] = last[0] if share is None else share
        function(text, last[0])

    return show


def _in_lines() -> Show:
    begun, last = time.monotonic(), [""]

    def show(text: str, share: float | None) -> None:
        said = visible(text) + ("" if share is None else f", {100 * share:.0f} %")
        if said != last[0]:
            last[0] = said
            print(f"{time.monotonic() - begun:.0f} s: {said}", file=sys.stderr)

    return show


@contextmanager
def _on_terminal() -> Iterator[Show]:
    from rich.console import Console
    from rich.markup import escape as plain
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Bar(*columns, console=Console(stderr=True, highlight=False), transient=True) as bar:
        task = bar.add_task("", total=None)

        def show(text: str, share: float | None) -> None:
            said = plain(visible(text))[:80]
            if share is None:
                bar.update(task, description=said)
            else:
                bar.update(task, description=said, total=1.0, completed=share)

        yield show


@contextmanager
def _in_notebook() -> Iterator[Show]:
    import IPython.display as notebook

    page: Any = notebook  # untyped
    begun = time.monotonic()
    handle: Any = page.display(page.HTML(""), display_id=True)
    state: dict[str, Any] = {"share": None, "drawn": 0.0}

    def show(text: str, share: float | None) -> None:
        state["share"] = share if share is not None else state["share"]
        now = time.monotonic()
        if now - state["drawn"] < _LEAST_S:
            return
        state["drawn"] = now
        handle.update(page.HTML(bar(text, state["share"], now - begun)))

    try:
        yield show
    finally:
        handle.update(page.HTML(""))


def bar(text: str, share: float | None, elapsed_s: float) -> str:
    """Return a bar as HTML; without a share the browser shows that something is going on."""
    value = "" if share is None else f' value="{share:.3f}"'
    return f'<progress max="1"{value}></progress> {escape(visible(text))}, {elapsed_s:.0f} s'
