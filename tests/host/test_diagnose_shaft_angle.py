"""Weight out of balance on a shaft: its angle by its own speed, named where it is there, a model that needs none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.conclude import conclude
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.data.exogenous import exogenous_channels, with_exogenous
from aeolid.diagnose.data.shaft_angle import by_own_angles, name_of, with_shaft_angles
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, Parameter, State
from aeolid.models.integrate import compile_equations, free_run
from aeolid.models.load import load_model
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, FINE = 0.02, 3000, 20
INERTIA, DRAG, HEAVY = 0.02, 0.03, 0.06  # kg m², N m s, N m
CHANNELS = (("torque", "N m", "input"), ("speed", "rad/s", "output"))
MODEL = f"""[model]
name = "motor with a load"
time = "continuous"
[parameters]
J = {{ value = {INERTIA}, unit = "kg m^2" }}
c = {{ value = {DRAG}, unit = "N m s", min = 0.005, max = 0.2, free = true }}
g = {{ value = 1.0, unit = "1", min = 0.3, max = 3.0, free = true }}
[[input]]
name = "torque"
unit = "N m"
[[state]]
name = "w"
unit = "rad/s"
derivative = "(g*torque - c*w)/J"
[[output]]
name = "speed"
unit = "rad/s"
equation = "w"
"""


def turned(heavy: float, seed: int = 4, poles: int = 1) -> Array:
    """Simulate torque, speed and angle (N, 3) of a shaft that weight, or magnets, pull on with up to `heavy` N m."""
    rng = np.random.default_rng(seed)
    torque = np.repeat(0.25 + 0.25 * rng.standard_normal(SAMPLES // 25), 25)
    w = angle = 0.0
    rows = np.empty((SAMPLES, 3))
    for i, u in enumerate(torque):
        rows[i] = u, w, angle
        push = 0.02 * rng.standard_normal()
        for _ in range(FINE):
            w += STEP / FINE * (u + push - DRAG * w - heavy * np.sin(poles * angle + 0.8)) / INERTIA
            angle += STEP / FINE * w
    rows[:, 1] += 0.01 * rng.standard_normal(SAMPLES)
    return rows


def record(speed: Array, unit: str = "rad/s", more: tuple[Channel, ...] = ()) -> Record:
    channels = (Channel("speed", unit, "output"), *more)
    return Record(0.1 * np.arange(len(speed)), np.column_stack([speed] * len(channels)), channels, 0.1, "monday", "")


def shaft(unit: str, discrete: bool = False) -> Equations:
    """Return a shaft that a torque turns."""
    step = 0.1 if discrete else 0.0
    rate = ex.parse("0.9*w + 0.1*torque" if discrete else "torque - w", "w")
    output = Output("speed", unit, ex.parse("w", "speed"))
    state = State("w", unit, rate, 0.0)
    return Equations("shaft", step, (), (state,), (output,), (Signal("torque", "N m"),), ("torque",))


def test_an_angle_is_the_integral_of_its_speed_at_the_middle_of_each_row() -> None:
    time = 0.1 * np.arange(100)
    rpm = 60 + 30 * time  # of a shaft that runs up: 2 pi t + pi/2 t² in rad
    (found,) = with_shaft_angles([record(rpm, "rpm")], shaft("rpm"))
    middle = time + 0.05
    exact = 2 * np.pi * middle + np.pi / 2 * middle**2
    np.testing.assert_allclose(found.column(name_of("speed")), exact, atol=0.5 * np.pi * 0.05**2 + 1e-9)


@pytest.mark.parametrize("gap", [10, 11])
def test_an_angle_is_lost_in_a_long_gap(gap: int) -> None:
    speed = np.ones(200)
    speed[50 : 50 + gap] = np.nan
    (found,) = with_shaft_angles([record(speed)], shaft("rad/s"))
    assert (name_of("speed") in {c.name for c in found.channels}) == (gap == 10)


def test_nothing_is_computed_where_the_angle_is_known_or_means_nothing() -> None:
    speed = np.ones(200)
    plain, azimuth = record(speed), record(speed, more=(Channel("azimuth", "deg", "azimuth"),))
    angle = State("q", "rad", ex.parse("w", "q"), 0.0)
    known = replace(shaft("rad/s"), states=(*shaft("rad/s").states, angle))
    taken = record(speed, more=(Channel(name_of("speed"), "rad", "ignore"),))
    for records, model in (
        ([azimuth], shaft("rad/s")), ([taken], shaft("rad/s")), ([plain, plain], shaft("rad/s")), ([plain], known),
        ([record(speed, "m/s")], shaft("m/s")),
    ):  # fmt: skip
        assert [r.channels for r in with_shaft_angles(records, model)] == [r.channels for r in records]


@pytest.mark.parametrize("discrete", [False, True])
def test_a_model_with_its_own_angle_does_what_it_does_with_the_channel(discrete: bool) -> None:
    """The file that a user runs needs no channel. Integration by the trapezoidal rule is right to the second order."""
    base, rows = shaft("rad/s", discrete), 300
    (found,) = with_shaft_angles([record(np.ones(rows))], base)
    (channel,) = [c for c in exogenous_channels([found], base) if c.name == name_of("speed")]
    by_channel = with_exogenous(replace(base, parameters=(Parameter("S", 0.3, "N m"),)), [channel])
    (state,) = by_channel.states
    weight = f"{'0.1*' if discrete else ''}S*sin({channel.symbol})"
    pulled = ex.parse(f"{ex.to_text(state.derivative)} - {weight}", "w")
    by_channel = replace(by_channel, states=(replace(state, derivative=pulled),))
    own = by_own_angles(by_channel, [(channel.name, channel.symbol)])
    assert own.symbols == ("torque",) and [s.name for s in own.states] == ["w", channel.symbol]
    torque, size = 1.0 + np.sin(0.05 * np.arange(rows))[:, None], np.array([0.3])
    speed = free_run(compile_equations(own), torque, size, np.zeros(2), 0.1)
    (turned_by,) = with_shaft_angles([record(speed[:, 0])], base)
    driven = np.column_stack([torque, turned_by.column(channel.name)])
    again = free_run(compile_equations(by_channel), driven, size, np.zeros(1), 0.1)
    plain = free_run(compile_equations(by_channel), driven, np.zeros(1), np.zeros(1), 0.1)
    assert np.std(again - speed) < 0.02 * np.std(plain - speed)


def test_a_shaft_that_hardly_turns_has_no_weight(tmp_path: Path) -> None:
    rows = turned(0.0)[:, :2]
    for share, offered in ((1.0, True), (1e-3, False)):
        (tmp_path / str(share)).mkdir()
        case = load_case(write_case(tmp_path / str(share), MODEL, STEP, CHANNELS, share * rows))
        assert ("gravity_1p state:w" in {a.key for a in prepare(case).hypotheses}) == offered


@pytest.mark.diagnosis
@pytest.mark.parametrize("heavy", [HEAVY, 0.0])
def test_weight_out_of_balance_is_named_where_it_is(heavy: float, tmp_path: Path) -> None:
    case = load_case(write_case(tmp_path, MODEL, STEP, CHANNELS, turned(heavy)[:, :2]))
    diagnosis, _ = conclude(case, tmp_path / "out", sham=0, seed=0, progress=lambda text, share: None)
    if not heavy:
        assert diagnosis["verdict"] in ("no_mismatch", "immaterial")
        return
    assert diagnosis["verdict"] == "named" and [e["id"] for e in diagnosis["effects"]] == ["gravity_1p"]
    told = diagnosis["effects"][0]["parameters"]
    size = np.hypot(told["torque_N_m_cos"]["value"], told["torque_N_m_sin"]["value"])
    std = max(p["std"] for p in told.values())
    assert abs(size - heavy) < max(3 * std, 0.03 * heavy)
    corrected = load_model(tmp_path / "out" / "model" / "model.toml")
    assert isinstance(corrected, Equations) and [s.name for s in corrected.inputs] == ["torque"]
    assert any(s.unit == "rad" for s in corrected.states)


def test_a_recorded_angle_serves_where_it_is_that_of_the_shaft(tmp_path: Path) -> None:
    """In degrees and wrapped; of another shaft, three times as fast, it says nothing."""
    rows = turned(0.0)
    for name, gear, offered in (("own", 1.0, True), ("other", 3.0, False)):
        (tmp_path / name).mkdir()
        angle = np.rad2deg(gear * rows[:, 2]) % 360.0
        channels = (*CHANNELS, ("angle", "deg", "azimuth"))
        case = load_case(write_case(tmp_path / name, MODEL, STEP, channels, np.column_stack([rows[:, :2], angle])))
        prepared = prepare(case)
        assert ("gravity_1p state:w" in {a.key for a in prepared.hypotheses}) == offered
        assert name_of("speed") not in {c.name for c in prepared.exogenous}


@pytest.mark.diagnosis
def test_what_repeats_seven_times_a_turn_is_missing_and_has_no_name(tmp_path: Path) -> None:
    """A motor's magnets hold its teeth: no entry has that, and at seven times the speed's angle it is no noise."""
    case = load_case(write_case(tmp_path, MODEL, STEP, CHANNELS, turned(HEAVY, poles=7)[:, :2]))
    diagnosis, _ = conclude(case, tmp_path / "out", sham=0, seed=0, progress=lambda text, share: None)
    assert diagnosis["verdict"] == "unnamed"
    assert "repeats every 0.89" in diagnosis["statement"] and "rad of the angle of speed" in diagnosis["statement"]
