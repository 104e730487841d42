"""Start the command line: from its first line on an interrupt ends it in one sentence.

The sub-commands and what they need are imported after that (`aeolid.cli.app`), which takes most of the time of a short
command.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

STOPPED = 130  # as shells say it of Ctrl-C


def main(arguments: list[str] | None = None) -> int:
    """Run one command.

    Returns the exit code: 0 done, 1 bad news asked for, 2 usage, 3 data, 4 not informative, 130 stopped, 70 a defect.
    """
    with _quiet_while_loading():
        from aeolid.children import guard_imports

        guard_imports(started_as_module=__name__ == "__main__")
        # At its end the interpreter visits every object for the last time: half a second for those of the modules,
        # which go with the process anyhow.
        atexit.unregister(gc.freeze)
        atexit.register(gc.freeze)
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on matrices this small a second thread only waits
        from aeolid.cli.app import run

        return run(arguments)


@contextmanager
def _quiet_while_loading() -> Iterator[None]:
    """End the process at once and in one sentence on Ctrl-C, until a command has a handler of its own.

    Nothing is written before, so nothing is left half made; an exception could be lost in the middle of an import.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _stop)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is _stop:  # else a command was stopped, and its handler stays until the end
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _stop(_number: int, _frame: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, b"aeolid: stopped\n")
    os._exit(STOPPED)


if __name__ == "__main__":
    sys.exit(main())
