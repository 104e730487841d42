"""A tower's mode that both sides have at different frequencies, on made turbines in wind and waves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from test_run_standing_out import CONTEXT, FIT, SAMPLES, STEP, TOWER, swung, turbine

from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.displaced import displaced_of
from aeolid.diagnose.run_prior.modal import Modal, compare_modes
from aeolid.diagnose.run_prior.standing import Standing, standing_of
from aeolid.record import Record


def told(recording: Record, run: Record) -> Standing | None:
    pair = pair_of([recording], [run], CONTEXT)
    return displaced_of(pair, compare_modes(pair, CONTEXT), CONTEXT, FIT)


def in_waves(made: Record, hz: float, height: float, seed: int) -> Record:
    """Return a turbine whose tower waves of a narrow band about hz move fore and aft."""
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    pole = np.exp((-0.1 + 1j) * 2 * np.pi * hz * STEP)
    waves = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], noise)
    values = made.values.copy()
    values[:, 2] += swung(height * waves / waves.std(), TOWER[0], TOWER[1])
    return replace(made, values=values)


def test_a_tower_that_sways_far_too_quickly_lacks_bending_and_one_a_little_off_is_stiffer() -> None:
    missing = told(turbine(1), turbine(2, 1.4 * TOWER[0]))
    assert missing is not None and missing.own
    assert missing.entries[0].startswith("tower_") and "stiffness_change" in missing.entries
    share = {"tower_fore_aft": 1.0, "tower_side_side": 0.95}[missing.entries[0]]
    value, deviation = missing.told["stiffness_change"]["frequency_hz"]
    assert value == pytest.approx(share * TOWER[0], abs=3 * deviation)
    slower = told(turbine(1), turbine(2, 0.8 * TOWER[0]))  # bending that a simulation leaves out makes it no slower
    assert slower is not None and slower.entries[0] == "stiffness_change"


def test_what_is_at_one_frequency_is_not_displaced() -> None:
    """Other wind, an imbalance, a tower without the other's mode, a stiffness three per cent off."""
    for recording, run in (
        (turbine(3), turbine(2)), (turbine(5, line=3.0), turbine(2)), (turbine(1), turbine(2, 0.0)),
        (turbine(1), turbine(2, 1.03 * TOWER[0])),
    ):  # fmt: skip
        assert told(recording, run) is None


def test_another_sea_is_no_other_tower() -> None:
    """Power rises at the waves of one side and falls at those of the other; the tower's mode stays."""
    recording, run = in_waves(turbine(1), 0.09, 0.5, 7), in_waves(turbine(2), 0.15, 0.5, 8)
    assert told(recording, run) is None
    both = in_waves(turbine(2, 1.4 * TOWER[0]), 0.15, 0.5, 8)
    found = told(recording, both)
    assert found is not None and found.entries[0].startswith("tower_")


def test_waves_of_two_seas_are_no_tower() -> None:
    """Swell and a wind sea, were they as sharp as modes: below the rotor's frequency nothing is told."""
    recording, run = in_waves(turbine(1, 0.0), 0.09, 2.0, 7), in_waves(turbine(2, 0.0), 0.14, 2.0, 8)
    pair = pair_of([recording], [run], CONTEXT)
    modes = compare_modes(pair_of([turbine(1)], [turbine(2)], CONTEXT), CONTEXT).recorded
    tower = next(m for m in modes if max(m.shares, key=lambda n: m.shares[n]) == "tower_acc_fore_aft")
    sharp = [replace(tower, frequency_hz=hz, frequency_std_hz=0.001, damping=0.05) for hz in (0.09, 0.14)]
    modal = Modal((sharp[0],), (sharp[1],), ())
    assert displaced_of(pair, modal, CONTEXT, FIT) is None
    slow = CONTEXT | {"rated_speed_rad_s": 0.45}  # of a rotor so slow both lie where its tower swings
    assert displaced_of(pair, modal, slow, FIT) is not None


def test_levels_come_first_and_errors_alone_last() -> None:
    """Where nothing separates the sides it is not asked; where nothing else tells it comes before errors alone."""
    pair = pair_of([turbine(1)], [turbine(2, 1.4 * TOWER[0])], CONTEXT)
    moved = dict.fromkeys(pair.shown, 2.0)
    asked: list[int] = []

    def displaced() -> Standing | None:
        asked.append(1)
        return displaced_of(pair, compare_modes(pair, CONTEXT), CONTEXT, FIT)

    records = [turbine(1)], [turbine(2, 1.4 * TOWER[0])]
    (found,) = standing_of(pair, *records, CONTEXT, moved, True, displaced=displaced)
    assert found.entries[0].startswith("tower_")
    standing_of(pair, *records, CONTEXT, moved, False, displaced=displaced)
    assert asked == [1]


def test_short_sides_other_machines_and_unknown_modes_end_without_an_answer() -> None:
    long, run = turbine(1), turbine(2, 1.4 * TOWER[0])
    pair = pair_of([long], [run], CONTEXT)
    modal = compare_modes(pair, CONTEXT)
    assert displaced_of(pair, modal, {"machine": "pump"}, FIT) is None
    assert displaced_of(pair, Modal((), (), ()), CONTEXT, FIT) is None
    short = replace(long, values=long.values[:3000], time_s=long.time_s[:3000])
    assert displaced_of(pair_of([short], [run], CONTEXT), modal, CONTEXT, FIT) is None
