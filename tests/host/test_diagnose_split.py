"""The recording itself: what is sealed stays sealed, and each fault of a channel is found where it is."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aeolid.diagnose.data.forensics import examine
from aeolid.diagnose.data.range_ends import blurred_ends, rails
from aeolid.diagnose.data.resample import factor_for
from aeolid.diagnose.data.split import Split, segments_of, split_records, split_sparsely
from aeolid.errors import NotIdentifiable
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
CHANNELS = (Channel("u", "V", "input"), Channel("y", "m", "output"))
STEP = 0.1


def record(samples: int, source: str = "a.csv", *, spread: float = 1.0, values: Array | None = None) -> Record:
    """Return a record whose y is its own sample number, so that a segment tells where it came from."""
    u = spread * np.random.default_rng(samples).standard_normal(samples)
    table = np.column_stack([u, np.arange(samples, dtype=float)]) if values is None else values
    return Record(STEP * np.arange(samples), table, CHANNELS, STEP, source, "")


def rows_of(split: Split) -> dict[str, dict[str, list[int]]]:
    """List the sample numbers that each part uses, by file."""
    return {
        use: {
            source: [int(v) for s in getattr(split, use) if s.source == source for v in s.y[:, 0]]
            for source in {s.source for s in getattr(split, use)}
        }
        for use in ("fit", "select", "sealed")
    }


def divide(records: list[Record], settle_s: float = 2.0, stride: int = 1) -> Split:
    return split_records(records, ["u"], ["y"], settle_s, stride)


@pytest.mark.parametrize(("hole", "cut"), [((200, 300), True), ((200, 230), False)])
def test_a_recording_is_cut_where_one_of_its_outputs_is_missing_for_long(hole: tuple[int, int], cut: bool) -> None:
    """Nothing is scored there, and with one output alone the gain of both may let the states run away."""
    table = np.column_stack([np.ones(1000), np.arange(1000.0), np.arange(1000.0)])
    table[hole[0] : hole[1], 2] = np.nan  # the other output goes on
    table[400:500, 1:] = np.nan  # nothing was logged: states go on by the model
    channels = (*CHANNELS, Channel("z", "m", "output"))
    made = Record(STEP * np.arange(1000), table, channels, STEP, "a.csv", "")
    found = [(int(s.y[0, 0]), int(s.y[-1, 0])) for s in segments_of(made, (0, 1000), ["u"], ["y", "z"], 0.0)]
    assert found == ([(0, 199), (300, 999)] if cut else [(0, 999)])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.integers(500, 2000), min_size=1, max_size=4), st.floats(0, 40), st.integers(1, 3), st.randoms())
def test_no_sample_serves_twice(lengths: list[int], settle: float, stride: int, random) -> None:  # type: ignore[no-untyped-def]
    records = [record(3 * n, f"{i}.csv") for i, n in enumerate(lengths)]
    for r in records:  # holes in the inputs cut stretches in two
        for _ in range(2):
            r.values[random.randrange(len(r)), 0] = np.nan
    try:
        rows = rows_of(divide(records, settle, stride))
    except NotIdentifiable:
        return  # a hole may leave too little; that is said, not silently used
    for file in {f for part in rows.values() for f in part}:
        used = [v for part in rows.values() for v in part.get(file, [])]
        assert len(used) == len(set(used))
        if rows["sealed"].get(file):
            first = min(rows["sealed"][file])
            assert all(v < first for use in ("fit", "select") for v in rows[use].get(file, []))


def test_lost_rows_do_not_leave_stretches_too_short_for_long_predictions() -> None:
    """Ten recordings with a lost row every fiftieth: predictions over five would leave half of them without a use."""
    records = [record(300, f"{i}.csv") for i in range(10)]
    whole, stride = split_sparsely(records, ["u"], ["y"], 2.0, 5)
    assert stride == 5
    for i, r in enumerate(records):
        r.values[3 * i + 20 :: 50] = np.nan
    split, stride = split_sparsely(records, ["u"], ["y"], 2.0, 5)
    finest = divide(records)
    assert stride == 2 and 0.8 * finest.samples <= split.samples <= finest.samples < whole.samples
    with pytest.raises(NotIdentifiable):
        divide(records, stride=5)


def test_one_recording_is_cut_in_time_with_gaps() -> None:
    settle = 2.0
    rows = rows_of(divide([record(2000)], settle))
    parts = [rows[u]["a.csv"] for u in ("fit", "select", "sealed")]
    gap = round(3 * settle / STEP)
    assert [len(p) for p in parts] == [1000, 400 - gap, 600 - gap]
    for before, after in itertools.pairwise(parts):
        assert after[0] - before[-1] == gap + 1


def test_the_gap_never_eats_the_recording() -> None:
    parts = rows_of(divide([record(2000)], 1e6))
    assert min(len(p["a.csv"]) for p in parts.values()) == 400 - 100  # a twentieth of 2000 is the largest gap


def test_of_two_the_last_is_sealed_whole() -> None:
    rows = rows_of(divide([record(2000, "a.csv"), record(700, "b.csv")]))
    assert rows["sealed"] == {"b.csv": list(range(700))}
    assert set(rows["fit"]) == set(rows["select"]) == {"a.csv"}
    assert len(rows["fit"]["a.csv"]) == 1400


def test_of_three_the_one_of_middle_amplitude_is_sealed() -> None:
    records = [record(1000, "a.csv", spread=2.0), record(1010, "b.csv", spread=0.5), record(1020, "c.csv", spread=1.0)]
    rows = rows_of(divide(records))
    assert set(rows["sealed"]) == {"c.csv"} and set(rows["fit"]) == set(rows["select"]) == {"a.csv", "b.csv"}


def test_only_the_fit_part_scores_its_start() -> None:
    split = divide([record(2000)], 3.0)
    assert all(s.burn == 0 for s in split.fit)
    assert all(s.burn == 30 for s in (*split.select, *split.sealed))
    assert all(s.burn <= 0.15 * len(s.y) for s in divide([record(2000)], 300.0).sealed)


def test_a_stride_thins_outputs_and_keeps_inputs() -> None:
    split = divide([record(3000)], 2.0, 5)
    for s in (*split.fit, *split.select, *split.sealed):
        assert len(s.u) == 5 * len(s.y) and s.step == pytest.approx(0.5) and s.fine_step == pytest.approx(STEP)
        np.testing.assert_array_equal(np.diff(s.y[:, 0]), 5)
        assert s.start_s == pytest.approx(STEP * s.y[0, 0])


def test_the_table_of_parts_says_what_was_done() -> None:
    split = divide([record(2000)])
    assert [r["use"] for r in split.rows] == ["fit", "select", "sealed"]
    assert "a.csv from" in split.sealed_text
    for r, s in zip(split.rows, (*split.fit, *split.select, *split.sealed), strict=True):
        assert (r["start_s"], r["stop_s"]) == (s.start_s, s.stop_s)


@pytest.mark.parametrize("samples", [30, 100, 120])
def test_too_short_says_what_is_needed(samples: int) -> None:
    with pytest.raises(NotIdentifiable, match=rf"a\.csv.*{samples} samples in all.*150 are needed"):
        divide([record(samples)])


@pytest.mark.parametrize("settle", [0.0, 3.0, 1e6])
@pytest.mark.parametrize("samples", [150, 400])
def test_what_is_needed_is_enough(samples: int, settle: float) -> None:
    assert {r["use"] for r in divide([record(samples)], settle).rows} == {"fit", "select", "sealed"}


def test_many_short_recordings_are_divided_whole() -> None:
    """Seventeen of 90 samples have no part of 60 each for selection: one in three of them is for that, whole."""
    split = divide([record(90, f"{k}.csv") for k in range(17)])
    parts = [[s.source for s in part] for part in (split.fit, split.select, split.sealed)]
    assert [len(p) for p in parts] == [11, 5, 1] and len({*parts[0], *parts[1], *parts[2]}) == 17
    assert all(len(s.y) == 90 for part in (split.fit, split.select, split.sealed) for s in part)


def test_missing_inputs_cut_and_missing_outputs_do_not() -> None:
    r = record(2000)
    r.values[300, 0] = np.nan
    r.values[500:600, 1] = np.nan
    split = divide([r])
    assert len(split.fit) == 2 and [len(s.y) for s in split.fit] == [300, 699]
    assert int(np.isnan(split.fit[1].y).sum()) == 100
    assert all(np.all(np.isfinite(s.u)) for s in split.fit)


@pytest.mark.parametrize(
    ("rate", "step", "samples", "factor"),
    [(0.0, 0.1, 5000, 1), (1.0, 0.1, 5000, 1), (1.0, 0.001, 50000, 83), (1.0, 0.001, 2_000_000, 100),
     (30.0, 0.001, 9000, 1)],
)  # fmt: skip
def test_only_oversampled_recordings_are_thinned(rate: float, step: float, samples: int, factor: int) -> None:
    """A tenth of the time constant a prediction, 600 samples left; below a factor of 4 nothing changes."""
    assert factor_for(rate, step, samples) == factor


def noise(samples: int = 2000) -> Array:
    rng = np.random.default_rng(3)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.9 * y[k - 1] + rng.standard_normal()
    return y


def stuck(y: Array) -> Array:
    y[400:900] = y[400]
    return y


def holes(y: Array) -> Array:
    y[100:130] = np.nan
    return y


def mostly_missing(y: Array) -> Array:
    y[::2] = np.nan
    y[1:300] = np.nan
    return y


FAULTS = {
    "missing": (holes, "warning"),
    "missing, most": (mostly_missing, "fault"),
    "constant": (lambda y: np.full_like(y, 7.0), "fault"),
    "stuck": (stuck, "fault"),
    "rail": (lambda y: np.clip(y, -2.0, 50.0), "warning"),
    "folded": (lambda y: np.abs(y), "warning"),
    "spacing": (lambda y: np.round(y), "info"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_on_its_channel(fault: str) -> None:
    spoil, severity = FAULTS[fault]
    found = examine([record(2000, "x/rec.csv", values=np.column_stack([noise()[::-1], spoil(noise())]))])
    hits = [f for f in found if f.check == fault.split(",")[0]]
    assert len(hits) == 1 and hits[0].severity == severity and hits[0].channel == "y (rec.csv)"
    assert all(f.channel == "y (rec.csv)" for f in found)


@pytest.mark.parametrize("level", [0.0, 5.0, 1e6])
def test_a_clean_channel_has_no_finding(level: float) -> None:
    values = np.column_stack([noise()[::-1], level + noise()])
    assert examine([record(2000, values=values)]) == ()


def test_a_square_wave_input_is_no_fault() -> None:
    u = np.repeat(np.random.default_rng(1).choice([-1.0, 1.0], 20), 100)
    assert not [f for f in examine([record(2000, values=np.column_stack([u, noise()]))]) if f.severity == "fault"]


def test_a_constant_input_is_a_warning() -> None:
    found = examine([record(2000, values=np.column_stack([np.ones(2000), noise()]))])
    assert [(f.check, f.severity) for f in found] == [("constant", "warning")]


def test_every_recording_is_examined(tmp_path: Path) -> None:
    bad = record(2000, "bad.csv", values=np.column_stack([noise(), np.zeros(2000)]))
    good = record(2000, "good.csv", values=np.column_stack([noise(), noise()]))
    assert [f.channel for f in examine([good, bad])] == ["y (bad.csv)"]


def clipped(seed: int, *, step: float = 0.0, end: float = 2.6) -> Array:
    """Return a swing that a range of so many deviations cuts a few times of 3000, read to nine digits or in steps."""
    rng = np.random.default_rng(seed)
    x = np.convolve(rng.standard_normal(3200), np.exp(-np.arange(200) / 6.0), "valid")[:3000]
    x = np.clip(x / x.std(), -end, end)
    return step * np.rint(x / step) if step else x


def test_a_few_samples_at_the_very_same_extreme_are_a_rail() -> None:
    """A limit that takes 0.1 to 1 % of the samples, never five in a row: values of nine digits do not repeat.

    Where values come in wide steps they do, and there half a per cent it must be of one end alone; nor is a swing that
    nothing cuts a rail.
    """
    for seed in range(20):
        x = clipped(seed)
        often = {s: int(np.sum(x == end)) for s, end in (("low", x.min()), ("high", x.max()))}
        assert rails(x) == {s: 2.6 if s == "high" else -2.6 for s, n in often.items() if n >= 3}, often
        coarse = np.minimum(clipped(seed, step=0.1, end=np.inf), 2.6)
        assert all(np.sum(coarse == end) > 0.005 * len(x) for end in rails(coarse).values()), often
        assert rails(clipped(seed, step=0.1, end=np.inf)) == {}
        assert rails(np.random.default_rng(seed).standard_normal(3000)) == {}


def test_an_extreme_that_is_reached_far_more_often_than_the_levels_next_to_it_is_a_rail() -> None:
    """Of levels of 12 bits values repeat anywhere, but a swing's tail thins out: ten times at its end are no chance.

    A swing that nothing cuts has none, nor a sine with noise, which stays longest at its ends.
    """
    found = 0
    for seed in range(40):
        x = clipped(seed, end=2.6)
        step = float(np.ptp(x)) / 4096
        often = [int(np.sum(x == end)) for end in (x.min(), x.max())]
        found += len(rails(step * np.rint(x / step))) if min(often) >= 8 else 2
        whole = clipped(seed, end=np.inf)
        assert rails(step * np.rint(whole / step)) == {}
        sine = np.sin(0.37 * np.arange(3000)) + 0.003 * np.random.default_rng(seed).standard_normal(3000)
        assert rails(step * np.rint(sine / step)) == {}
    assert rails(np.full(100, 2.5)) == {}, "what never changes has no range"
    assert found >= 72, "an end reached eight times is reached in fewer than five visits now and then"


def test_an_end_of_a_range_is_seen_under_the_noise_that_comes_after_it() -> None:
    """Cut where a tenth of the samples lie, with noise of 3 % of the deviation: no value comes twice at the end.

    Swings that nothing cuts have none, slow ones and a sine among them, which turn where they are highest.
    """
    found = 0
    for seed in range(20):
        noise = 0.03 * np.random.default_rng(seed).standard_normal(3000)
        x = clipped(seed, end=np.inf)
        cut = blurred_ends(np.minimum(x, 1.3) + noise)
        found += "high" in cut and abs(cut["high"] - 1.3) < 0.05
        slow = np.convolve(x, np.ones(100) / 100, "same")
        sine = np.sin(0.037 * np.arange(3000))
        assert all(blurred_ends(v + noise) == {} for v in (x, slow / slow.std(), sine))
    assert found >= 16
    assert blurred_ends(np.full(100, 2.5)) == {}


@pytest.mark.parametrize(("missing", "told"), [(2, "output 'z'"), (0, "input 'u'")])
def test_a_channel_that_ends_early_is_named(missing: int, told: str) -> None:
    """One of two outputs, or an input, is missing throughout the sealed part."""
    table = np.column_stack([np.random.default_rng(1).standard_normal(900), np.arange(900.0), np.arange(900.0)])
    table[600:, missing] = np.nan
    made = Record(STEP * np.arange(900), table, (*CHANNELS, Channel("z", "m", "output")), STEP, "a.csv", "")
    with pytest.raises(NotIdentifiable, match=f"sealed part: the {told} is missing in 2.. of its 2.. rows"):
        split_records([made], ["u"], ["y", "z"], 2.0)


def test_extremes_that_are_the_same_but_for_their_signs_are_a_range() -> None:
    """Cut some three times at either end, of 12 bits: no end alone is told from a swing's tail, both together are."""
    found = lone = 0
    for seed in range(40):
        whole = clipped(seed, end=np.inf)
        step = float(np.ptp(whole)) / 4096
        size = np.sort(np.abs(whole))
        coarse = step * np.rint(whole / step)
        cut = np.clip(coarse, *(step * np.rint(size[-8] / step) * np.array([-1, 1])))
        often = [int(np.sum(cut == end)) for end in (cut.min(), cut.max())]
        if min(often) >= 3:
            found, lone = found + 1, lone + (len(rails(cut)) == 2)
        assert len(rails(np.minimum(coarse, cut.max()))) < 2, "the other end is nothing"
        assert rails(coarse) == {}
    assert found >= 10 and lone == found
