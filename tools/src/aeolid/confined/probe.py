"""Try what a confined function must not be able to do; the tests run these, and each says what it met."""

from __future__ import annotations

import ctypes
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator

import numpy as np

from aeolid.confined.channel import Reply
from aeolid.errors import DataError


def echo(text: str, arrays: dict[str, np.ndarray] | None = None) -> Reply:
    """Return what was given, and print where nothing may be printed."""
    print("to the terminal", flush=True)
    os.write(2, b"to the terminal\n")
    return {"text": text, "path": sys.path, "folder": os.getcwd()}, arrays or {}


def reach(path: str, program: str) -> Reply:
    """Attempt to write a file, run programs, open a connection and keep descriptors; returns what each met."""
    attempts: dict[str, Callable[[], object]] = {
        "write": lambda: open(path, "w").close(),
        "append": lambda: open(path, "a").close(),
        "rename": lambda: os.rename(program, path),
        "folder": lambda: os.mkdir(path),
        "link": lambda: os.symlink(program, path),
        "system": lambda: os.system(f"{program} {path}") and 1 / 0,
        "program": lambda: subprocess.run([program, path], check=True),
        "replace": lambda: os.execv(program, [program, path]),
        "fork": os.fork,
        "socket": socket.socket,
    }
    met = {}
    for name, attempt in attempts.items():
        try:
            attempt()
            met[name] = "done"
        except Exception as error:
            met[name] = type(error).__name__
    return {"met": met, "open": sorted(os.listdir("/proc/self/fd"), key=int)}, {}


def double() -> Generator[Reply, dict[str, int], None]:
    """Ask for a number twice, and return double of each."""
    for _ in range(2):
        given = yield {"asks": "a number"}, {}
        yield {"double": 2 * given["number"]}, {}


def crash() -> Reply:
    """End by a fault of memory."""
    return {"read": ctypes.string_at(0).decode()}, {}


def fail(way: str) -> Iterator[Reply]:
    """Answer once, then end badly: spin, grow, crash, flood, exit, sleep, refuse or raise."""
    yield {"before": way}, {}
    if way == "spin":
        while True:
            pass
    if way == "grow":
        yield {"size": np.ones(1 << 30).nbytes}, {}
    if way == "crash":
        yield crash()
    if way == "exit":
        os._exit(7)
    if way == "sleep":
        import time

        time.sleep(60)
    if way == "flood":
        for _ in range(1000):
            yield {}, {"block": np.zeros(1 << 17)}
    if way == "refuse":
        raise DataError("a.mat: refused")
    raise KeyError(way)
