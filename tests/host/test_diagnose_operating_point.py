"""Gains that follow a recorded operating point, on machines that are no turbine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.conclude import conclude
from aeolid.diagnose.data.case import load_case

Array = NDArray[np.float64]
STEP, SAMPLES, DELAY = 2.0, 1500, 12.0  # s, rows, s of the steam's way through the header
EDGE, LESS = 60.0, 0.4  # % of load, share of the spray's action that is lost above it
ENTRIES = ("aero_nonlinearity", "operating_region_switch")
CHANNELS = (("spray", "%", "input"), ("steam", "K", "output"))
MODEL = f"""[model]
name = "header"
time = "continuous"
[parameters]
k = {{ value = 0.9, unit = "K/%", min = 0.2, max = 4.0, free = true }}
tau = {{ value = {DELAY}, unit = "s", min = 3.0, max = 50.0, free = true }}
[[input]]
name = "spray"
unit = "%"
[[state]]
name = "T"
unit = "K"
derivative = "(-k*spray - T)/tau"
[[output]]
name = "steam"
unit = "K"
equation = "T"
"""


def sprayed(less: float) -> Array:
    """Simulate spray, steam and load (N, 3) of a header that is sprayed about its working point, exactly row by row."""
    rng = np.random.default_rng(3)
    spray = np.repeat(6.0 * rng.standard_normal(SAMPLES // 10), 10)
    load = np.repeat(rng.uniform(20.0, 95.0, SAMPLES // 50), 50)
    fade, steam = np.exp(-STEP / DELAY), np.zeros(SAMPLES)
    for i in range(SAMPLES - 1):
        acts = -0.9 * spray[i] * (1 - less * (load[i] > EDGE)) + 0.3 * rng.standard_normal()
        steam[i + 1] = fade * steam[i] + (1 - fade) * acts
    return np.column_stack([spray, steam + 0.02 * rng.standard_normal(SAMPLES), load])


@pytest.mark.parametrize(("role", "offered"), [("scheduling", True), ("ignore", False)])
def test_who_records_an_operating_point_is_asked_whether_gains_follow_it(
    role: str, offered: bool, tmp_path: Path
) -> None:
    channels = (*CHANNELS, ("load", "%", role))
    asked = {a.key for a in prepare(load_case(write_case(tmp_path, MODEL, STEP, channels, sprayed(0.0)))).hypotheses}
    assert all((f"{entry} input:spray on load" in asked) == offered for entry in ENTRIES)


@pytest.mark.diagnosis
@pytest.mark.parametrize("less", [LESS, 0.0])
def test_a_gain_that_switches_under_load_is_named_with_its_threshold(less: float, tmp_path: Path) -> None:
    channels = (*CHANNELS, ("load", "%", "scheduling"))
    case = load_case(write_case(tmp_path, MODEL, STEP, channels, sprayed(less)))
    diagnosis, _ = conclude(case, tmp_path / "out", sham=0, seed=0, progress=lambda text, share: None)
    if not less:
        assert diagnosis["verdict"] in ("no_mismatch", "immaterial")
        return
    assert diagnosis["verdict"] == "named" and [e["id"] for e in diagnosis["effects"]] == ["operating_region_switch"]
    told = diagnosis["effects"][0]["parameters"]
    assert abs(told["gain_change"]["value"] + less) < max(3 * told["gain_change"]["std"], 0.02)
    assert abs(told["threshold"]["value"] - EDGE) < 4.0  # loads lie apart by that much
