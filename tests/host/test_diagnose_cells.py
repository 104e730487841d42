"""Where innovations say more than chance: the right cell of the right map, and on white noise hardly any.

The levels stated are those of each map as a whole, 1 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom

from aeolid.diagnose.localise.cells import Cell, azimuth_cells, bins_of, region_cells, stretches_of, time_cells
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]
ROWS, OUTPUTS = 3000, 3
TURN = 0.02  # of a turn a sample: 60 turns


def wandering(rng: np.random.Generator, memory: float, rows: int = ROWS) -> Array:
    """Return a signal of unit deviation with this memory in samples."""
    pole = np.exp(-1 / memory)
    return np.asarray(lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(rows)))


def world(seed: int) -> tuple[Array, Array, Array]:
    """Return white innovations, a wind in m/s and the angle of a rotor whose speed wanders by 4 %."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((ROWS, OUTPUTS))
    angle = np.cumsum(2 * np.pi * TURN * (1 + 0.04 * wandering(rng, 100))) % (2 * np.pi)
    return white, 12 + 2 * wandering(rng, 5), angle


def maps(white: Array, wind: Array, angle: Array) -> dict[str, list[Cell]]:
    bins = bins_of(wind)
    assert bins is not None
    return {
        "time": time_cells(white, stretches_of([1800, ROWS - 1800]), 1),
        "region": region_cells(white, [bins[1]])[0],
        "azimuth": azimuth_cells([white], [angle]),
    }


def marked(found: dict[str, list[Cell]]) -> set[tuple[str, str, int, int]]:
    return {(name, c.kind, c.output, c.place) for name, cells in found.items() for c in cells if c.significant}


@pytest.mark.nightly  # a level over hundreds of recordings
@pytest.mark.slow
def test_of_recordings_without_anything_one_in_a_hundred_has_a_mark_on_a_map() -> None:
    """400 recordings: each map has marks on no more than 11 (chance of more 1 in 1000 at 1 %), all cells on 10 %.

    A limit of a single cell instead of the map's would mark 36 of them and more.
    """
    draws = 400
    hits = {"time": 0, "region": 0, "azimuth": 0}
    for seed in range(draws):
        for name, cells in maps(*world(1000 + seed)).items():
            hits[name] += any(c.significant for c in cells)
    most = int(binom.isf(1e-3, draws, in_force().localise.false_alarm_level))
    assert max(hits.values()) <= most, hits
    assert sum(hits.values()) >= 1, "a test that never speaks has no level"


def test_tails_and_short_memory_keep_the_level() -> None:
    """Student's t with five degrees of freedom, and an AR(1) of 0.7 that no noise model took: 30 recordings each.

    More than 5 marks of twice 30 chances have a chance of 4 in 10,000 at 1 %.
    """
    hits = np.zeros(2, dtype=int)
    for seed in range(30):
        white, wind, angle = world(seed)
        heavy = np.random.default_rng(seed).standard_t(5, white.shape) * np.sqrt(0.6)
        for i, noise in enumerate((heavy, lfilter([np.sqrt(0.51)], [1, -0.7], white, axis=0))):
            found = maps(noise, wind, angle)
            hits[i] += bool(marked({k: v for k, v in found.items() if k != "time"}))
            hits[i] += any(c.significant for c in found["time"])
    assert hits.max() <= 5, hits


def test_the_memory_of_a_power_that_all_stretches_have_is_no_burst() -> None:
    """An AR(1) of 0.8: marked in 6 of 60 recordings; 16 where pieces in random order stand for it as they are."""
    hits = 0
    for seed in range(60):
        white = np.random.default_rng(seed).standard_normal((ROWS, OUTPUTS))
        noise = lfilter([0.6], [1, -0.8], white, axis=0)
        hits += any(c.significant for c in time_cells(noise, stretches_of([1800, 1200]), 1) if c.kind == "power")
    assert hits <= 9, hits


@pytest.mark.parametrize("order", [1, 3, 6])
def test_a_line_along_a_wandering_angle_is_found_at_its_order_alone(order: int) -> None:
    """A fifth of the noise's deviation, in the second output: nowhere else; amplitude to 0.06, phase to 20 degrees.

    The deviation of an amplitude is sqrt(2/N) = 0.026 of the noise, of the phase that over 0.2 rad: 7 degrees.
    """
    white, wind, angle = world(7)
    white[:, 1] += 0.2 * np.cos(order * angle - 0.7)
    found = maps(white, wind, angle)
    assert marked(found) == {("azimuth", "line", 1, order)}
    cell = next(c for c in found["azimuth"] if c.significant)
    assert cell.value == pytest.approx(0.2, abs=0.06)
    assert cell.phase_deg == pytest.approx(np.degrees(0.7), abs=20.0)


def test_colour_and_a_resonance_are_no_line() -> None:
    """Noise of an AR(1) of 0.9, and a resonance right at three turns, damping 0.05: no more than 1 of 40 has a line.

    Without the phase the resonance would have one.
    """
    pole = np.exp(2 * np.pi * 3 * TURN * (-0.05 + 1j))
    shapes: Sequence[list[float]] = [[1, -0.9], [1, -2 * pole.real, abs(pole) ** 2]]
    for shape in shapes:
        hits = 0
        for seed in range(40):
            white, _, angle = world(seed)
            noise = lfilter([1], shape, white, axis=0)
            hits += any(c.significant for c in azimuth_cells([noise / noise.std(axis=0)], [angle]))
        assert hits <= 1, (shape, hits)


