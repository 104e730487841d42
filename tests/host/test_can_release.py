"""Samples that are handed out while a node streams: the same as all at once, in bounded memory."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.can.runs import Run
from aeolid.can.samples import SampleStore, SampleTable, follows
from aeolid.formats.growing import open_growing

CHANNELS = 3


def stream(
    pieces: list[tuple[int, int]], seed: int, every: int
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, int]]:
    """Build batches of (channel, index, value) and the full index told after them; pieces: (first sample, samples)."""
    generator = np.random.default_rng(seed)
    batches = []
    for first, count in pieces:
        index = np.repeat(first + every * np.arange(count), CHANNELS)
        channel = np.tile(np.arange(CHANNELS), count)
        kept = generator.random(len(index)) > 0.05
        index, channel = index[kept], channel[kept]
        value = (index * 10 + channel).astype(np.float32).view(np.uint32)
        for k in range(0, len(index), 40):
            part = slice(k, k + 40)
            if len(index[part]):
                told = int(index[part][-1])
                batches.append((channel[part].astype(np.uint8), index[part] & 0xFFFF, value[part], told))
    return batches


def fill(batches: list[tuple[np.ndarray, np.ndarray, np.ndarray, int]], keep: int | None, every: int) -> tuple[
    list[SampleTable], SampleStore
]:  # fmt: skip
    """Feed a store, releasing after each batch when `keep` is given."""
    store, tables = SampleStore(CHANNELS), []
    for channel, index, value, told in batches:
        store.add(channel, index.astype(np.uint16), value)
        store.anchor(told)
        if keep is not None:
            tables += store.release(keep, every)
    return tables, store


def flat(tables: list[SampleTable]) -> list[tuple[int, int, float]]:
    """List what arrived: sample, channel, value."""
    found = []
    for table in tables:
        row, channel = np.nonzero(np.isfinite(table.values))
        found += list(
            zip(table.index[row].tolist(), channel.tolist(), table.values[row, channel].tolist(), strict=True)
        )
    return found


@settings(max_examples=60, deadline=None)
@given(
    pieces=st.lists(
        st.tuples(st.integers(0, 12), st.integers(1, 120)), min_size=1, max_size=5, unique_by=lambda p: p[0]
    ),
    seed=st.integers(0, 99),
    keep=st.integers(40, 80),  # above the 16 samples by which frames may overtake each other
    every=st.sampled_from([1, 4]),
)
def test_released_samples_are_those_of_one_table(
    pieces: list[tuple[int, int]], seed: int, keep: int, every: int
) -> None:
    """Whatever the pauses and restarts: the same values under the same indices, the same losses."""
    batches = stream([(5000 * block, count) for block, count in pieces], seed, every)
    _, whole = fill(batches, None, every)
    tables, rest = fill(batches, keep, every)
    assert flat(tables + rest.tables(every)) == flat(whole.tables(every))
    assert rest.lost(every) == whole.lost(every) and rest.arrived == whole.arrived
    assert rest.last_index() == whole.last_index()


def test_memory_is_bounded_and_the_run_goes_on() -> None:
    """A long run in many batches: what is held stays near what is asked for, and each table follows the one before."""
    batches = stream([(65_000, 20_000)], 1, 1)
    store, tables = SampleStore(CHANNELS), []
    for channel, index, value, told in batches:
        store.add(channel, index.astype(np.uint16), value)
        store.anchor(told)
        tables += store.release(100, 1)
        assert sum(len(t.values) for t in store.tables(1)) <= 100 * 1.2 + 40
    for before, after in pairwise(tables):
        assert follows(int(after.index[0]), int(before.index[-1]), len(before.values), 1)
    assert int(tables[0].index[0]) == 65_000


def test_what_comes_after_its_sample_was_released_is_lost() -> None:
    """A frame that a gateway delays by more than is kept counts as lost, and makes no second row."""
    store = SampleStore(1)
    index = np.delete(np.arange(1000), 995)
    store.add(np.zeros(999, np.uint8), index.astype(np.uint16), np.arange(999).astype(np.uint32))
    store.anchor(999)
    released = store.release(2, 1)
    store.add(np.zeros(1, np.uint8), np.array([995], np.uint16), np.array([7], np.uint32))
    assert len(released[-1].index) == 998 and store.lost(1) == 1
    assert [t.index.tolist() for t in store.tables(1)] == [[998, 999]]


@pytest.mark.parametrize("keep", [1, 50])
def test_undated_samples_wait(keep: int) -> None:
    """Without a full index nothing is released until eight times as much is held, which bounds the memory."""
    store = SampleStore(1)
    for k in range(8 * keep):
        store.add(np.zeros(1, np.uint8), np.array([k], np.uint16), np.zeros(1, np.uint32))
        assert store.release(keep, 1) == []
    store.add(np.zeros(1, np.uint8), np.array([8 * keep], np.uint16), np.zeros(1, np.uint32))
    assert sum(len(t.index) for t in store.release(keep, 1)) == 7 * keep + 1


def test_rows_missing_between_two_releases_are_rows_without_a_value(tmp_path: Path) -> None:
    """What is written in pieces has the rows, the hash and the losses of one table; double rows are left out."""
    description = SimpleNamespace(sample_every=2, sample_time_s=0.1, inputs=1, outputs=0)
    run, target = Run(SimpleNamespace(description=description), 0, 0), tmp_path / "r.csv"
    run._table = open_growing(target, ".csv", ("time_s", "a", "b"), ("s", "", ""))
    values = np.arange(40.0).reshape(20, 2)
    for first, last in ((0, 7), (5, 9), (15, 20)):
        lost = 1 if first == 15 else 0
        run.append(SampleTable(2 * np.arange(first, last), values[first:last], lost))
    run._table.close()
    values[9:15] = np.nan
    assert (run.rows, run.last, run.lost) == (20, 38, 6 * 2 + 1)
    assert run.sha256 == hashlib.sha256(values.tobytes()).hexdigest()
    found = np.genfromtxt(target, delimiter=",", skip_header=1)
    np.testing.assert_array_equal(found, np.column_stack([np.round(0.2 * np.arange(20), 9), values]))
