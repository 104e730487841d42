"""The tests of the innovations keep their level, and every parameter of the map has one place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from monitor_nodes import configure, describe, simulate, small_theta
from scipy.stats import binom, chi2, f

from aeolid.can.description import Description
from aeolid.monitor.innovations import BEFORE, BLOCK, LAGS, LEVEL, Block, InnovationTest, whiteness
from aeolid.monitor.track import column_of, lag_table


def judged(d: Description, theta: np.ndarray, u: Any, y: Any, e: Any = None, batch: int = 97) -> list[Block]:
    """Let the test see samples in batches, the right parameters from before the first of them."""
    test = InnovationTest(d)
    test.snapshot(theta, 10**6)
    index = np.arange(len(u))
    found: list[Block] = []
    for start in range(0, len(u), batch):
        part = slice(start, start + batch)
        found += test.add(index[part], u[part], y[part], None if e is None else e[part])
    return found


@pytest.mark.parametrize("model_set, feedthrough", [("varx", ()), ("varx", (0,)), ("varmax", ()), ("varmax", (0,))])
def test_innovations_are_those_of_the_system(model_set: str, feedthrough: tuple[int, ...]) -> None:
    """Q, F and size of each block are those of the noise that went in, by a spelled-out Ljung–Box and numpy."""
    d = describe(3, model_set=model_set, feedthrough=feedthrough)
    e = np.random.default_rng(3).normal(size=(5 * BLOCK + 40, 2))
    theta = small_theta(d)
    blocks = judged(d, theta, *simulate(d, theta, len(e), e))
    assert len(blocks) == 5
    first = blocks[0].index - BLOCK + 1
    assert d.past <= first <= 3 * d.past
    variances = []
    for i, block in enumerate(blocks):
        mine = e[first + i * BLOCK : first + (i + 1) * BLOCK]
        tolerance = 1e-9 if model_set == "varx" else 1e-2  # the first innovations of a recursion hold its start
        np.testing.assert_allclose(block.deviation, mine.std(axis=0, ddof=1), rtol=tolerance)
        x = mine - mine.mean(axis=0)
        q = sum(
            BLOCK * (BLOCK + 2) / (BLOCK - t) * ((x[t:] * x[:-t]).sum(axis=0) / (x * x).sum(axis=0)) ** 2
            for t in range(1, LAGS + 1)
        )
        np.testing.assert_allclose(block.whiteness, q, rtol=100 * tolerance)
        if variances:
            np.testing.assert_allclose(block.ratio, block.deviation**2 / np.mean(variances, axis=0), rtol=1e-9)
            assert block.high == pytest.approx(f.ppf(1 - LEVEL / 2, BLOCK - 1, i * (BLOCK - 1)))
        variances.append(block.deviation**2)
    assert np.isnan(blocks[0].ratio).all() and blocks[0].bound == pytest.approx(chi2.ppf(1 - LEVEL, LAGS))


def test_sent_innovations_are_used_in_a_varmax_window() -> None:
    """With the node's own e in the window a wrong start of the recursion is of no account."""
    d = describe(3, model_set="varmax")
    e = np.random.default_rng(3).normal(size=(BLOCK + 40, 2))
    theta = small_theta(d, 1.0)
    u, y = simulate(d, theta, len(e), e)
    (block,) = judged(d, theta, u[20:], y[20:], e[20:])
    mine = e[20 + block.index - BLOCK + 1 : 21 + block.index]
    alone = judged(d, theta, u[20:], y[20:])
    np.testing.assert_allclose(block.deviation, mine.std(axis=0, ddof=1), rtol=1e-9)
    assert abs(alone[0].deviation / block.deviation - 1).max() > 1e-6


