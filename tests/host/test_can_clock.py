"""The controller's clock against the host's: simulated drift, delays, jitter, losses, gaps, restarts."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import theilslopes

from aeolid.can.clock import BINS, PAIRS_MAX, ClockKeeper, ClockPairs, first_channels, fit_clock
from aeolid.can.theil_sen import fit_line
from aeolid.can.wire import PARAMETER, SAMPLE, Frames, encode, join_frames, pack_frames

pytestmark = pytest.mark.usefixtures("forking_throughout")

H, START = 0.1, 1.79e9
ROUNDING_S = 2.4e-7  # of seconds since 1970 in binary64
Array = np.ndarray


def arrivals(count: int, drift: float, generator: np.random.Generator) -> tuple[Array, Array]:
    """Return sample indices, a tenth of them and one long stretch missing, and when they left the controller."""
    index = np.arange(count)
    kept = generator.random(count) > 0.1
    gap = int(generator.integers(0, count * 2 // 3))
    kept[gap : gap + count // 4] = False
    index = index[kept]
    return index, START + H * (1 + drift) * index


def theory(spread: float, span: float, points: int) -> float:
    """Return the standard deviation of a least-squares slope through `points` even points of this spread."""
    return spread * math.sqrt(12.0 / points) / span


@pytest.mark.parametrize("law", ["one-sided", "two-sided"])
def test_drift_is_found_as_well_as_theory_allows(law: str) -> None:
    """100 runs: the error of the drift stays within what the spread of the points it is taken from allows.

    One-sided: exponential delays of mean τ; the earliest of m in a stretch is exponential with mean τ/m. Two-sided:
    Gaussian jitter σ; the earliest of m spreads by less than σ. The factor 1.3 covers Theil–Sen's efficiency of 0.95,
    stretches thinned by losses, and 100 runs (7 % at one standard deviation).
    """
    generator = np.random.default_rng(1)
    count, scale = 6000, 0.01
    errors, inside = [], 0
    for _ in range(100):
        drift = generator.uniform(-1e-4, 1e-4)
        index, true = arrivals(count, drift, generator)
        late = (
            generator.exponential(scale, len(index)) if law == "one-sided" else generator.normal(0, scale, len(index))
        )
        fit = fit_clock(index, true + late, H)
        assert fit.drift_ppm is not None and fit.half_width_ppm is not None
        errors.append(fit.drift_ppm * 1e-6 - drift)
        inside += abs(errors[-1]) <= fit.half_width_ppm * 1e-6
    points = BINS * 3 / 4  # a quarter of the run is missing
    spread = scale / (0.9 * count / BINS) if law == "one-sided" else scale
    assert np.sqrt(np.mean(np.square(errors))) < 1.3 * theory(spread, count * H, points)
    assert inside >= 88  # of 100 at 95 %: three standard deviations below


def test_start_is_that_of_the_earliest_arrivals() -> None:
    """Sample 0 is dated by the shortest way, 3 ms here, not by the mean delay of 13 ms."""
    generator = np.random.default_rng(2)
    index, true = arrivals(6000, 5e-5, generator)
    fit = fit_clock(index, true + 0.003 + generator.exponential(0.01, len(index)), H)
    earliest = 0.01 / 100  # mean of the earliest of a hundred
    assert abs(fit.start_utc - START - 0.003) < 10 * earliest


def test_bursts_of_delay_and_wrong_pairs_do_not_turn_the_line() -> None:
    """A bus that is busy for minutes on end, and pairs that are plainly wrong: still within a few ppm."""
    generator = np.random.default_rng(3)
    index, true = arrivals(6000, -3e-5, generator)
    late = generator.exponential(0.005, len(index)) + (np.sin(index / 300) > 0.3) * generator.exponential(
        0.2, len(index)
    )
    wrong = generator.random(len(index)) < 0.001
    fit = fit_clock(index, true + late - wrong * generator.uniform(0, 5, len(index)), H)
    assert fit.drift_ppm == pytest.approx(-30, abs=5)


def test_a_perfect_clock_shows_no_drift() -> None:
    """Without delays what is left is rounding; two samples are too few for a slope."""
    index = np.arange(2000)
    fit = fit_clock(index, START + H * index, H)
    assert fit.drift_ppm == pytest.approx(0, abs=1e6 * ROUNDING_S / 100) and abs(fit.start_utc - START) < 1e-6
    assert fit.is_real_time
    short = fit_clock(index[:2], START + H * index[:2], H)
    assert short.drift_ppm is None and short.start_utc == START and not short.is_real_time


def test_memory_is_bounded_and_nothing_is_gained_by_forgetting() -> None:
    """A million pairs: few are kept, the earliest ones, and the drift is at least as good as from a tenth of them."""
    generator = np.random.default_rng(4)
    pairs, drift = ClockPairs(H), 2e-5
    for k in range(0, 1_000_000, 500):
        index = np.arange(k, k + 500)
        pairs.add(index, START + H * (1 + drift) * index + generator.exponential(0.01, 500))
        assert sum(map(len, pairs._index)) <= 2 * PAIRS_MAX + 500
    fit = pairs.fit()
    assert fit is not None and fit.drift_ppm == pytest.approx(20, abs=0.01) and fit.pairs == 1_000_000


def batches(index: Array, time_s: Array, node: int = 1, size: int = 50) -> list[Frames]:
    """Build sample frames of one channel, with a parameter frame behind each."""
    rows, stamps = [], []
    for k, t in zip(index.tolist(), time_s.tolist(), strict=True):
        for kind in (SAMPLE, PARAMETER):
            identifier, data = encode(node, kind, 0, k & 0xFFFF, 0)
            rows.append((identifier, True, data))
            stamps.append(t)
    return [pack_frames(rows[k : k + size], times_s=stamps[k : k + size]) for k in range(0, len(rows), size)]


def test_frames_give_the_pairs_and_damaged_ones_do_not() -> None:
    """The first channel's frames are picked out by node; wrong bits cost the frame alone; no time, no pair."""
    index = np.arange(65_500, 65_600)
    frames = join_frames([*batches(index, START + H * index), *batches(index[:5], START + H * index[:5], node=9)])
    found = {node: (low, time_s) for node, low, time_s in first_channels(frames)}
    assert set(found) == {1, 9}
    np.testing.assert_array_equal(found[1][0], index & 0xFFFF)
    np.testing.assert_array_equal(found[1][1], START + H * index)
    data = frames.data.copy()
    data[0, 1] ^= 4
    stamps = frames.time_s.copy()
    stamps[2] = np.nan
    spoilt = Frames(frames.id, frames.flags, frames.length, data, stamps)
    assert first_channels(spoilt)[0][1].tolist() == (index[2:] & 0xFFFF).tolist()


