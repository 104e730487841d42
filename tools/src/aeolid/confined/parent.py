"""Start a confined process, bound its answer, and say in words how it ended."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

import aeolid
from aeolid import errors
from aeolid.confined import child
from aeolid.confined.channel import Reply, pack, unpack
from aeolid.confined.limits import Limits

_ENVIRONMENT = {
    "LANG": "C.UTF-8", "PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1",
    "NUMEXPR_MAX_THREADS": "1", "MALLOC_ARENA_MAX": "2", "ARROW_DEFAULT_MEMORY_POOL": "system", "MPLBACKEND": "Agg",
}  # fmt: skip
_KEPT = ("PATH", "TMPDIR", "TZ", "LD_LIBRARY_PATH")  # of the caller's environment
_OWN: dict[str, type[errors.AeolidError]] = {
    kind.__name__: kind for kind in vars(errors).values() if isinstance(kind, type)
}


class Failure(Exception):
    """The confined function did not return; the text says why, in words that can stand in a sentence."""


class Running:
    """Iterate over the replies of one confined function; leaving the `with` block ends the process."""

    def __init__(self, process: subprocess.Popen[bytes], limits: Limits) -> None:
        self._process, self._limits, self._left = process, limits, limits.result

    def __enter__(self) -> Running:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Iterator[Reply]:
        """Yield replies as they come. Raises Failure, or the error of this package that the function raised."""
        while True:
            try:
                message, arrays, taken = unpack(self._fill, self._left)
            except OverflowError:
                raise Failure(f"its content is more than the {_amount(self._limits.result)} that it may be") from None
            except (ValueError, TypeError):
                raise Failure("the process that reads it sent nonsense") from None
            self._left -= taken
            kind, content = message.get("kind"), message.get("content")
            if not isinstance(content, dict):
                raise Failure("the process that reads it sent nonsense")
            if kind == "reply":
                yield content, arrays
            elif kind == "end":
                return
            else:
                raise self._error(str(content.get("class")), str(content.get("text"))[:2000])

    def close(self) -> None:
        """End the process."""
        with suppress(OSError):
            self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def answer(self, facts: Mapping[str, Any]) -> None:
        """Answer a reply whose facts say `asks`: the function goes on with these facts as the value of its `yield`."""
        self.send(pack(facts, {}))

    def send(self, pieces: Sequence[bytes | memoryview]) -> None:
        """Hand one message to the process."""
        assert self._process.stdin is not None  # a pipe, by start
        with suppress(BrokenPipeError):  # how it ended is told on reading
            for piece in pieces:
                left = memoryview(piece)
                while left:
                    left = left[self._process.stdin.write(left) or 0 :]

    def _fill(self, buffer: memoryview) -> None:
        """Fill a buffer from the pipe; raises Failure when the process has ended or is silent for too long."""
        assert self._process.stdout is not None  # a pipe, by start
        pipe = self._process.stdout.fileno()
        poll = select.poll()
        poll.register(pipe, select.POLLIN)
        until = time.monotonic() + self._limits.patience_s
        while buffer:
            if not poll.poll(max(0.0, until - time.monotonic()) * 1000):
                self.close()
                raise Failure(f"reading it did not come to an end in {self._limits.patience_s:.0f} s")
            count = os.readv(pipe, [buffer])
            if count == 0:
                raise self._ending()
            buffer = buffer[count:]

    def _ending(self) -> Failure:
        """Say why the process is no more."""
        code = self._process.wait()
        if code == -signal.SIGXCPU:
            return Failure(f"reading it did not come to an end in {self._limits.cpu_s} s of processor time")
        if code < 0:
            with suppress(ValueError):
                return Failure(f"its reader crashed, {signal.Signals(-code).name}")
        return Failure("its reader ended without an answer")

    def _error(self, name: str, text: str) -> Exception:
        if name in _OWN:
            return _OWN[name](text)
        if "MemoryError" in name or "cannot allocate" in text.lower():
            return Failure(f"reading it takes more than the {_amount(self._limits.memory)} of memory it may")
        return Failure(text or name)


def start(
    function: str, arguments: Mapping[str, Any], limits: Limits, arrays: Mapping[str, NDArray[Any]] | None = None
) -> Running:
    """Run `module:function` of this package in a process of its own.

    function: "aeolid.formats.matlab:send_arrays"; it returns one Reply, or yields several. arguments: given by name,
    values that JSON can hold; paths absolute, since the process works in the root folder. arrays: handed over as the
    argument `arrays` when there are any. Iterate over what is returned, in a `with` block; a reply that has `asks`
    among its facts waits for `answer`.
    """
    numbers = (limits.memory, limits.mapped, limits.cpu_s, limits.file_size, int(limits.network))
    homes = [str(Path(module.__file__ or "").resolve().parents[1]) for module in (aeolid, np)]
    process = subprocess.Popen(
        [sys.executable, "-I", child.__file__, *map(str, numbers), *homes],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd="/",
        env=_ENVIRONMENT | {key: os.environ[key] for key in _KEPT if key in os.environ}, bufsize=0,
        start_new_session=True,
    )  # fmt: skip
    running = Running(process, limits)
    try:
        running.send(pack({"function": function, "arguments": dict(arguments)}, dict(arrays or {})))
    except BaseException:
        running.close()
        raise
    return running


def call(
    function: str, arguments: Mapping[str, Any], limits: Limits, arrays: Mapping[str, NDArray[Any]] | None = None
) -> Reply:
    """Run `module:function` as `start` does, and return its one reply.

    Raises Failure saying why there is none, or the error of this package that the function raised. Cost: the start of
    an interpreter and the imports of the module, 0.2 to 1.5 s.
    """
    with start(function, arguments, limits, arrays) as running:
        for reply in running:
            return reply
    raise Failure("its reader gave no answer")


def _amount(count: int) -> str:
    return f"{count / 2**30:.1f} GiB" if count >= 1 << 30 else f"{count / 2**20:.0f} MiB"
