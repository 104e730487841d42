"""Of two readings of the inputs that are close beside different effects both are fitted to the end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from aeolid.diagnose.candidates import settle_sampling
from aeolid.diagnose.candidates.settle_sampling import Beside, settle_beside
from aeolid.diagnose.data.intersample import Sampling
from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.selection import close_readings

HELD, STRAIGHT = (Sampling((("force", hold),), 0.0, 0.0, free=False) for hold in ("zoh", "foh"))


def effect(name: str, posterior: float, fit_gain: float = 800.0) -> Any:
    """A candidate with this log-posterior as the first look left it."""
    part = SimpleNamespace(entry=name)
    return SimpleNamespace(
        key=name, fit=SimpleNamespace(log_posterior=posterior), fit_gain=fit_gain, attachments=(part,), plausible=True,
        at_end=False, undriven=False, score=posterior,
    )  # fmt: skip


DELAY, DRIVE = effect("transport_delay", 7860.0), effect("actuator_second_order", 7835.0)


@pytest.mark.parametrize(
    ("ends", "short", "read", "leader"),
    [
        ({"transport_delay": 7924.0, "actuator_second_order": 8011.0}, 7879.0, "zoh", "actuator_second_order"),
        ({"transport_delay": 7924.0, "actuator_second_order": 7900.0}, 7879.0, "foh", "transport_delay"),
        ({"transport_delay": 7924.0, "actuator_second_order": None}, 7879.0, "foh", "transport_delay"),  # diverges
        ({"transport_delay": 7924.0, "actuator_second_order": 8011.0}, 7800.0, "foh", "transport_delay"),  # not close
    ],
)
def test_a_brief_fit_does_not_choose_between_close_readings(
    ends: dict[str, float | None], short: float, read: str, leader: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Close is within a tenth of what the leader gains: a trial of a dozen steps may stop short by that."""
    fitted: list[str] = []

    def taken_up(stage: Any, candidate: Any) -> Any:
        fitted.append(candidate.key)
        end = ends[candidate.key]
        return None if end is None else effect(candidate.key, end)

    monkeypatch.setattr(close_readings, "prepare", lambda *_: None)
    monkeypatch.setattr(close_readings, "taken_up", taken_up)
    gains = (
        Sampling(STRAIGHT.holds, 0.025, 0.0, free=True, gain=71.0),
        Sampling(HELD.holds, 0.0, 0.0, False, short - 7835),
    )
    pairs = [Beside(DELAY, gains[0], 7931.0), Beside(DRIVE, gains[1], short)]
    stage: Any = SimpleNamespace(decimation=1)
    case: Any = None
    best, start = close_readings.read_with(case, stage, pairs, DELAY, unlimited())
    assert best.sampling is not None and best.sampling.holds[0][1] == read
    assert start.key == leader and (fitted == [] or short > 7850)


def test_each_reading_is_told_once_with_its_best_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stage's own reading counts as one; leaving a plain one has its price, ln N for N rows."""
    lag = effect("actuator_lag", 7700.0)
    late = Sampling(STRAIGHT.holds, 0.02, 0.0, free=True, gain=30.0)
    own = {DELAY.key: late, DRIVE.key: Sampling(HELD.holds, 0.0, 0.0, False, gain=200.0), lag.key: late}
    monkeypatch.setattr(settle_sampling, "settle", lambda case, prepared, c: own[c.key])
    rows = SimpleNamespace(segments=[SimpleNamespace(y=range(1000))])
    stage: Any = SimpleNamespace(predictor=rows, deadline=unlimited(), sampling=SimpleNamespace(is_plain=False))
    case: Any = None
    found = settle_beside(case, stage, [DELAY, lag, DRIVE])
    assert [(p.candidate.key, p.value) for p in found] == [(DRIVE.key, 8035.0), (DELAY.key, 7890.0)]
    own[DRIVE.key] = None
    assert [p.sampling is None for p in settle_beside(case, stage, [DELAY, lag, DRIVE])] == [False, True]
