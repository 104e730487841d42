"""What the tests of the host tool share."""

from collections.abc import Iterator

import pytest


def fork(monkeypatch: pytest.MonkeyPatch) -> None:
    from fuzz_modules import forked

    for user in forked.USERS:
        monkeypatch.setattr(f"{user}.start", forked.start)


@pytest.fixture
def forking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start confined readers by a fork, where a test reads many files."""
    fork(monkeypatch)


@pytest.fixture(scope="module")
def forking_throughout() -> Iterator[None]:
    """The same for all tests of a file and what they share: a true child takes half a second for each file read."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        fork(monkeypatch)
        yield
