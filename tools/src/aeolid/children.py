"""Start other Python processes, and keep modules of the current folder out of them and out of this one.

`python -c`, `python -m` and the workers of a pool look for modules in the current folder first, and a recording's
folder may hold a `scipy.py`. `-P`, or PYTHONSAFEPATH for processes that others start, takes that folder off the path;
a worker then takes this process's path over, so the folder must not stand on that either.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import aeolid

HOME = str(Path(aeolid.__file__).resolve().parents[1])  # where this package is; it may well be the current folder


def python_command(*arguments: str) -> list[str]:
    """Return the command that runs this Python with these arguments and imports nothing from the current folder."""
    return [sys.executable, "-P", *arguments]


def guard_imports(*, started_as_module: bool) -> None:
    """Guard this process and its children: nothing more is imported from the current folder unless it was asked for.

    The folder stands on the path of `python -m`, and where PYTHONPATH has an empty or relative entry (`:/other`).
    started_as_module: whether this process was started by `python -m`.
    """
    asked = _asked()
    if started_as_module and not sys.flags.safe_path and sys.path[:1] == [os.getcwd()]:
        del sys.path[0]
    if not all(map(os.path.isabs, asked)):
        sys.path[:] = _safe_path()
    os.environ.update(_safe_environment())


@contextmanager
def guarded_children(environment: Mapping[str, str]) -> Iterator[None]:
    """Let processes that are started inside import nothing from the current folder unless it was asked for.

    For processes that others start and that take path and environment over from this one, such as those of
    multiprocessing. environment: more variables for them. Path and environment are as before afterwards.
    """
    path, variables = list(sys.path), {**_safe_environment(), **environment}
    before = {name: os.environ.get(name) for name in variables}
    sys.path[:] = _safe_path()
    os.environ.update(variables)
    try:
        yield
    finally:
        sys.path[:] = path
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _asked() -> list[str]:
    """Return the entries of PYTHONPATH."""
    given = os.environ.get("PYTHONPATH")
    return [] if given is None else given.split(os.pathsep)


def _safe_path() -> list[str]:
    """Return this process's path without the current folder, unless an absolute entry of PYTHONPATH is that one."""
    here = os.path.realpath(os.getcwd())
    if here in {HOME, *(os.path.realpath(p) for p in _asked() if os.path.isabs(p))}:
        return [p for p in sys.path if os.path.isabs(p)]
    return [p for p in sys.path if os.path.isabs(p) and os.path.realpath(p) != here]


def _safe_environment() -> dict[str, str]:
    """Return the variables that keep children from the current folder."""
    asked = (
        {"PYTHONPATH": os.pathsep.join(p for p in _asked() if os.path.isabs(p))} if "PYTHONPATH" in os.environ else {}
    )
    return {"PYTHONSAFEPATH": "1", **asked}
