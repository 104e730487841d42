"""Which recorded channel the innovations follow: level without anything, the right cell with something planted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter
from scipy.stats import binom

from aeolid.diagnose.localise.cells import Cell
from aeolid.diagnose.localise.paths import colourless, path_cells
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.stats.numbers import json_text

Array = NDArray[np.float64]
ROWS, SPLIT = 3000, 1300


def coloured(rng: np.random.Generator, rows: int) -> Array:
    """Return two channels: one that remembers 30 samples, steps held for 20."""
    slow = lfilter([0.25], [1, -np.exp(-1 / 30)], rng.standard_normal(rows))
    return np.column_stack([slow, np.repeat(rng.uniform(-1, 1, rows // 20 + 1), 20)[:rows]])


def cells_of(e: Array, u: Array) -> tuple[list[Cell], Array]:
    return path_cells([e[:SPLIT], e[SPLIT:]], [u[:SPLIT], u[SPLIT:]])


def marked(e: Array, u: Array) -> set[tuple[int, int]]:
    """Return output and channel of what is marked."""
    cells, edges = cells_of(e, u)
    return {(c.output, c.place // len(edges)) for c in cells if c.significant}


@pytest.mark.parametrize("kind", ["white", "bursts", "closed loop"])
def test_where_nothing_is_left_one_map_in_a_hundred_is_marked(kind: str) -> None:
    """200 recordings, no more than 7 marked: chance of more 1 in 1000 at 1 %.

    White; white with loud stretches that both have; a channel that a controller computes from what comes before it.
    """
    hits = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        e, u = rng.standard_normal((ROWS, 2)), coloured(rng, ROWS)
        if kind == "bursts":
            loud = 1 + 3 * (np.arange(ROWS) % 700 < 100)
            e, u = e * loud[:, None], u * loud[:, None]
        if kind == "closed loop":
            u[1:, 0] += lfilter([0.5], [1, -0.8], e[:-1, 0])
        hits += bool(marked(e, u))
    assert hits <= binom.isf(1e-3, 200, in_force().localise.false_alarm_level), hits


@pytest.mark.parametrize(("output", "channel"), [(0, 0), (1, 1), (0, 1)])
def test_what_follows_a_channel_is_marked_there_and_in_its_band(output: int, channel: int) -> None:
    """A twentieth of the innovations' power, of one channel in the band from 0.02 to 0.05 a sample, 3 samples late."""
    rng = np.random.default_rng(9)
    e, u = rng.standard_normal((ROWS, 2)), coloured(rng, ROWS)
    fresh = colourless([u[:, channel]])[0]
    left = lfilter(*butter(2, [0.04, 0.10], "band"), fresh)
    e[3:, output] += 0.22 / np.std(left) * left[:-3]
    cells, edges = cells_of(e, u)
    assert marked(e, u) == {(output, channel)}
    best = max(cells, key=lambda c: c.z)
    low, high = edges[best.place % len(edges)], edges[best.place % len(edges) + 1]
    assert low < 0.05 and high > 0.02 and best.value > 2


def test_what_comes_before_its_channel_is_not_followed() -> None:
    """A channel that tells of the innovation after it happened is no cause; taken for one, it would be marked."""
    rng = np.random.default_rng(3)
    e, u = rng.standard_normal((ROWS, 1)), coloured(rng, ROWS)
    u[2:, 0] += 2 * e[:-2, 0]
    assert not marked(e, u)
    assert marked(e[::-1], u[::-1]) == {(0, 0)}


def test_a_channel_less_its_own_past_is_white() -> None:
    """Correlations of 30 lags within 3.5 deviations, an autoregression of two poles and a half-sine that repeats."""
    rng = np.random.default_rng(4)
    x = lfilter([1.0], [1, -1.6, 0.8], rng.standard_normal(6000))
    for values in (x, x + 5 * np.sin(np.arange(6000) / 7)):
        left = colourless([values[:2500], values[2500:]])
        assert len(left[0]) == 2500 and not left[0][:30].any()
        z = [np.sum(left[1][k:] * left[1][:-k]) / np.sum(left[1] ** 2) * np.sqrt(len(left[1])) for k in range(1, 31)]
        assert max(np.abs(z)) < 3.5


def test_short_recordings_and_channels_at_rest_have_no_map() -> None:
    e, u = np.zeros((100, 1)), np.zeros((100, 1))
    assert path_cells([e], [u])[0] == []
    rng = np.random.default_rng(1)
    cells, edges = path_cells([rng.standard_normal((ROWS, 1))], [np.column_stack([np.ones(ROWS), coloured(rng, ROWS)])])
    assert {c.place // len(edges) for c in cells} == {1, 2}
    assert np.all(np.isfinite([c.z for c in cells]))


def test_the_surest_path_has_a_number_that_a_file_can_hold() -> None:
    """Its p value is below what a number can be."""
    u = np.random.default_rng(9).choice([-1.0, 1.0], (12_000, 1))
    z = [c.z for c in path_cells([np.roll(u, 3, axis=0)], [u])[0]]
    assert max(z) >= 290 and np.all(np.isfinite(z))


def test_evidence_is_json_whatever_its_numbers() -> None:
    def refused(name: str) -> float:
        raise AssertionError(name)

    facts = {
        "z": np.array([[1.5, np.inf], [np.nan, 2.0]]),
        "n": np.int64(3),
        "f": (np.float64(-np.inf), None, "inf", True),
    }
    held = json.loads(json_text(facts), parse_constant=refused)
    assert held == {"z": [[1.5, None], [None, 2.0]], "n": 3, "f": [None, None, "inf", True]}
