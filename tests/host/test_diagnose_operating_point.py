"""Gains that follow a recorded operating point, on machines that are no turbine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.conclude import conclude
from aeolid.diagnose.data.case import load_case

Array = NDArray[np.float64]
STEP, SAMPLES, FINE = 0.05, 2000, 20
EDGE, LESS = 60.0, 0.4  # % of load, share of the push that is lost above it
ENTRIES = ("aero_nonlinearity", "operating_region_switch")


def pushed(less: float) -> Array:
    """Simulate push, position, speed and load (N, 4) of a swing whose drive gives less under load."""
    rng = np.random.default_rng(3)
    push = np.repeat(4.0 * rng.standard_normal(SAMPLES // 10), 10)
    load = np.repeat(rng.uniform(20.0, 95.0, SAMPLES // 50), 50)
    q = v = 0.0
    rows = np.empty((SAMPLES, 4))
    for i in range(SAMPLES):
        rows[i] = push[i], q, v, load[i]
        acts = push[i] * (1 - less * (load[i] > EDGE)) + 0.2 * rng.standard_normal()
        for _ in range(FINE):
            v += STEP / FINE * (acts - v - 40.0 * q)
            q += STEP / FINE * v
    rows[:, 1:3] += rng.standard_normal((SAMPLES, 2)) * (1e-3, 5e-3)
    return rows


@pytest.mark.parametrize(("role", "offered"), [("scheduling", True), ("ignore", False)])
def test_who_records_an_operating_point_is_asked_whether_gains_follow_it(
    role: str, offered: bool, tmp_path: Path
) -> None:
    channels = (*SWING_CHANNELS, ("load", "%", role))
    asked = {a.key for a in prepare(load_case(write_case(tmp_path, SWING, STEP, channels, pushed(0.0)))).hypotheses}
    assert all((f"{entry} input:push on load" in asked) == offered for entry in ENTRIES)


@pytest.mark.diagnosis
@pytest.mark.parametrize("less", [LESS, 0.0])
def test_a_gain_that_switches_under_load_is_named_with_its_threshold(less: float, tmp_path: Path) -> None:
    channels = (*SWING_CHANNELS, ("load", "%", "scheduling"))
    case = load_case(write_case(tmp_path, SWING, STEP, channels, pushed(less)))
    diagnosis, _ = conclude(case, tmp_path / "out", sham=0, seed=0, progress=lambda text, share: None)
    if not less:
        assert diagnosis["verdict"] in ("no_mismatch", "immaterial")
        return
    assert diagnosis["verdict"] == "named" and [e["id"] for e in diagnosis["effects"]] == ["operating_region_switch"]
    told = diagnosis["effects"][0]["parameters"]
    assert abs(told["gain_change"]["value"] + less) < max(3 * told["gain_change"]["std"], 0.02)
    assert abs(told["threshold"]["value"] - EDGE) < 4.0  # loads lie apart by that much
