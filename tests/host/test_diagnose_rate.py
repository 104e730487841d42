"""A slow model's rows lie far apart; what is faster than they show must be found all the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.resample import finer
from aeolid.diagnose.pipeline import Study, study

STEP, MOTOR, LOAD, SHAFT, TWISTING = 0.02, 0.6, 1.4, 90.0, 0.5  # s, kg m², kg m², N m, N m s
MODEL = """\
[model]
name = "motor and load, one body"
time = "continuous"
[parameters]
g = { value = 2.0, unit = "N m/V" }
b = { value = 0.25, unit = "N m s", min = 0.025, max = 2.0, free = true }
J = { value = 2.0, unit = "kg m^2", min = 0.6, max = 6.0, free = true }
[[state]]
name = "w"
unit = "rad/s"
derivative = "(g*voltage - b*w)/J"
initial = { value = 0.0, free = true }
[[output]]
name = "speed"
unit = "rad/s"
equation = "w"
"""
ROLES = """\
[recording]
time = "time_s"
[[channel]]
name = "voltage"
unit = "V"
role = "input"
[[channel]]
name = "speed"
unit = "rad/s"
role = "output"
"""
CASE = """\
[case]
title = "a shaft that twists"
[recordings]
files = ["recording.csv"]
roles = "roles.toml"
[baseline]
kind = "equations"
file = "model.toml"
"""
FREQUENCY = np.sqrt(SHAFT * (1 / MOTOR + 1 / LOAD)) / (2 * np.pi)  # 2.3 Hz
STIFF = 3.0  # times the shaft's stiffness: 4.0 Hz, which rows 0.2 s apart fold to 1.0 Hz


def written(folder: Path, shaft: float) -> Path:
    """Write 120 s of a motor (w1), a shaft (twist) and a load (w2) that a random torque brakes."""
    A = np.array(
        [
            [-(0.25 + TWISTING) / MOTOR, TWISTING / MOTOR, -shaft / MOTOR],
            [TWISTING / LOAD, -TWISTING / LOAD, shaft / LOAD],
            [1.0, -1.0, 0.0],
        ]
    )
    B = np.array([[2.0 / MOTOR, 0.0], [0.0, 1.0 / LOAD], [0.0, 0.0]])
    A, B, *_ = cont2discrete((A, B, np.eye(3), np.zeros((3, 2))), STEP)
    rng = np.random.default_rng(4)
    n = 6000
    u = np.column_stack([np.repeat(rng.choice([-1.0, 1.0], n // 50), 50), 0.3 * rng.standard_normal(n)])
    x, speed = np.zeros(3), np.empty(n)
    for k in range(n):
        speed[k] = x[0] + 0.01 * rng.standard_normal()
        x = A @ x + B @ u[k]
    for name, text in (("model.toml", MODEL), ("roles.toml", ROLES), ("case.toml", CASE)):
        (folder / name).write_text(text)
    table = np.column_stack([STEP * np.arange(n), u[:, 0], speed])
    np.savetxt(folder / "recording.csv", table, "%.9g", ",", header="time_s,voltage,speed", comments="")
    return folder


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the recording of the shaft as it is."""
    return written(tmp_path_factory.mktemp("rate"), SHAFT)


@pytest.fixture(scope="module")
def found(case: Path) -> Study:
    """Return the study of the recording."""
    return study(load_case(case), sham=0, seed=0, progress=lambda text, share: None)


def test_the_rows_of_a_slow_model_do_not_show_the_mode(case: Path) -> None:
    """Else what follows tests nothing: ten samples a row, up to 2 Hz."""
    coarse = prepare(load_case(case))
    assert coarse.decimation == 10
    assert 0.4 / (coarse.decimation * STEP) < FREQUENCY


@pytest.mark.slow
def test_a_mode_beyond_the_rows_is_found_at_a_finer_rate(found: Study) -> None:
    """It was `unnamed`, for 6,562 nats of a challenge's recording."""
    assert found.prepared.decimation == 1
    assert found.winner is not None
    values = found.winner.values["structural_mode output:speed"]
    frequency, deviation = values["frequency_hz"]
    assert frequency == pytest.approx(FREQUENCY, rel=0.02)  # 2.33 Hz; noise alone moves it by less than a hundredth
    assert 0 < deviation < 0.02 * FREQUENCY
    assert found.proof is not None and found.proof.interval[0] > 0


@pytest.mark.slow
def test_a_mode_that_the_rows_fold_is_found_at_a_finer_rate(tmp_path: Path) -> None:
    """No candidate of the first look runs to the end of its band; torsion of a rotor at 2.2 Hz was `immaterial`."""
    stiff = study(load_case(written(tmp_path, STIFF * SHAFT)), sham=0, seed=0, progress=lambda text, share: None)
    assert stiff.winner is not None
    frequency, _ = stiff.winner.values["structural_mode output:speed"]["frequency_hz"]
    assert frequency == pytest.approx(np.sqrt(STIFF) * FREQUENCY, rel=0.02)
    assert stiff.proof is not None and stiff.proof.interval[0] > 0


def test_each_look_is_finer_than_the_last() -> None:
    for factor in (100, 39, 16, 15, 4, 2):
        assert 1 <= finer(factor) <= factor / 2
    assert finer(16) == 4
    assert finer(15) == 1  # a factor below four loses more samples than it gains


PULL = """\
[[output]]
name = "pull"
unit = "N m"
equation = "torque"
"""


@pytest.mark.parametrize(("pulled", "rows"), [(False, 4), (True, 1)])
def test_what_follows_an_input_at_once_is_shown_by_every_row(tmp_path: Path, pulled: bool, rows: int) -> None:
    """A tower's mode at 0.31 Hz in a load that the model reads off a torque, beside a rotor of 11 s: rows 0.8 s apart.

    There a rate limit was as good (57 nats, and named); at the recording's own rate the mode has 493 sealed ones.
    """
    through = '[[auxiliary]]\nname = "torque"\nequation = "g*voltage"\n'
    model = MODEL.replace('name = "motor and load', 'name = "rotor').replace("[[state]]", through + "[[state]]", 1)
    (tmp_path / "model.toml").write_text(
        model.replace('value = 2.0, unit = "kg', 'value = 5.5, unit = "kg') + PULL * pulled
    )
    roles = ROLES + PULL.replace("[[output]]", "[[channel]]").replace('equation = "torque"', 'role = "output"') * pulled
    (tmp_path / "roles.toml").write_text(roles)
    (tmp_path / "case.toml").write_text(CASE)
    rng = np.random.default_rng(3)
    volts = np.repeat(rng.standard_normal(300), 10)
    columns = [STEP * 25 * np.arange(3000), volts, rng.standard_normal(3000), *([rng.standard_normal(3000)] * pulled)]
    head = "time_s,voltage,speed" + ",pull" * pulled
    np.savetxt(tmp_path / "recording.csv", np.column_stack(columns), delimiter=",", header=head, comments="")
    assert prepare(load_case(tmp_path)).decimation == rows
