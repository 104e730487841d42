"""Try what a confined function must not be able to do; the tests run these, and each says what it met."""

from __future__ import annotations

import ctypes
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator

import numpy as np

from aeolid.confined import barrier
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


def reach_beyond(path: str, process: int) -> Reply:
    """Attempt calls of every family that reach other processes, files' attributes or the kernel's own state.

    path: of a file; process: the number of another process. Returns by family and call the number of the error, 0
    where the call was done.
    """
    column, _ = barrier._ARCHES[os.uname().machine]
    library = ctypes.CDLL(None, use_errno=True)
    file, descriptor = path.encode(), os.open(path, os.O_RDONLY)
    room = ctypes.create_string_buffer(256)
    at = {  # arguments that would do harm or at least be looked at; zeros for all others
        "fchmod": (descriptor, 0o777), "fchmodat": (-100, file, 0o777), "fchown": (descriptor, 65534, 65534),
        "fchownat": (-100, file, 65534, 65534, 0), "utimensat": (-100, file, None, 0), "futimesat": (-100, file, None),
        "fsetxattr": (descriptor, b"user.x", b"y", 1, 0), "setxattr": (file, b"user.x", b"y", 1, 0),
        "lsetxattr": (file, b"user.x", b"y", 1, 0), "chmod": (file, 0o777), "chown": (file, 65534, 65534),
        "lchown": (file, 65534, 65534), "utime": (file, None), "utimes": (file, None),
        "rt_sigqueueinfo": (process, 15, room), "rt_tgsigqueueinfo": (process, process, 15, room),
        "pidfd_open": (process, 0), "mq_open": (b"aeolid", os.O_RDONLY, 0o600, None), "shmget": (0, 4096, 0o600),
        "memfd_create": (b"a", 0), "setpriority": (0, process, 5), "process_vm_readv": (process, room, 0, room, 0, 0),
    }  # fmt: skip
    families: dict[str, dict[str, int]] = {}
    for family in ("_PROGRAMS", "_PROCESSES", "_SHARED", "_KERNEL", "_IDENTITY", "_MOUNTS", "_ATTRIBUTES"):
        numbers = {name: number[column] for name, number in vars(barrier)[family].items()}
        # what would replace, fork or stop this process were it done is left to `reach` and to the list itself
        names = [n for n in numbers if numbers[n] >= 0 and n not in ("execve", "execveat", "fork", "vfork", "vhangup")]
        families[family] = {n: _error(library, numbers[n], at.get(n, ())) for n in names}
    kill, tkill, tgkill = (numbers[column] for numbers in barrier._TO_ITSELF)
    limits = (process, 0, ctypes.create_string_buffer(bytes(16), 16), None)
    families["others"] = {
        "kill": _error(library, kill, (process, 15)), "tkill": _error(library, tkill, (process, 15)),
        "tgkill": _error(library, tgkill, (process, process, 15)), "kill all": _error(library, kill, (-1, 0)),
        "prlimit": _error(library, barrier._PRLIMIT[column], limits), "fchmodat2": _error(library, 452, at["fchmodat"]),
        "owner": _error(library, barrier._FCNTL[column], (descriptor, 8, process)),
        "affinity": _error(library, barrier._OF_ITSELF[2][column], (process, 128, room)),
    }  # fmt: skip
    own = {"kill": _error(library, kill, (os.getpid(), 0)), "limits": _error(library, barrier._PRLIMIT[column],
           (0, 7, None, room)), "affinity": _error(library, barrier._OF_ITSELF[2][column], (0, 0, None))}  # fmt: skip
    return {"met": families, "own": own, "asked": os.isatty(descriptor)}, {}


def _error(library: ctypes.CDLL, number: int, arguments: tuple[object, ...]) -> int:
    """Return the error of one system call, 0 where there was none."""
    given = [ctypes.c_long(a) if isinstance(a, int) else a for a in (*arguments, *(0,) * (6 - len(arguments)))]
    return 0 if library.syscall(ctypes.c_long(number), *given) >= 0 else ctypes.get_errno()


def double() -> Generator[Reply, dict[str, int], None]:
    """Ask for a number twice, and return double of each."""
    for _ in range(2):
        given = yield {"asks": "a number"}, {}
        yield {"double": 2 * given["number"]}, {}


def crash() -> Reply:
    """End by a fault of memory."""
    return {"read": ctypes.string_at(0).decode()}, {}


def fail(way: str) -> Iterator[Reply]:
    """Answer once, then end badly: spin, grow, crash, abort, flood, exit, sleep, refuse or raise."""
    yield {"before": way}, {}
    if way == "spin":
        while True:
            pass
    if way == "grow":
        yield {"size": np.ones(1 << 30).nbytes}, {}
    if way == "crash":
        yield crash()
    if way == "abort":
        os.abort()
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
