"""Know the child processes that a test starts itself and leaves behind: not waited for, or with an open pipe.

Python warns of such an object when it is collected, which for one in a cycle is during some later test of other things.
"""

from __future__ import annotations

import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any
from weakref import WeakSet

_started: WeakSet[subprocess.Popen[Any]] = WeakSet()
_watching = False


def watch_processes() -> None:
    """Have every process noted that is started within `starting`; to be called once."""
    init = subprocess.Popen.__init__

    def noted(self: subprocess.Popen[Any], *arguments: Any, **options: Any) -> None:
        init(self, *arguments, **options)
        if _watching:
            _started.add(self)

    subprocess.Popen.__init__ = noted  # type: ignore[method-assign]


@contextmanager
def starting() -> Generator[None]:
    """Note the processes that are started meanwhile; what fixtures start may last longer and is not."""
    global _watching
    _watching = True
    try:
        yield
    finally:
        _watching = False


def processes_left() -> list[str]:
    """Return what is wrong with each process noted since the last call, and forget them."""
    wrong = []
    for process in list(_started):
        open_pipes = [pipe for pipe in (process.stdin, process.stdout, process.stderr) if pipe and not pipe.closed]
        if process.returncode is None or open_pipes:
            state = "not waited for" if process.returncode is None else "with an open pipe"
            wrong.append(f"left {state}: {process.args}")
    _started.clear()
    return wrong