def test_a_rotor_that_hardly_turns_has_no_orders() -> None:
    white, _, angle = world(3)
    assert azimuth_cells([white[:900]], [angle[:900]]) == []  # 18 turns
    assert azimuth_cells([white], [np.zeros(ROWS)]) == []
    fast = np.cumsum(np.full(ROWS, 2 * np.pi * 0.11))
    assert {c.place for c in azimuth_cells([white], [fast])} == {1, 2, 3}  # 0.4 of the sampling rate at the most


def test_a_gain_that_is_wrong_above_a_wind_speed_is_found_there_alone() -> None:
    """Above 14 m/s, the upper sixth, a random input has a gain of 1.2 too much to the last output: power there."""
    white, wind, angle = world(11)
    white[:, 2] += 1.2 * (wind > 14) * np.random.default_rng(0).standard_normal(ROWS)
    found = marked(maps(white, wind, angle))
    assert ("region", "power", 2, 5) in found
    assert {(name, kind, output) for name, kind, output, _ in found} == {("region", "power", 2)}


def test_an_error_that_follows_the_region_shifts_the_mean_there_alone() -> None:
    """Half a deviation below 10 m/s, the lowest sixth, in the first output."""
    white, wind, angle = world(12)
    white[:, 0] -= 0.5 * (wind < 10)
    found = maps(white, wind, angle)
    assert ("region", "mean", 0, 0) in marked(found)
    assert {(name, kind, output) for name, kind, output, _ in marked(found)} == {("region", "mean", 0)}
    cell = next(c for c in found["region"] if (c.kind, c.output, c.place) == ("mean", 0, 0))
    assert cell.value == pytest.approx(-0.42, abs=0.15)  # less the whole mean; its deviation is 0.045


def test_two_slow_signals_do_not_agree_by_chance() -> None:
    """Innovations and wind with a memory of 40 samples each, 50 recordings: samples taken as independent marked all."""
    hits = 0
    for seed in range(50):
        rng = np.random.default_rng(seed)
        bins = bins_of(wandering(rng, 40))
        assert bins is not None
        noise = np.column_stack([wandering(rng, 40) for _ in range(2)])
        hits += any(c.significant for c in region_cells(noise, [bins[1]])[0])
    assert hits <= 4, hits


def test_a_region_that_was_passed_once_says_nothing_that_the_time_does_not() -> None:
    """A ramp: what happens at one place of it happens at one time; the time is said, the region not."""
    white = world(5)[0]
    white[1200:1500] *= 2.0
    ramp = np.linspace(5.0, 15.0, ROWS)
    found = maps(white, ramp, np.zeros(ROWS))
    assert {m[0] for m in marked(found)} == {"time"}


def test_a_burst_is_found_in_its_stretches_alone() -> None:
    """Two stretches of 125 samples at three times the deviation, in all outputs: power there, and no mean anywhere."""
    white, wind, angle = world(21)
    white[1000:1250] *= 3.0
    assert marked(maps(white, wind, angle)) == {("time", "power", j, c) for j in range(OUTPUTS) for c in (8, 9)}


@pytest.mark.parametrize("factor", [1.6, 4.0])
def test_a_step_does_not_hide_itself(factor: float) -> None:
    """More power from the middle on: about each stretch's own level, as the null is, most of both halves are marked.

    About the whole level the step would be its own null, and the larger one the better hidden: 8 blocks of a stretch
    reach no more than sqrt(8) deviations.
    """
    white = world(31)[0][:, :1]
    white[1800:] *= factor
    found = [c for c in time_cells(white, stretches_of([1800, 1200]), 1) if c.significant]
    assert {c.kind for c in found} == {"power"}
    places = {c.place for c in found}
    assert len(places & set(range(14, 24))) >= 5


def test_a_drift_shifts_the_mean_of_both_ends() -> None:
    """From −0.5 to 0.5 standard deviations over the recording: the first and the last stretches, with their signs."""
    white = world(41)[0][:, :1] + np.linspace(-0.5, 0.5, ROWS)[:, None]
    cells = [c for c in time_cells(white, stretches_of([1800, 1200]), 1) if c.kind == "mean"]
    assert cells[0].significant and cells[-1].significant
    assert cells[0].value == pytest.approx(-0.48, abs=0.3) and cells[-1].value == pytest.approx(0.48, abs=0.3)


def test_no_stretch_crosses_from_one_recording_to_the_next() -> None:
    stretches = stretches_of([700, 60, 20, 900])
    starts = [0, 700, 760, 780, 1680]
    for first, stop in stretches:
        assert sum(a <= first and stop <= b for a, b in pairwise(starts)) == 1
    assert not any(760 <= first < 780 for first, _ in stretches)  # too short to have a spread
    assert sum(stop - first for first, stop in stretches) == 1660
    assert stretches_of([90]) == [] and time_cells(np.zeros((90, 1)), [], 1) == []


def test_a_channel_that_hardly_changes_has_no_regions() -> None:
    assert bins_of(np.zeros(500)) is None
    assert bins_of(np.repeat([1.0, 2.0], 250)) is None
    found = bins_of(np.repeat([1.0, 2.0, 3.0, 4.0], 125))
    assert found is not None and np.bincount(found[1]).tolist() == [125, 125, 250]
    assert region_cells(np.zeros((10, 1)), []) == []
