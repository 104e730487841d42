"""Complete pairs of recording and simulation, a simulator's run or a mock-up unit: to the verdict."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmu_build import build_fmu
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.cli.main import main

Array = NDArray[np.float64]
STEP, SAMPLES, LAG = 0.05, 2400, 0.1
SENSORS = np.array([2e-3, 1e-2])  # m, m/s: some hundredths of what they measure
ROLES = """[recording]
sample_time_s = 0.05
time = "time_s"
[[channel]]
name = "drive"
unit = "V"
role = "input"
[[channel]]
name = "position"
unit = "m"
role = "output"
[[channel]]
name = "speed"
unit = "m/s"
role = "output"
"""
KINDS = {
    "a run with other inputs": ("run", False),
    "a run with the same inputs": ("run", True),
    "a unit": ("fmu", False),
}


def rig(u: Array, wind: Array, lag: float) -> Array:
    """Return position and speed (N, 2) of the unit's mass on a spring, the drive held and through a lag, exactly.

    q'' = 2 d + 2 w − 0.75 q' − 40 q, d' = (u − d)/lag; the unmeasured w has a memory of 0.3 s.
    """
    a, w = np.exp(-STEP / 0.3), np.zeros(len(u))
    for k in range(1, len(u)):
        w[k] = a * w[k - 1] + 0.3 * np.sqrt(1 - a * a) * wind[k]
    M = np.zeros((5, 5))  # (q, q', d, u, w)
    M[0, 1] = 1.0
    M[1] = [-40.0, -0.75, 2.0, 0.0, 2.0]
    M[2, 2:4] = [-1 / lag, 1 / lag] if lag else [0.0, 0.0]
    over, x, y = expm(M * STEP), np.zeros(3), np.empty((len(u), 2))
    for k, held in enumerate(u):
        x[2] = x[2] if lag else held
        y[k] = x[:2]
        x = (over @ np.array([*x, held, w[k]]))[:3]
    return y


def drive(samples: int, rng: np.random.Generator) -> Array:
    result: Array = np.repeat(rng.choice([-1.0, 1.0], samples // 4 + 1), 4)[:samples]
    return result


def write(path: Path, u: Array, y: Array) -> None:
    with open(path, "w", newline="") as handle:
        writer = csv.writer(handle)
        writer.writerow(["time_s", "drive", "position", "speed"])
        rows = np.column_stack([STEP * np.arange(len(u)), u, y])
        writer.writerows([[f"{v:.9g}" for v in row] for row in rows])


def write_case(folder: Path, kind: str, same: bool, lag: float, samples: int = SAMPLES) -> Path:
    """Write recording, simulation, roles and case.toml; a simulation of the same inputs had the same wind."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    u, wind = drive(samples, rng), rng.standard_normal(samples)
    write(folder / "recording.csv", u, rig(u, wind, lag) + SENSORS * rng.standard_normal((samples, 2)))
    if kind == "fmu":
        build_fmu(folder)
    elif same:
        write(folder / "simulation.csv", u, rig(u, wind, 0.0))
    else:
        u, wind = drive(samples, rng), rng.standard_normal(samples)
        write(folder / "simulation.csv", u, rig(u, wind, 0.0) + SENSORS * rng.standard_normal((samples, 2)))
    (folder / "roles.toml").write_text(ROLES)
    file, more = ("oscillator.fmu", "") if kind == "fmu" else ("simulation.csv", f"same_inputs = {str(same).lower()}\n")
    (folder / "case.toml").write_text(
        f'[case]\ntitle = "pair"\n[recordings]\nfiles = ["recording.csv"]\nroles = "roles.toml"\n'
        f'[baseline]\nkind = "{kind}"\nfile = "{file}"\n{more}'
    )
    return folder


def diagnose(case: Path, out: Path) -> dict[str, Any]:
    assert main(["diagnose", str(case), "--out", str(out), "--sham", "0"]) == 0
    loaded: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return loaded


@pytest.mark.parametrize("pair", KINDS)
def test_the_same_physics_lack_nothing(pair: str, tmp_path: Path) -> None:
    d = diagnose(write_case(tmp_path / "case", *KINDS[pair], lag=0.0), tmp_path / "out")
    assert d["verdict"] in ("no_mismatch", "immaterial") and d["effects"] == [], d["statement"]


@pytest.mark.parametrize("pair", KINDS)
def test_a_lag_that_the_simulation_leaves_out_is_named(pair: str, tmp_path: Path) -> None:
    """Its value within 10 % and four of its own standard deviations."""
    d = diagnose(write_case(tmp_path / "case", *KINDS[pair], lag=LAG), tmp_path / "out")
    assert d["verdict"] in ("named", "ambiguous") and d["effects"][0]["id"] == "actuator_lag", d["statement"]
    assert d["effects"][0]["location"]["entry"] == "input:drive"
    tau = d["effects"][0]["parameters"]["tau_s"]
    assert tau["value"] == pytest.approx(LAG, abs=min(0.1 * LAG, 4 * tau["std"]))
    assert d["sealed"]["interval"][0] > 0
    for output in ("position", "speed"):
        assert d["sealed"]["nrmse_after"][output] < 0.6 * d["sealed"]["nrmse_before"][output]
