"""Filters of a fleet: what is kept is what the rules say, and no window reaches across what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.errors import DataError, UsageError
from aeolid.fleet.keep import Keep, kept, parse_keep
from aeolid.fleet.plan import Plan
from aeolid.fleet.summary import merge_all, summarise
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record, Roles

CHANNELS = Channel("u", "1", "input"), Channel("y", "1", "output"), Channel("status", "1", "scheduling")
ROLES = Roles(CHANNELS, 0.1, None, "roles.toml")


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("status=1", (1, 1)),
        ("u=8..12", (8, 12)),
        ("u=-3.5..", (-3.5, np.inf)),
        ("u=..1e3", (-np.inf, 1000)),
        ("u=1709290800..1709294400.5", (1709290800, 1709294400.5)),
        ("u=1500000..1999999.5", (1.5e6, 1999999.5)),
    ],
)
def test_rules_are_read_and_written_alike(text: str, ends: tuple[float, float]) -> None:
    rule = parse_keep(text, ROLES)
    assert (rule.low, rule.high) == ends and parse_keep(rule.text(), ROLES) == rule


@pytest.mark.parametrize(
    ("text", "told"),
    [("wind=8..12", "no channel 'wind'"), ("u", "not understood"), ("u=..", "not understood"),
     ("u=a", "not understood"), ("u=3..1", "lower end is above")],
)  # fmt: skip
def test_rules_that_are_none_are_refused(text: str, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        parse_keep(text, ROLES)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.sampled_from([0.0, 1.0, 2.0, np.nan]), min_size=1, max_size=30))
def test_samples_outside_are_missing_and_others_untouched(states: list[float]) -> None:
    state = np.array(states)
    values = np.column_stack([np.arange(len(state)), np.ones(len(state)), state])
    record = Record(0.1 * np.arange(len(state)), values, ROLES.channels, 0.1, "a.csv", "")
    rules = (Keep("status", 1.0, 2.0), Keep("u", 3.0, np.inf))
    inside = np.isin(state, (1.0, 2.0)) & (np.arange(len(state)) >= 3)
    if not inside.any():
        with pytest.raises(DataError, match=r"a.csv: no sample with status=1\.\.2, u=3\.\."):
            kept(record, rules)
        return
    found = kept(record, rules)
    np.testing.assert_array_equal(found.values[inside], values[inside])
    assert np.isnan(found.values[~inside]).all() and kept(record, ()) is record


def test_the_factor_is_that_of_the_stretches_kept() -> None:
    """As if the recording had been cut there; another rule is another factor in the cache."""
    record = simulate_fourth_order(900, 3, feedback=0.25)
    state = np.where((np.arange(900) < 300) | (np.arange(900) >= 500), 1.0, 0.0)
    with_state = replace(record, values=np.column_stack([record.values, state]),
                         channels=(*record.channels, Channel("status", "1", "scheduling")))  # fmt: skip
    whole = summarise(kept(with_state, (Keep("status", 1.0, 1.0),)), 8)
    parts = [replace(record, values=record.values[a:b], time_s=record.time_s[a:b]) for a, b in ((0, 300), (500, 900))]
    cut = merge_all(iter([summarise(p, 8) for p in parts]))
    assert sum(whole.windows) == sum(cut.windows)
    roles = Roles(with_state.channels, 0.1, None, "r")
    plans = [
        Plan(roles, 8, 4, (), None, None, keep)
        for keep in ((), (Keep("status", 1.0, 1.0),), (Keep("status", 0.0, 1.0),))
    ]
    assert len({p.cache_key("x") for p in plans}) == 3
