"""Start other Python processes, and keep modules of the current folder out of them and out of this one.

`python -c`, `python -m` and the workers of a pool look for modules in the current folder first, and a recording's
folder may hold a `scipy.py`. `-P`, or PYTHONSAFEPATH for processes that others start, takes that folder off the path.
"""

from __future__ import annotations

import os
import sys


def python_command(*arguments: str) -> list[str]:
    """Return the command that runs this Python with these arguments and imports nothing from the current folder."""
    return [sys.executable, "-P", *arguments]


def guard_children() -> None:
    """Let every Python process started from here import nothing from the current folder, pools' workers included."""
    os.environ["PYTHONSAFEPATH"] = "1"
    given = os.environ.get("PYTHONPATH")
    if given is not None:
        os.environ["PYTHONPATH"] = os.pathsep.join(p for p in given.split(os.pathsep) if os.path.isabs(p))


def guard_imports(*, started_as_module: bool) -> None:
    """Guard this process and its children: nothing more is imported from the current folder unless it was asked for.

    The folder stands on the path of `python -m`, and where PYTHONPATH has an empty or relative entry (`:/other`).
    started_as_module: whether this process was started by `python -m`.
    """
    asked = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    here = os.getcwd()
    if started_as_module and not sys.flags.safe_path and sys.path[:1] == [here]:
        del sys.path[0]
    kept = [p for p in asked if os.path.isabs(p)]
    if len(kept) < len(asked) and here not in kept:
        sys.path[:] = [p for p in sys.path if os.path.isabs(p) and p != here]
    guard_children()
