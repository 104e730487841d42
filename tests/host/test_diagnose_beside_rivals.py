"""A further effect is looked for beside what comes near the first one, too, where none stands beside that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from aeolid.diagnose.selection import beside_rivals


def single(name: str, score: float, place: str, **more: Any) -> Any:
    """Return a stand-in of an effect fitted alone."""
    attachment = SimpleNamespace(key=name, location={"entry": place})
    usual = {"complete": True, "unlisted": False, "accepted": True}
    return SimpleNamespace(key=name, score=score, attachments=(attachment,), **(usual | more))


SENSOR = single("sensor lag", 257.0, "output:speed")
STATES = single("sensor lag, in states", 245.0, "output:speed")
DRIVE = single("drive lag", 238.0, "input:thrust")
FAR = single("rate limit", 140.0, "input:thrust")
REFUSED = single("drive lag", 238.0, "input:thrust", accepted=False)
PAIR = 279.0


def found_beside(
    monkeypatch: pytest.MonkeyPatch, singles: list[Any], pairs: dict[str, float], surrogate: object = None
) -> tuple[list[Any], list[str]]:
    """Return a ferry's sets where those of two have these scores, and beside which effects they were looked for."""
    asked: list[str] = []

    def further(prepared: Any, winner: Any, singles: Any, seed: int) -> tuple[list[Any], str]:
        asked.append(winner.key)
        more = [SimpleNamespace(score=pairs[winner.key])] if winner.key in pairs else []
        return [winner, *more], winner.key

    monkeypatch.setattr(beside_rivals, "further_effects", further)
    monkeypatch.setattr(beside_rivals, "is_accepted", lambda c: c.accepted)
    prepared: Any = SimpleNamespace(surrogate=surrogate, deadline=SimpleNamespace(skips=lambda what: False))
    chain, bank = beside_rivals.further_beside_any(prepared, SENSOR, singles, 1)
    assert bank == chain[0].key  # type: ignore[comparison-overlap]
    return chain, asked


def test_two_effects_beside_a_near_one_take_the_place_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ferry's thrust that lags and its drag, 279 nats, instead of a sensor that lags, 257."""
    chain, asked = found_beside(monkeypatch, [SENSOR, STATES, DRIVE, FAR], {"drive lag": PAIR})
    assert [c.score for c in chain] == [238.0, PAIR] and asked == ["sensor lag", "drive lag"]


@pytest.mark.parametrize(
    ("singles", "pairs", "asked"),
    [
        ([SENSOR, DRIVE], {"sensor lag": 300.0, "drive lag": 400.0}, 1),
        ([SENSOR, DRIVE], {"drive lag": 276.0}, 2),
        ([SENSOR, STATES, FAR], {"rate limit": 400.0, "sensor lag, in states": 400.0}, 1),
        ([SENSOR, REFUSED], {"drive lag": 400.0}, 1),
        ([SENSOR, DRIVE], {}, 2),
    ],
    ids=["one stands beside it", "not clearly ahead", "far or at the same place", "refused", "nothing beside either"],
)
def test_else_what_was_first_stays(
    singles: list[Any], pairs: dict[str, float], asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """20 nats are clear; what falls short by more than a tenth is not asked, nor what acts at the same place."""
    chain, told = found_beside(monkeypatch, singles, pairs)
    assert chain[0] is SENSOR and len(told) == asked


def test_not_on_a_simulators_run(monkeypatch: pytest.MonkeyPatch) -> None:
    chain, asked = found_beside(monkeypatch, [SENSOR, DRIVE], {"drive lag": 400.0}, surrogate=object())
    assert chain == [SENSOR] and asked == ["sensor lag"]
