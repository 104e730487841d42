"""A limit in processor time: what never ends is ended, and what other load on the machine slows down is not."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest


@contextmanager
def processor_limit(seconds: float) -> Iterator[None]:
    """Fail the test once this process has used so many seconds of processor inside the block.

    Child processes are not counted. Only where the platform has such a timer, and in the main thread: a handler runs
    nowhere else.
    """
    if not hasattr(signal, "SIGPROF") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        pytest.fail(f"more than {seconds:g} s of processor time: it hangs")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
