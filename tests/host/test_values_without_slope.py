"""Values of an effect that act on few rows are found where no slope leads to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.refit import begin
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.scoring.scores import score_bank

STEP, LIMIT = 0.02, 9.0


@pytest.mark.parametrize("rare", [1, 4])
def test_the_limit_that_a_drive_hardly_reaches_is_found_beside_the_other(tmp_path: Path, rare: int) -> None:
    """Commands from -16 to 8 and a few of 14 in the first half: the upper limit stood beyond all commands."""
    rng = np.random.default_rng(rare)
    level = rng.uniform(-16, 8, 300)
    level[rng.choice(90, rare, replace=False)] = 14.0
    level[rng.choice(np.arange(200, 300), 30, replace=False)] = 14.0
    push = np.repeat(level, 10)
    values = np.column_stack([np.clip(push, -LIMIT, LIMIT), np.zeros((3000, 2))])
    (tmp_path / "clean").mkdir()
    (tmp_path / "seen").mkdir()
    clean = load_case(write_case(tmp_path / "clean", SWING, STEP, SWING_CHANNELS, values))
    y = clean.baseline.simulate(clean.records[0])  # type: ignore[union-attr]
    y = y + 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
    seen = load_case(write_case(tmp_path / "seen", SWING, STEP, SWING_CHANNELS, np.column_stack([push, y])))
    stage = prepare(seen)
    drives = [a for a in stage.hypotheses if a.entry == "input_saturation"]
    (found,) = fit_rows(stage, score_bank(stage, drives, 1).rows)
    for name, limit in (("low", -LIMIT), ("high", LIMIT)):
        value, std = found.values[drives[0].key][name]
        assert abs(value - limit) < 3 * std < 0.1 * LIMIT


def test_one_fit_begins_where_a_sensor_s_values_pile_up(tmp_path: Path) -> None:
    """All else is fitted first: free from the first step on a limit went aside with it, 75 nats short."""
    rng = np.random.default_rng(5)
    push = np.repeat(rng.uniform(-12, 8, 200), 10)
    (tmp_path / "clean").mkdir()
    (tmp_path / "seen").mkdir()
    values = np.column_stack([push, np.zeros((2000, 2))])
    clean = load_case(write_case(tmp_path / "clean", SWING, STEP, SWING_CHANNELS, values))
    y = clean.baseline.simulate(clean.records[0])  # type: ignore[union-attr]
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    y[:, 1] = np.maximum(y[:, 1], np.quantile(y[:, 1], 0.05))
    seen = load_case(write_case(tmp_path / "seen", SWING, STEP, SWING_CHANNELS, np.column_stack([push, y])))
    stage = prepare(seen)
    (sensor,) = (a for a in stage.hypotheses if a.entry == "sensor_saturation")
    only = stage.only((sensor,))
    begun = begin(only, only.fit, score_bank(stage, [sensor], 1).rows)
    assert begun is not None
    low = only.extended.index(sensor.slots[0].name)
    assert [float(point.theta[low]) for _, point in begun.found].count(sensor.grid[0][sensor.slots[0].name]) == 1


def test_a_stop_that_nothing_touches_stands_where_it_never_acts(tmp_path: Path) -> None:
    """At the edge of the fitted data, where fits begin, it would act on all that goes further."""
    rng = np.random.default_rng(7)
    push = np.repeat(rng.uniform(-10, 16, 200), 10)
    stopped = SWING.replace("(push - c*v - k*q)/m", "(push - c*v - k*q - 4e3*max(q - 0.4, 0)*max(1 + 0.8*v, 0))/m")
    (tmp_path / "clean").mkdir()
    (tmp_path / "seen").mkdir()
    values = np.column_stack([push, np.zeros((2000, 2))])
    clean = load_case(write_case(tmp_path / "clean", stopped, STEP, SWING_CHANNELS, values))
    y = clean.baseline.simulate(clean.records[0])  # type: ignore[union-attr]
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    seen = load_case(write_case(tmp_path / "seen", SWING, STEP, SWING_CHANNELS, np.column_stack([push, y])))
    stage = prepare(seen)
    (stop,) = (a for a in stage.hypotheses if a.entry == "end_stop")
    (found,) = fit_rows(stage, score_bank(stage, [stop], 1).rows)
    told = found.values[stop.key]
    assert told["low_stop"][0] == next(s.idle for s in stop.slots if s.label == "low_stop")
    for label, value in (("high_stop", 0.4), ("stop_stiffness", 4e3), ("stop_loss", 0.8)):
        assert abs(told[label][0] - value) < 4 * told[label][1] < value, label
    assert "a stop at 0.4 m bounds the motion" in found.says(stop)
