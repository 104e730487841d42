"""The tests' own limit: processor time ends what hangs, waiting does not."""

from __future__ import annotations

import signal
import time

import pytest
from processor_limit import processor_limit


def test_a_loop_without_an_end_is_ended() -> None:
    with pytest.raises(pytest.fail.Exception, match="processor time"), processor_limit(0.05):
        while True:
            pass
    assert signal.getitimer(signal.ITIMER_PROF)[0] == 0.0


def test_waiting_is_no_processor_time() -> None:
    """As a test waits whose machine is busy with others."""
    with processor_limit(0.2):
        time.sleep(0.5)
