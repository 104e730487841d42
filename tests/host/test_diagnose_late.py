"""Inputs that act late by many rows, early by some, or go on between them in a loop: each told as what it is."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.sampling_choice import choice_of
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.selection.first_effect import First, find_first
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, ROWS, FINE = 0.2, 1200, 20
ROTOR = """
[model]
name = "rotor"
time = "continuous"
[parameters]
J = { value = 5.5, min = 1.0, max = 30.0, free = true }
p = { value = 0.95, min = 0.2, max = 5.0, free = true }
[[state]]
name = "om"
derivative = "(p*wind - torque)/J"
initial = { value = 1.0, free = true }
unit = "rad/s"
[[output]]
name = "speed"
equation = "om"
unit = "rad/s"
"""


def smooth_wind(rng: np.random.Generator, lead_s: float = 0.0) -> Array:
    """Return wind at every fine step, of sines up to a third of a hertz, as it comes `lead_s` later."""
    time = STEP / FINE * np.arange(ROWS * FINE) + lead_s
    tones = rng.uniform(0.003, 0.33, 40)
    return 5 + np.asarray(
        np.sin(2 * np.pi * np.outer(time, tones) + rng.uniform(0, 6.28, 40)).sum(axis=1) / np.sqrt(20)
    )


def recorded(rng: np.random.Generator, *, filtered_s: float = 0.0, ahead_s: float = 0.0) -> Case:
    """Return a rotor under a torque that answers its speed and is held, in wind that goes on.

    filtered_s: time constant of the speed's sensor; ahead_s: by how much the mast feels the wind earlier.
    """
    seed = int(rng.integers(1 << 30))
    wind, dither = smooth_wind(np.random.default_rng(seed)), np.repeat(rng.choice([-0.4, 0.4], ROWS // 9 + 1), 9)[:ROWS]
    om, shown, rows = 1.0, 1.0, []
    for k in range(ROWS):
        torque = 4.5 + 2.0 * (om - 1.0) + dither[k] + 0.1 * rng.standard_normal()
        rows.append([torque, shown if filtered_s else om])
        for j in range(FINE):
            om += STEP / FINE * (wind[k * FINE + j] - torque) / 6.0
            shown += STEP / FINE * (om - shown) / filtered_s if filtered_s else 0.0
    values = np.array(rows)
    mast = smooth_wind(np.random.default_rng(seed), ahead_s)[::FINE]
    speed = values[:, 1] + 0.01 * values[:, 1].std() * rng.standard_normal(ROWS)
    channels = (
        Channel("torque", "kN m", "input"), Channel("wind", "m/s", "disturbance"), Channel("speed", "rad/s", "output"),
    )  # fmt: skip
    record = Record(STEP * np.arange(ROWS), np.column_stack([values[:, 0], mast, speed]), channels, STEP, "a.csv", "")
    model = equations_file.from_toml(tomllib.loads(ROTOR), ROTOR, "rotor.toml")
    return Case("rotor", (record,), "equations", model, "rotor.toml", "", {"closed_loop": True}, Path())


def found_in(case: Case) -> tuple[First, str, dict[str, tuple[float, float]]]:
    first = find_first(case, 1, lambda name, share: lambda: None)
    assert first.winner is not None
    ((attachment,),) = (first.winner.attachments,)
    return first, attachment.entry, dict(first.winner.values[attachment.key])


def test_in_a_loop_a_measured_disturbance_may_move_and_a_command_may_not() -> None:
    """A controller's answer may not foretell its own row; the wind answers nobody."""
    case = recorded(np.random.default_rng(0))
    choice = choice_of(case, prepare(case))
    assert choice.moving == ("wind",)
    assert [place for place, _ in choice.kinds] == [prepare(case).site.input_names.index("torque")]


def test_a_filter_of_the_speed_is_told_beside_a_wind_that_goes_on() -> None:
    """Read as held, the wind is half a row late, and the filter was told half a row too quick."""
    case = recorded(np.random.default_rng(1), filtered_s=0.5)
    first, entry, values = found_in(case)
    assert entry == "sensor_lag"
    assert dict(first.prepared.sampling.holds)["wind"] != "zoh" == dict(first.prepared.sampling.holds)["torque"]
    assert values["tau_s"][0] == pytest.approx(0.5, abs=0.3 * STEP)


def test_a_wind_that_the_mast_feels_many_rows_earlier_is_a_dead_time() -> None:
    """Forty rows: the score at none knows nothing of it, and starts ended at 13."""
    case = recorded(np.random.default_rng(0), ahead_s=8.0)
    _, entry, values = found_in(case)
    assert entry == "transport_delay"
    assert values["delay_s"][0] == pytest.approx(8.0, abs=STEP)


def motor(rng: np.random.Generator, most: float = np.inf, early: int = 0) -> Case:
    """Return a motor with a brake; most: voltage of its drive; early: rows by which the inputs are written late."""
    rows, step = 1200, 0.02
    text = ROTOR.replace("p*wind - torque", "p*volt - 4*om - brake")
    model = equations_file.from_toml(tomllib.loads(text), text, "motor.toml")
    signals = {
        "volt": np.repeat(rng.uniform(3, 12, rows // 12), 12), "brake": np.repeat(rng.uniform(0, 4, rows // 25), 25)
    }  # fmt: skip
    u = np.column_stack([signals[s.name] for s in model.inputs])
    acting = np.column_stack([np.minimum(signals[s.name], most if s.name == "volt" else 9) for s in model.inputs])
    y = simulate(compile_equations(model), acting, np.array([0.5, 1.0]), np.array([2.0]), step)
    y += 0.01 * y.std() * rng.standard_normal(y.shape)
    u = np.vstack([*[u[:1]] * early, u[: rows - early]])
    channels = (*(Channel(s.name, "V", "input") for s in model.inputs), Channel("speed", "rad/s", "output"))
    record = Record(step * np.arange(rows), np.hstack([u, y]), channels, step, "a.csv", "")
    return Case("motor", (record,), "equations", model, "motor.toml", "", {}, Path())


def test_a_drive_that_saturates_most_of_the_time_is_found() -> None:
    """Its limit lies below the median of the command, where the range of the value ended."""
    _, entry, values = found_in(motor(np.random.default_rng(3), most=6.2))
    assert entry == "input_saturation"
    assert values["high"][0] == pytest.approx(6.2, rel=0.02)


def test_two_clocks_three_rows_apart_are_found_though_nothing_speaks_at_none() -> None:
    """Inputs written three rows late; it was taken for one row early behind a filter of all outputs."""
    _, entry, values = found_in(motor(np.random.default_rng(4), early=3))
    assert entry == "data_time_offset"
    assert values["offset_s"][0] == pytest.approx(-0.06, abs=0.004)
