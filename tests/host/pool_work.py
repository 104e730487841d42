"""Pieces of work for a pool, in a module that its processes import."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path


class Unsendable(Exception):
    """Cannot be put together again: its argument is lost on the way."""

    def __init__(self, text: str, more: int) -> None:
        super().__init__(text)


def listening(process: int) -> list[str]:
    """Return the addresses on which a process listens, TCP and UDP, from /proc."""
    inodes = set()
    for link in Path(f"/proc/{process}/fd").iterdir():
        try:
            inodes.add(os.readlink(link).removeprefix("socket:[").removesuffix("]"))
        except OSError:
            continue
    found = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        path = Path(f"/proc/net/{table}")
        rows = [line.split() for line in path.read_text().splitlines()[1:]] if path.exists() else []
        found += [f"{table} {row[1]}" for row in rows if row[9] in inodes and (row[3] == "0A" or table[0] == "u")]
    return found


def work(item: int, share: int) -> object:
    """Do as the number says; negative numbers are those that go wrong."""
    if item == -1:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == -2:
        raise ValueError("wrong")
    if item == -3:
        raise Unsendable("told", 1)
    if item == -4:
        return len(bytearray(share))
    if item == -5:
        return lambda: None  # cannot be pickled
    if item == -6:
        time.sleep(600)
    if item == -7:
        os._exit(5)
    return item * share


def look(item: int) -> dict[str, object]:
    """Return what a worker is."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
    return {
        "item": item, "process": os.getpid(), "listening": listening(os.getpid()), "safe": sys.flags.safe_path,
        "path": list(sys.path), "threads": [os.environ.get(name) for name in names],
        "deaf": signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
    }  # fmt: skip
