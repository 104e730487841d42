"""What is held against a name: a load that the runs have themselves, a second effect that brings nothing back."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from aeolid.diagnose.rules import in_force, with_rules
from aeolid.diagnose.run_prior import explain
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.explain import Explanation
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, all_hypotheses
from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import NOTHING, Pair
from aeolid.diagnose.run_prior.search import Scored, Search
from aeolid.record import Channel, Record

STEP, SAMPLES, SPEED = 0.1, 6000, 1.2
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": SPEED}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("acceleration", "m/s^2", "output"), Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip


def shadowed(seed: int, load: float) -> Record:
    """Return a recording whose output answers the pitch, wind, and a load three times a revolution."""
    rng = np.random.default_rng(seed)
    pitch, wind = rng.standard_normal((2, SAMPLES))
    azimuth = np.cumsum(SPEED + 0.02 * np.sin(0.02 * np.arange(SAMPLES))) * STEP
    answer = np.convolve(pitch, [0.0, 0.5, 0.3, 0.1])[:SAMPLES]
    output = answer + 0.5 * wind + load * np.cos(3 * azimuth)
    return Record(STEP * np.arange(SAMPLES), np.column_stack([pitch, output, azimuth]), CHANNELS, STEP, "made", "")


def gained(recording: Record, run: Record) -> tuple[float, float]:
    """Return what a load three times a revolution gains, and what is held against it."""
    search = Search(pair_of([recording], [run], CONTEXT))
    shadow = next(h for h in all_hypotheses(search.pair, {}) if h.entry == "tower_shadow")
    return search.gain(shadow, ())[0], search.control(shadow, ())


def test_a_load_that_the_run_has_itself_counts_three_times_against_the_name() -> None:
    """How large it is goes with the wind, so that one recording gains more by it than another of the same machine."""
    both = shadowed(1, 0.12), shadowed(2, 0.1)
    gain, control = gained(*both)
    rules = in_force()
    with with_rules(replace(rules, run_prior=replace(rules.run_prior, own_load_times=1.0))):
        once = gained(*both)[1]
    assert once > 5
    assert control == pytest.approx(rules.run_prior.own_load_times * once)
    assert gain - control < rules.run_prior.named_nats
    gain, control = gained(shadowed(1, 0.2), shadowed(2, 0.0))
    assert gain - control > rules.run_prior.named_nats


def hypothesis(place: str) -> Hypothesis:
    """Return an effect at a place."""
    return Hypothesis("sensor_scale", place, ("factor",), ("1",), (0.1,), (9.0,), ((1.2,),), lambda v: NOTHING)


class _Second:
    """Stand in for the search behind the first effect, after which the run weighs 0.1 and 300 nats are lost."""

    def __init__(self, found: Scored, *_: object) -> None:
        self.base, self.lost, self.evaluations = SimpleNamespace(weight=0.1), 300.0, 1
        self._found = found

    def screen(self, *_: object) -> list[Scored]:
        return [self._found]

    def refine(self, *_: object) -> list[Scored]:
        return [self._found]


@pytest.mark.parametrize(("nats", "weight", "count"), [(37.0, 0.1, 1), (37.0, 0.316, 2), (200.0, 0.1, 2)])
def test_a_second_effect_brings_the_run_back_or_explains_half(
    nats: float, weight: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stiffness that moved left 300 nats over, of which a sensor's factor gained 37 and brought nothing back."""
    first = Scored(hypothesis("output:speed"), (1.5,), 137.0, 137.0, 0.1)
    other = Scored(hypothesis("output:acceleration"), (1.2,), nats, nats, weight)
    monkeypatch.setattr(explain, "Search", partial(_Second, other))
    x = Explanation(454.0, 0.03, {}, (explain.Found(first, None),), (first,), Modal((), (), ()))
    told = explain._with_further(cast(Pair, None), x, first, cast(Any, [other.hypothesis]), lambda _: None)
    assert len(told.found) == count
