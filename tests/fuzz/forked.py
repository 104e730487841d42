"""Start confined functions by forking this process instead of a new interpreter: the same limits and barrier, a tenth
of the time. For tests that read thousands of damaged files; what isolates the imports is tested with true children."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from typing import Any, BinaryIO

from aeolid.confined import Limits, Running, child
from aeolid.confined.channel import pack


class Forked:
    """Stand for the process where `Running` expects what subprocess gives."""

    def __init__(self, pid: int, stdin: BinaryIO, stdout: BinaryIO) -> None:
        self.pid, self.stdin, self.stdout = pid, stdin, stdout
        self._code: int | None = None

    def kill(self) -> None:
        if self._code is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> int:
        if self._code is None:
            self._code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self._code


def start(
    function: str, arguments: Mapping[str, Any], limits: Limits, arrays: Mapping[str, Any] | None = None
) -> Running:
    """Do what `aeolid.confined.start` does."""
    request, answer = os.pipe(), os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.dup2(request[0], 0), os.dup2(answer[1], 1)
            for descriptor in (*request, *answer):
                os.close(descriptor)
            memory = limits.memory + data_size()  # what is loaded already is not the function's
            numbers = (memory, limits.mapped, limits.cpu_s, limits.file_size, limits.network)
            child.main([str(int(n)) for n in numbers])
        finally:
            os._exit(70)
    os.close(request[0]), os.close(answer[1])
    process = Forked(pid, os.fdopen(request[1], "wb", 0), os.fdopen(answer[0], "rb", 0))
    running = Running(process, limits)  # type: ignore[arg-type]
    running.send(pack({"function": function, "arguments": dict(arguments)}, dict(arrays or {})))
    return running


def data_size() -> int:
    """Return the bytes that RLIMIT_DATA counts for this process."""
    with open("/proc/self/status") as status:
        return next(1024 * int(line.split()[1]) for line in status if line.startswith("VmData"))


USERS = (
    "aeolid.formats.parquet",
    "aeolid.formats.matlab",
    "aeolid.formats.mdf",
    "aeolid.formats.extras",
    "aeolid.can.logs",
)  # of confined.start
