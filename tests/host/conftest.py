"""What the tests of the host tool share."""

import pytest


@pytest.fixture
def forking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start confined readers by a fork, where a test reads many files."""
    from fuzz_modules import forked

    for user in forked.USERS:
        monkeypatch.setattr(f"{user}.start", forked.start)
