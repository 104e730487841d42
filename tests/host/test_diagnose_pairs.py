"""Complete pairs of recording and simulation, a simulator's run or a mock-up unit: to the verdict, good and bad."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmu_build import build_fmu
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from aeolid.cli.main import main
from aeolid.diagnose.data.rotor_frame import worth_rate
from aeolid.identify.decimate import decimate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, LAG = 0.05, 2400, 0.1
MEMORY = float(np.exp(-STEP / 0.3))  # of the unmeasured wind
GUST = 0.3 * float(np.sqrt(1 - MEMORY**2))
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


def over_a_step(lag: float) -> Array:
    """Return the transition over one sample of (q, q', d, u, w), the last two held."""
    M = np.zeros((5, 5))
    M[0, 1] = 1.0
    M[1] = [-40.0, -0.75, 2.0, 0.0, 2.0]
    M[2, 2:4] = [-1 / lag, 1 / lag] if lag else [0.0, 0.0]
    over: Array = expm(M * STEP)
    return over


def rig(u: Array, wind: Array, lag: float) -> Array:
    """Return position and speed (N, 2) of the unit's mass on a spring, the drive held and through a lag, exactly.

    q'' = 2 d + 2 w − 0.75 q' − 40 q, d' = (u − d)/lag; the unmeasured w has a memory of 0.3 s.
    """
    w = np.zeros(len(u))
    for k in range(1, len(u)):
        w[k] = MEMORY * w[k - 1] + GUST * wind[k]
    over, x, y = over_a_step(lag), np.zeros(3), np.empty((len(u), 2))
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
    assert main(["diagnose", str(case), "--out", str(out), "--sham", "0", "--allow-fmu", "--no-report"]) == 0
    loaded: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return loaded


def least_error(samples: int) -> Array:
    """Return the error of position and speed, mean square's root, of the true rig predicted so many samples ahead.

    From the state of its Kalman filter (Anderson & Moore 1979, ch. 4), the wind unknown, and the sensors' own noise.
    """
    A = over_a_step(LAG)[np.ix_([0, 1, 2, 4], [0, 1, 2, 4])]
    A[3] = [0.0, 0.0, 0.0, MEMORY]
    C, R = np.eye(4)[:2], np.diag(SENSORS**2)
    Q = np.diag([0.0, 0.0, 0.0, GUST**2])
    P, squares = solve_discrete_are(A.T, C.T, Q, R), np.zeros(2)
    for _ in range(samples):
        squares += np.diag(C @ P @ C.T + R) / samples
        P = A @ P @ A.T + Q
    return np.asarray(np.sqrt(squares))


@pytest.mark.diagnosis
@pytest.mark.parametrize("pair", KINDS)
def test_the_same_physics_lack_nothing(pair: str, tmp_path: Path) -> None:
    d = diagnose(write_case(tmp_path / "case", *KINDS[pair], lag=0.0), tmp_path / "out")
    assert d["verdict"] in ("no_mismatch", "immaterial") and d["effects"] == [], d["statement"]


@pytest.mark.diagnosis
@pytest.mark.parametrize("pair", KINDS)
def test_a_lag_that_the_simulation_leaves_out_is_named(pair: str, tmp_path: Path) -> None:
    """Its value within 10 % and four of its own standard deviations.

    With it, predictions err as those of the true rig do, give or take three deviations of what so many predictions
    can show, and without it by more than that. Where the simulation had the same wind, the sensors are all that is
    left, at most twice: in what is predicted, and in the measurements that the prediction starts from.
    """
    case = write_case(tmp_path / "case", *KINDS[pair], lag=LAG)
    d = diagnose(case, tmp_path / "out")
    assert d["verdict"] in ("named", "ambiguous") and d["effects"][0]["id"] == "actuator_lag", d["statement"]
    assert d["effects"][0]["location"]["entry"] == "input:drive"
    tau = d["effects"][0]["parameters"]["tau_s"]
    assert tau["value"] == pytest.approx(LAG, abs=min(0.1 * LAG, 4 * tau["std"]))
    assert d["sealed"]["interval"][0] > 0
    ahead, same_wind = round(d["sealed"]["horizon_s"] / STEP), KINDS[pair][1]
    sealed = np.genfromtxt(tmp_path / "out" / "sealed_before_after.csv", delimiter=",", names=True)
    chance = 3 / np.sqrt(2 * len(sealed) / ahead)  # errors of one prediction go together
    most = np.sqrt(2) if same_wind else 1 + chance
    for output, error in zip(("position", "speed"), SENSORS if same_wind else least_error(ahead), strict=True):
        least = error / np.std(sealed[f"{output}_measured"])
        assert 1 - chance < d["sealed"]["nrmse_after"][output] / least < most
        assert d["sealed"]["nrmse_before"][output] / least > most


Spoil = Callable[[Path], None]


def lines(file: str, change: Callable[[list[str]], list[str]]) -> Spoil:
    def spoil(case: Path) -> None:
        (case / file).write_text("\n".join(change((case / file).read_text().splitlines())) + "\n")

    return spoil


def column(file: str, index: int, cell: Callable[[int], str]) -> Spoil:
    def change(rows: list[str]) -> list[str]:
        cells = [r.split(",") for r in rows]
        return [rows[0], *(",".join([*c[:index], cell(k), *c[index + 1 :]]) for k, c in enumerate(cells[1:]))]

    return lines(file, change)


def in_metres(case: Path) -> None:
    build_fmu(case, "m")


RUN, UNIT = KINDS["a run with other inputs"], KINDS["a unit"]
SIMULATED, RECORDED, MUTE = "simulation.csv", "recording.csv", "not_testable"
REFUSED: dict[str, tuple[tuple[str, bool], Spoil, list[str]]] = {
    "a unit in the heading": (RUN, lines(SIMULATED, lambda r: [r[0].replace("position", "position [mm]"), *r[1:]]),
                              ["simulation.csv", "'position'", "'mm'", "'m'"]),
    "a channel less": (RUN, lines(SIMULATED, lambda r: [r[0].replace("speed", "pace"), *r[1:]]), ["'speed'"]),
    "every second sample": (RUN, lines(SIMULATED, lambda r: [r[0], *r[1::2]]), ["simulation.csv", "2 times too small"]),
    "no number of a machine": (RUN, column(SIMULATED, 2, lambda k: f"{1.4**k:.6g}"),
                               ["simulation.csv", "'position'", "sample 686", "diverged"]),
    "other times": (KINDS["a run with the same inputs"], lines(SIMULATED, lambda r: r[:700]),
                    ["simulation.csv", "699 samples", "same times"]),
}  # fmt: skip
ENDED: dict[str, tuple[tuple[str, bool], Spoil, str, list[str]]] = {
    "unit in another unit": (UNIT, in_metres, "data_fault", ["oscillator.fmu", "drive", "'m'", "'V'"]),
    "unit without an input": (UNIT, column(RECORDED, 1, lambda k: "" if k == 99 else "1"), MUTE,
                              ["drive", "sample 100"]),
    "short simulation": (RUN, lines(SIMULATED, lambda r: r[:60]), MUTE, ["simulation.csv", "59 samples"]),
    "short recording": (RUN, lines(RECORDED, lambda r: r[:120]), MUTE, ["119 samples"]),
    "diverging simulation": (RUN, column(SIMULATED, 2, lambda k: f"{1.2**k:.6g}"), MUTE,
                             ["simulation.csv", "diverges", "position"]),
    "constant simulated output": (RUN, column(SIMULATED, 2, lambda k: "0"), MUTE, ["position", "constant"]),
    "constant simulated input": (RUN, column(SIMULATED, 1, lambda k: "1"), MUTE, ["drive", "constant"]),
    "constant input": (RUN, column(RECORDED, 1, lambda k: "1"), MUTE, ["No input", "excitation"]),
    "constant input of a unit": (UNIT, column(RECORDED, 1, lambda k: "1"), MUTE, ["No input"]),
}  # fmt: skip


@pytest.mark.parametrize("bad", REFUSED)
def test_a_simulation_that_does_not_fit_is_one_sentence(
    bad: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pair, spoil, words = REFUSED[bad]
    case = write_case(tmp_path / "case", *pair, lag=0.0, samples=800)
    spoil(case)
    assert main(["diagnose", str(case), "--out", str(tmp_path / "out"), "--sham", "0"]) == 3
    *progress, message = capsys.readouterr().err.strip().splitlines()
    assert all(re.fullmatch(r"\d+ s: .*|.*recording\.csv: 800 samples.*|", line) for line in progress), progress
    assert message.startswith("aeolid: ") and all(w in message for w in words), message


@pytest.mark.diagnosis
@pytest.mark.parametrize("bad", ENDED)
def test_what_cannot_be_tested_ends_in_a_verdict(bad: str, tmp_path: Path) -> None:
    pair, spoil, verdict, words = ENDED[bad]
    case = write_case(tmp_path / "case", *pair, lag=0.0, samples=800)
    spoil(case)
    d = diagnose(case, tmp_path / "out")
    assert d["verdict"] == verdict and d["effects"] == [], d["statement"]
    assert all(w in d["statement"] for w in words), d["statement"]


SLOW = """[parameters]
T = { value = 2000.0, min = 1.0, max = 1e5, unit = "s", free = true }
[[state]]
name = "x"
derivative = "(drive - x)/T"
initial = { value = 0.0, free = true }
unit = "m"
[[output]]
name = "position"
equation = "x"
unit = "m"
"""


@pytest.mark.diagnosis
def test_a_recording_shorter_than_the_slowest_time_constant_tests_nothing(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", *RUN, lag=0.0, samples=800)
    (case / "model.toml").write_text(SLOW)
    text = (case / "case.toml").read_text().replace('"run"', '"equations"').replace("simulation.csv", "model.toml")
    (case / "case.toml").write_text(text.replace("same_inputs = false\n", ""))
    rng = np.random.default_rng(1)
    u = drive(800, rng)
    x = np.concatenate([[0.0], np.cumsum(u[:-1] * STEP / 2000.0 + 1e-4 * rng.standard_normal(799))])
    write(case / "recording.csv", u, np.column_stack([x, x]) + 1e-3 * rng.standard_normal((800, 2)))
    d = diagnose(case, tmp_path / "out")
    assert d["verdict"] == "not_testable" and "40 s" in d["statement"] and "2000 s" in d["statement"], d["statement"]


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_held_inputs_are_read_in_the_middle_of_the_longer_sample(factor: int) -> None:
    """A slow sine, and 60 dB of stop band: the input's value half the longer sample less half a short one later."""
    t = STEP * np.arange(1000)
    channels = (Channel("u", "V", "input"), Channel("y", "m", "output"))
    wave = np.sin(0.9 * t)
    slow = decimate(Record(t, np.column_stack([wave, wave]), channels, STEP, "test", ""), factor, centred=True)
    np.testing.assert_allclose(slow.column("y"), np.sin(0.9 * slow.time_s), atol=2e-3)
    np.testing.assert_allclose(slow.column("u"), np.sin(0.9 * (slow.time_s + (factor - 1) / 2 * STEP)), atol=2e-3)
    assert slow.sample_time_s == pytest.approx(factor * STEP)


@pytest.mark.parametrize("hertz", [0.3, 0.7])
def test_a_run_keeps_six_samples_a_period_of_its_fastest_content(hertz: float) -> None:
    """Of a wave the spectrum is a line two bins of 0.01 Hz wide. What has a hundredth of the power sets no rate."""
    t = STEP * np.arange(20_000)
    y = np.sin(2 * np.pi * hertz * t) + 0.1 * np.sin(2 * np.pi * 3.0 * t)
    found = worth_rate(Record(t, y[:, None], (Channel("y", "m", "output"),), STEP, "test", ""))
    assert 1 / (6 * (hertz + 0.02) * STEP) - 1 <= found <= 1 / (6 * (hertz - 0.02) * STEP)
