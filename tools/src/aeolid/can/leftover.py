"""Know the spools of raw logs that a killed reception has left, and complete them.

A log whose directory comes last (.parquet, .mf4) grows as NAME.part.arrows, which an orderly end turns into the log and
removes. A reception locks its spool while it lasts, so one that nobody holds is what a killed one has left.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable
from pathlib import Path

from aeolid import output
from aeolid.errors import UsageError

SPOOL_SUFFIX = ".part.arrows"  # an Arrow stream: batches one after the other, nothing at the end
SPOOLED = (".parquet", ".mf4")  # logs that grow so


def spool_of(log: Path) -> Path:
    """Return the name under which a log grows."""
    return log.with_name(log.name[: -len(log.suffix)] + SPOOL_SUFFIX)


def lock(handle: int) -> None:
    """Hold an open spool until it is closed or this process ends, where the system has such locks."""
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return


def is_left(spool: Path) -> bool:
    """Tell whether a spool is there, is a regular file, and is held by no reception."""
    try:
        handle = os.open(spool, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return False
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except ImportError:
        pass
    except OSError:
        return False
    finally:
        os.close(handle)
    return spool.is_file()


def left_of(log: Path) -> Path | None:
    """Return the spool that a killed reception has left of a log, None where there is none."""
    spool = spool_of(log)
    return spool if log.suffix.lower() in SPOOLED and is_left(spool) else None


def completed_by(log: Path | None, source: str) -> Path | None:
    """Return the spool NAME.part.arrows if it is the source of its own log, NAME.parquet or NAME-2.mf4."""
    if log is None or log.suffix.lower() not in SPOOLED or not source.endswith(SPOOL_SUFFIX):
        return None
    spool, stem = Path(source), log.name[: -len(log.suffix)]
    head, dash, number = stem.rpartition("-")
    name = spool.name.removesuffix(SPOOL_SUFFIX)
    same = stem == name or (bool(dash) and head == name and number.isdigit())
    return spool if same and os.path.realpath(spool.parent) == os.path.realpath(log.parent) else None


def second_spool(spool: Path) -> Path:
    """Return where the log grows that completes a spool."""
    return spool.with_name(spool.name.removesuffix(SPOOL_SUFFIX) + ".again" + SPOOL_SUFFIX)


def hint(spool: Path, log: Path) -> str:
    """Say what a killed reception has left, and the command that completes the log from it."""
    command = f"aeolid listen --bus {shlex.quote(str(spool))} --log {shlex.quote(str(log))} --no-modes"
    return f"{spool} is what a killed reception has left of its log; {command} completes it"


def check(log: Path | None, source: str, *, is_log: bool, force: bool) -> bool:
    """Tell whether a log completes what a killed reception has left.

    Raises UsageError where it would take the place of that, or where a reception still writes what it is to complete.
    """
    spool = completed_by(log, source)
    if spool is not None:
        if spool.is_file() and not is_left(spool):
            raise UsageError(f"{spool}: a reception still writes it; end that first")
        if is_left(second := second_spool(spool)):  # of an attempt that was killed
            second.unlink()
        return True
    if is_log and not force and log is not None and (left := left_of(log)) is not None:
        raise UsageError(f"{hint(left, log)}; or name another --log")
    return False


def hints(log: Path | None, k: int) -> list[str]:
    """Say of the numbers below k of a log what killed receptions have left, and how it is completed."""
    found = []
    for j in range(1, k) if log is not None else ():
        assert log is not None
        name = output.numbered(log, j)
        if (left := left_of(name)) is not None:
            found.append(hint(left, name if not name.exists() else output.numbered(log, k + j)))
    return found


def discard(paths: Iterable[Path | None]) -> None:
    """Remove files that were begun for a reception that did not come about: they would bar its next attempt."""
    for path in paths:
        if path is not None:
            path.unlink(missing_ok=True)
