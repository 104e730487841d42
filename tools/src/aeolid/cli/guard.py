"""Bring every end of a command to one sentence and an exit code: errors, interrupts, a terminal that went away."""

from __future__ import annotations

import errno
import functools
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from aeolid import __version__, output
from aeolid.display import sentence
from aeolid.errors import AeolidError, DataError, UsageError

TRACEBACK = "AEOLID_TRACEBACK"  # set to anything: show where an unexpected error came from
AGAIN_S = 0.02
STOPPED, DEFECT = 130, 70  # as shells say it of Ctrl-C, and sysexits.h of an error in the program itself
_CANNOT_WRITE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


class CarriedError(Exception):
    """Carry an error past the command-line library, which has exit codes of its own for some kinds."""

    def __init__(self, error: BaseException) -> None:
        super().__init__(str(error))
        self.error = error


def carrying(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command whose interrupts and errors of the system reach `main`."""

    @functools.wraps(command)
    def run(*positional: Any, **named: Any) -> Any:
        try:
            return command(*positional, **named)
        except (KeyboardInterrupt, EOFError, OSError) as error:
            raise CarriedError(error) from error

    return run


def explain(error: BaseException, program: str = "aeolid") -> int:
    """Say what ended a command in one sentence on standard error; returns the exit code."""
    if isinstance(error, CarriedError):
        error = error.error
    if os.environ.get(TRACEBACK):
        traceback.print_exception(error)
    code, text = _told(error)
    with suppress(OSError, ValueError):
        print(f"{program}: {sentence(text)}", file=sys.stderr, flush=True)
    return code


def _told(error: BaseException) -> tuple[int, str]:
    if isinstance(error, AeolidError):
        return error.exit_code, str(error)
    if isinstance(error, KeyboardInterrupt):
        return STOPPED, "stopped"
    if isinstance(error, MemoryError):
        return DataError.exit_code, "the data need more memory than there is; split the recording or choose less of it"
    if isinstance(error, OSError) and error.errno in _CANNOT_WRITE:
        return UsageError.exit_code, f"{error.filename or 'an output'}: cannot be written ({error.strerror})"
    if isinstance(error, OSError) and error.filename is not None:
        return DataError.exit_code, f"{error.filename}: {error.strerror or 'cannot be read'}"
    frames = traceback.extract_tb(error.__traceback__)
    where = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "an unknown place"
    return DEFECT, (
        f"unexpected {type(error).__name__} in {where}: a defect of aeolid {__version__}, please report it with the"
        f" command; {TRACEBACK}=1 before the command shows more"
    )


class Stream(io.TextIOBase):
    """Pass text on to standard output; one that cannot be written any more is remembered and not an error at once."""

    def __init__(self, below: Any) -> None:
        """Wrap a text stream; None where the process was started without one."""
        self._below = below
        self.fault: str | None = None

    def write(self, text: str) -> int:
        """Write, or drop the text of a stream that failed."""
        self._attempt(lambda: self._below.write(text))
        return len(text)

    def flush(self) -> None:
        """Flush what was written."""
        self._attempt(lambda: self._below.flush())

    def _attempt(self, act: Callable[[], Any]) -> None:
        if self._below is None:
            self.fault = "it is closed"
        if self.fault is None:
            try:
                act()
            except OSError as error:
                self.fault = error.strerror or str(error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._below, name)

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Return the encoding of the stream below."""
        return getattr(self._below, "encoding", None) or "utf-8"

    def isatty(self) -> bool:
        """Tell whether a terminal is behind it."""
        return self._below is not None and bool(self._below.isatty())

    def fileno(self) -> int:
        """Return the descriptor; raises OSError without one."""
        if self._below is None:
            raise OSError(errno.EBADF, "standard output is closed")
        return int(self._below.fileno())

    def writable(self) -> bool:
        """Tell that text may be written."""
        return True


@contextmanager
def standard_streams() -> Iterator[Stream]:
    """Keep the numbers 0 to 2 for the standard streams, and never let a character end the program."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # else the next file opened would be the standard output
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    stream = Stream(before[0])
    sys.stdout = stream
    if before[1] is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    try:
        yield stream
    finally:
        sys.stdout, sys.stderr = before if before[1] is not None else (before[0], sys.stderr)


def end_of(stream: Stream, code: int) -> int:
    """Flush standard output; where it failed, say so and return code 2 instead of 0."""
    stream.flush()
    if stream.fault is None:
        return code
    with suppress(OSError, ValueError):
        print(f"aeolid: standard output cannot be written ({sentence(stream.fault)})", file=sys.stderr, flush=True)
    with suppress(OSError, ValueError):
        if stream.fileno() == 1:  # what the interpreter still holds is to go nowhere when it ends
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.close(nowhere)
    return code or UsageError.exit_code


@contextmanager
def interrupts() -> Iterator[None]:
    """Let the first Ctrl-C end the command in good order, and the second one at once; both clean up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked: list[int] = []

    def stop(number: int, _: Any) -> None:
        asked.append(number)
        if number == signal.SIGINT and len(asked) == 1:
            raise KeyboardInterrupt
        output.remove_unfinished()
        if number == signal.SIGINT:
            with suppress(OSError):
                os.write(2, b"aeolid: stopped\n")
            os._exit(STOPPED)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)

    def repeat(lost: Any) -> None:
        """Ask again where the first request came in the middle of foreign code, which cannot pass it on."""
        if lost.exc_type is KeyboardInterrupt and len(asked) == 1:
            asked.clear()
            threading.Timer(AGAIN_S, os.kill, (os.getpid(), signal.SIGINT)).start()
        else:
            hook(lost)

    hook, sys.unraisablehook = sys.unraisablehook, repeat
    kinds = [k for k in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(k) not in (signal.SIG_IGN, None)]
    before = {kind: signal.signal(kind, stop) for kind in kinds}
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for kind, handler in before.items():
            signal.signal(kind, stop if asked and kind == signal.SIGINT else handler)  # while the interpreter ends