def test_turns_of_the_index_silences_and_restarts() -> None:
    """16 bits turn unseen, a silence of two turns is bridged by the host's clock, a restart begins a new line."""
    keeper = ClockKeeper()
    index = np.concatenate([np.arange(60_000, 70_000), np.arange(210_000, 215_000)])
    again = np.arange(3000)
    for part in batches(index, START + H * (1 + 4e-5) * index, size=4000):
        keeper.feed(part, {1: H})
    for part in batches(again, START + 30_000 + H * again, size=4000):
        keeper.feed(part, {1: H})
    first, second = keeper.runs(1)
    low, _ = first.pairs()
    assert low[-1] - low[0] > 150_000 and first.last is not None and first.last[0] == 214_999
    fit = first.fit()
    assert fit is not None and fit.drift_ppm == pytest.approx(40, abs=1e-3)
    assert second.fit().start_utc == pytest.approx(START + 30_000, abs=1e-6)


def test_samples_before_the_description_count_too() -> None:
    """Until a node has told its sample time its first samples wait, some thousands at most."""
    keeper, index = ClockKeeper(), np.arange(300)
    for part in batches(index, START + H * index)[:-1]:
        keeper.feed(part, {})
    assert keeper.runs(1) == []
    keeper.feed(batches(index, START + H * index)[-1], {1: H})
    (run,) = keeper.runs(1)
    assert run.count == 300 and run.first == (0, START)
    for _ in range(PAIRS_MAX // 25):
        keeper.feed(batches(index, START + H * index, node=2)[0], {})
    assert sum(len(low) for low, _ in keeper._early[2]) <= PAIRS_MAX + 25


@pytest.mark.parametrize(("before", "pause_s"), [(30, 0.0), (60, 14.0), (5000, 1.0), (5000, 600.0)])
def test_a_restart_begins_a_new_line(before: int, pause_s: float) -> None:
    """After few samples or many, a short pause or a long one: two lines, the second one dated on its own."""
    keeper, again = ClockKeeper(), np.arange(100)
    begun = START + H * before + pause_s
    for part in [*batches(np.arange(before), START + H * np.arange(before)), *batches(again, begun + H * again)]:
        keeper.feed(part, {1: H})
    first, second = (run.fit() for run in keeper.runs(1))
    assert first is not None and first.start_utc == pytest.approx(START, abs=1e-6)
    assert second is not None and second.start_utc == pytest.approx(begun, abs=1e-6)


@pytest.mark.parametrize("speed", [0.2, 1.0, 37.0, 800.0])
def test_a_controller_in_a_hurry_has_one_line(speed: float) -> None:
    """A simulation may run at any speed: that is no restart."""
    index = np.arange(20_000 if speed >= 1 else 4_000)  # the slower, the more batches of half a second
    for at_once in (False, True):  # frames that are read together may have one time for all of them
        keeper = ClockKeeper()
        half_a_second = max(2, 2 * int(0.5 * speed / H))
        for part in batches(index, START + H / speed * index, size=half_a_second if at_once else 400):
            read = replace(part, time_s=np.full(len(part), part.time_s[-1])) if at_once else part
            keeper.feed(read, {1: H})
        (run,) = keeper.runs(1)
        fit = run.fit()
        assert fit is not None and fit.drift_ppm == pytest.approx(1e6 * (1 / speed - 1), rel=1e-3, abs=0.1)
        assert fit.is_real_time == (speed == 1.0)


def test_the_anchor_is_in_the_files(tmp_path: Path) -> None:
    """Parquet and MDF4 carry when time 0 was; the roles file says so for people."""
    from asammdf import MDF
    from pyarrow import parquet

    from aeolid.cli.main import main

    stream = Path(__file__).resolve().parents[1] / "vectors/wire_v1/stream.log"
    moved = tmp_path / "moved.log"
    lines = [line.split(" ", 1) for line in stream.read_text().splitlines()]
    moved.write_text("".join(f"({float(stamp[1:-1]) + START:f}) {rest}\n" for stamp, rest in lines))
    for suffix in ("parquet", "mf4"):
        assert main(["listen", "--bus", str(moved), "--record", str(tmp_path / f"r.{suffix}")]) == 0
    notes = parquet.read_metadata(tmp_path / "r.parquet").metadata
    anchor = datetime.fromisoformat(notes[b"utc_of_time_0"].decode())
    with MDF(tmp_path / "r.mf4") as file:
        start = file.header.start_time
    assert abs((start - anchor).total_seconds()) < 1e-5
    begun = float(lines[0][0][1:-1]) + START
    assert abs(anchor.timestamp() - begun) < 2.0 and anchor.tzinfo == UTC
    assert anchor.isoformat()[:19] in (tmp_path / "r.roles.toml").read_text()


@pytest.mark.parametrize("seed", range(6))
def test_the_line_is_that_of_scipy(seed: int) -> None:
    """Slope, intercept and interval, with and without ties, from two points on."""
    rng = np.random.default_rng(seed)
    n = [2, 3, 5, 20, 48, 48][seed]
    x = np.cumsum(rng.uniform(0.1, 2.0, n))
    y = np.round(0.3 * x + rng.standard_t(2, n), 1 if seed % 2 else 9)
    for confidence in (0.5, 0.95):
        np.testing.assert_allclose(fit_line(x, y, confidence), theilslopes(y, x, confidence), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("step_s", [-3600.0, -60.0, -5.0, 60.0, 3600.0])
def test_a_host_clock_that_is_set_begins_a_new_line(step_s: float) -> None:
    """The controller goes on, the host's clock is set forth or back: no line through both, and no turn is lost."""
    keeper, index = ClockKeeper(), np.arange(65_000, 72_000)
    for part in batches(index, START + H * index + np.where(index >= 69_000, step_s, 0.0), size=10):
        keeper.feed(part, {1: H})
    first, second = keeper.runs(1)
    assert first.last is not None and second.first is not None
    assert first.last[0] == 68_999 and second.first[0] == 69_000
    fit = second.fit()
    assert fit is not None and fit.start_utc == pytest.approx(START + step_s, abs=1e-4)
    assert fit.drift_ppm == pytest.approx(0, abs=1e-3)