@pytest.mark.parametrize("lost", [0.0, 0.04])
def test_the_level_is_kept_and_lost_samples_do_not_change_it(lost: float) -> None:
    """1,000 blocks of an exact model: alarms as often as LEVEL says, within what chance allows (1e-4)."""
    d = describe(1, outputs=4)
    samples = 250 * BLOCK if not lost else 340 * BLOCK
    generator = np.random.default_rng(11)
    e = generator.normal(size=(samples, 4))
    theta = small_theta(d)
    u = generator.normal(size=(samples, 1))
    y = e.copy()
    for k in range(1, samples):
        y[k] += theta @ np.concatenate([u[k - 1], y[k - 1]])
    u, y = u + d.offset[:1], y + d.offset[1:]
    y[generator.random(samples) < lost] = np.nan
    blocks = judged(d, theta, u, y, batch=5000)
    assert len(blocks) >= 240
    outside = np.sum([b.outside() for b in blocks], axis=0).sum(axis=1)
    tests = 4 * len(blocks)
    # 1.7 % for Q at n = 256: its distribution is χ² for long blocks only
    assert binom.ppf(1e-4, tests, LEVEL) <= outside[0] <= binom.ppf(1 - 1e-4, tests, 1.8 * LEVEL), outside
    assert binom.ppf(1e-4, tests, LEVEL) <= outside[1] <= binom.ppf(1 - 1e-4, tests, LEVEL), outside


def test_colour_and_size_are_found() -> None:
    """Noise with one echo of 0.7, then noise a third larger: each is found in nearly every block, by its own test."""
    d = describe(1)
    theta = small_theta(d)
    e = np.random.default_rng(5).normal(size=(BLOCK * (BEFORE + 10) + 5, 2))
    coloured = e.copy()
    coloured[1:, 0] += 0.7 * e[:-1, 0]
    blocks = judged(d, theta, *simulate(d, theta, len(e), coloured))
    q, size = np.mean([b.outside() for b in blocks], axis=0)
    assert q[0] > 0.95 and q[1] < 0.2 and size.max() < 0.2
    e[BLOCK * BEFORE :, 1] *= 1.33
    later = judged(d, theta, *simulate(d, theta, len(e), e))[BEFORE + 1 : BEFORE + 5]
    assert all(b.outside()[1, 1] for b in later) and not any(b.outside()[1, 0] for b in later)


def test_a_parameter_that_moved_colours_the_innovations() -> None:
    d = describe(2, feedthrough=(0,))
    theta = small_theta(d)
    e = np.random.default_rng(5).normal(size=(6 * BLOCK, 2))
    u, y = simulate(d, theta + np.eye(2, d.regressors, 1) * 0.5, len(e), e)
    assert np.mean([b.whiteness > b.bound for b in judged(d, theta, u, y)], axis=0).max() > 0.9


def test_young_parameters_and_short_memories_are_not_judged() -> None:
    d = describe(2)
    test = InnovationTest(d)
    test.snapshot(small_theta(d), 20 * d.regressors - 1)
    assert "waiting for a snapshot that has seen" in test.waiting and test.caution == ""
    test.snapshot(small_theta(d), None)
    assert "unknown" in test.waiting
    test.add(np.arange(3), np.zeros((3, 1)), np.zeros((3, 2)), None)
    short = Description(**{**d.__dict__, "forgetting": 0.98})
    assert "remembers 50 samples" in InnovationTest(short).caution


def test_an_output_that_stands_still_is_no_finding() -> None:
    e = np.random.default_rng(0).normal(size=(BLOCK, 2))
    e[:, 1] = 0.0
    q = whiteness(e)
    assert q[0] > 0 and np.isnan(q[1])


# parameters ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model_set", ["varx", "varmax"])
@pytest.mark.parametrize("feedthrough", [(), (1,), (0, 1)])
def test_every_parameter_has_one_place(model_set: str, feedthrough: tuple[int, ...]) -> None:
    """Numbered as z is built, oldest block first: each number stands once in the table, where column_of says."""
    d = describe(3, 2, 2, model_set, feedthrough)
    now = configure(d)
    values = np.arange(d.parameters, dtype=np.float32).reshape(d.outputs, -1)
    table = lag_table(values, now)
    found = [x for row in table for lags in row for x in lags if x is not None]
    assert sorted(found) == list(range(d.parameters))
    width = len(table[0])
    for output in range(2):
        for channel in range(width):
            for lag in range(d.past + 1):
                at = column_of(channel, lag, now)
                assert table[output][channel][lag] == (None if at is None else values[output, at])
    assert table[0][1][3] == 1 and table[1][0][1] == d.regressors + (d.past - 1) * width
    assert column_of(width, 1, now) is None and column_of(0, 4, now) is None
