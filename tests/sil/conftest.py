"""Fixtures of the software-in-the-loop tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from harness import Process


@pytest.fixture
def start() -> Iterator[Callable[..., Process]]:
    """Start aeolid processes that never outlive the test."""
    started: list[Process] = []

    def begin(*arguments: object) -> Process:
        started.append(Process(*arguments))
        return started[-1]

    yield begin
    for process in started:
        process.close()
