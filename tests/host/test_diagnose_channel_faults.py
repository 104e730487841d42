"""Channels recorded with another sign, unit or name are found before any physics, and put right."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_cases import as_case, draw_case
from numpy.typing import NDArray
from scipy.signal import lfilter
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.diagnose.baseline.channel_faults import RATIOS, ChannelFault, channel_faults, with_faults
from aeolid.diagnose.baseline.wiring_evidence import judge_of
from aeolid.diagnose.data.case import Case, load_case
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]


def spoil(case: Case, u: Array, y: Array, how: str) -> Case:
    """Return the case with its recording spoilt."""
    u, y = u.copy(), y.copy()
    if how == "input sign":
        u[:, 0] *= -1
    elif how == "output sign":
        y[:, 1] *= -1
    elif how == "input in radians":
        u[:, 0] *= np.pi / 180
    elif how == "output in rad/s":
        y[:, 0] *= np.pi / 30
    elif how == "thousandth":
        u[:, 1] *= 1000
    elif how == "inputs swapped":
        u = u[:, ::-1]
    elif how == "outputs swapped":
        y = y[:, ::-1]
    assert isinstance(case.baseline, StateSpace)
    return as_case(case.baseline, u, y)


SAID = {
    "input sign": ("sensor_sign", "input:u0", -1.0),
    "output sign": ("sensor_sign", "output:y1", -1.0),
    "input in radians": ("sensor_scale", "input:u0", np.pi / 180),
    "output in rad/s": ("sensor_scale", "output:y0", np.pi / 30),
    "thousandth": ("sensor_scale", "input:u1", 1000.0),
    "inputs swapped": ("data_channel_swap", "inputs:u0 and u1", 1.0),
    "outputs swapped": ("data_channel_swap", "outputs:y0 and y1", 1.0),
}


@pytest.mark.parametrize("how", list(SAID))
def test_each_fault_is_found_at_its_place_and_put_right(how: str) -> None:
    """On plants that nobody chose, also where the model lacks a lag of half a second besides; the data come back."""
    found = []
    for seed in range(4):
        whole, u, y = draw_case(seed, lag=[0.0, 5.0][seed % 2])
        faults, repaired = channel_faults(spoil(whole, u, y, how))
        found.append([(f.id, f.entry) for f in faults] == [SAID[how][:2]])
        if found[-1]:
            assert faults[0].factor == pytest.approx(SAID[how][2], rel=1e-12)
            assert repaired.records[0].values == pytest.approx(whole.records[0].values, rel=1e-9, abs=1e-12)
    assert sum(found) >= 3  # of four: some inputs hardly reach the outputs, behind a lag least of all


def first_rows(case: Case, rows: int) -> Case:
    """Return the case with the first rows of its recording alone."""
    return replace(case, records=(case.records[0].slice(0, rows),))


@pytest.mark.parametrize("rows", [500, 1500])
def test_a_short_recording_in_radians_is_found_as_a_long_one_is(rows: int) -> None:
    """Free weights of past inputs gain half a nat each by chance, which in few rows is much of what they gain."""
    found = 0
    for seed in range(8):
        whole, u, y = draw_case(seed, lag=3.0)
        faults, _ = channel_faults(first_rows(spoil(whole, u, y, "input in radians"), rows))
        found += [(f.id, f.entry) for f in faults] == [SAID["input in radians"][:2]]
        assert channel_faults(first_rows(whole, rows))[0] == ()
    assert found >= 6  # of eight: some inputs hardly reach the outputs


@pytest.mark.parametrize(
    ("unit", "factor"), [("mm", 0.1), ("mm", 10.0), ("mm", 1 / 25.4), ("m", 3.28084), ("m", 100.0)]
)
def test_an_output_in_another_unit_of_its_kind_is_found(unit: str, factor: float) -> None:
    """Centimetres, inches and feet for what roles and model call otherwise."""
    whole, u, y = draw_case(1)
    assert isinstance(whole.baseline, StateSpace)
    outputs = (replace(whole.baseline.outputs[0], unit=unit), whole.baseline.outputs[1])
    faults, repaired = channel_faults(as_case(replace(whole.baseline, outputs=outputs), u, y * [factor, 1.0]))
    assert [(f.id, f.entry) for f in faults] == [("sensor_scale", "output:y0")]
    assert faults[0].factor == pytest.approx(factor, rel=1e-9)
    assert repaired.records[0].values == pytest.approx(whole.records[0].values, rel=1e-9, abs=1e-12)


def test_nothing_is_said_of_channels_that_are_right() -> None:
    """A lag, a gain that is a third off, a mode that is softer, levels, and much noise are no faults of channels."""
    for seed in range(8):  # every lag about either mean
        case, u, y = draw_case(100 + seed, lag=[0.0, 2.0, 20.0][seed % 3], mean=[0.0, 5.0][seed % 2])
        assert isinstance(case.baseline, StateSpace)
        off = replace(case.baseline, A=0.97 * case.baseline.A, B=case.baseline.B * [1.5, 1.0])
        for model in (case.baseline, off):
            faults, same = channel_faults(as_case(model, u, y))
            assert faults == () and np.array_equal(same.records[0].values, np.hstack([u, y]))


def test_equations_are_asked_too(tmp_path: Path) -> None:
    """A swing's speed with the wrong sign; the swing as it is has no fault."""
    rng = np.random.default_rng(5)
    push = np.repeat(rng.standard_normal(200), 10) * 10
    clean = tmp_path / "clean"
    clean.mkdir()
    rows = np.column_stack([push, np.zeros((2000, 2))])
    case = load_case(write_case(clean, SWING, 0.02, SWING_CHANNELS, rows))
    y = case.baseline.simulate(case.records[0])  # type: ignore[union-attr]
    y = y + 0.2 * y.std(axis=0) * rng.standard_normal(y.shape)
    for factor, said in ((1.0, []), (-1.0, [("sensor_sign", "output:speed")])):
        values = np.column_stack([push, y[:, 0], factor * y[:, 1]])
        spoilt = replace(case, records=(replace(case.records[0], values=values),))
        assert [(f.id, f.entry) for f in channel_faults(spoilt)[0]] == said


DAMPER = """[model]
name = "damper"
time = "continuous"
[parameters]
c = { value = 300, unit = "N s/m", min = 60, max = 1500, free = true }
k = { value = 410, unit = "N/m", min = 80, max = 2000, free = true }
[[output]]
name = "force"
unit = "N"
equation = "c*speed + k*stroke"
"""
DAMPER_CHANNELS = [("speed", "m/s", "input"), ("stroke", "m", "input"), ("force", "N", "output")]


@pytest.mark.parametrize("swapped", [False, True])
def test_values_that_may_move_are_no_exchange_of_channels(tmp_path: Path, swapped: bool) -> None:
    """A damping that grows with the speed is nearer to the declared stiffness than to the declared damping.

    An exchange that no values within their ranges explain is one.
    """
    rng = np.random.default_rng(7)
    stroke = 0.3 * np.sin(2 * np.pi * np.cumsum(0.5 + 0.3 * np.sin(0.001 * np.arange(2000))) * 0.02)
    stroke = np.asarray(lfilter([0.3], [1, -0.7], stroke + 0.2 * rng.standard_normal(2000)))
    speed = np.gradient(stroke, 0.02)
    stiffness = 6000 if swapped else 400
    force = 290 * speed + stiffness * stroke + 170 * speed * np.abs(speed) + 3 * rng.standard_normal(2000)
    u = np.column_stack([stroke, speed] if swapped else [speed, stroke])
    model = DAMPER.replace("410", "6100").replace("2000", "30000") if swapped else DAMPER
    case = load_case(write_case(tmp_path, model, 0.02, DAMPER_CHANNELS, np.column_stack([u, force])))
    said = [("data_channel_swap", "inputs:speed and stroke")] if swapped else []
    assert [(f.id, f.entry) for f in channel_faults(case)[0]] == said


def test_what_was_asked_before_changes_no_answer(tmp_path: Path) -> None:
    """Simulations are kept and looked up: each wiring is worth what it is to a judge that was asked nothing else."""
    rng = np.random.default_rng(6)
    rows = np.column_stack([np.repeat(rng.standard_normal(40), 10), 0.1 * rng.standard_normal((400, 2))])
    case = load_case(write_case(tmp_path, SWING, 0.02, SWING_CHANNELS, rows))
    asked = judge_of(case)
    assert asked is not None
    base = asked.declared
    wirings = [base, *(replace(base, inputs=(f,)) for f in (-1.0, 3.0, 0.1, 10.0)), replace(base, outputs=(-1.0, 2.0))]
    for wiring in [*wirings, *wirings[::-1]]:
        fresh = judge_of(case)
        assert fresh is not None
        for order in (2, 5):
            (value, parts, lags), other = asked.worth(wiring, order), fresh.worth(wiring, order)
            assert (value, lags) == (other[0], other[2]) and np.array_equal(parts, other[1])


def test_the_answer_is_that_of_the_recording_put_right_and_says_so() -> None:
    """Faults come first, in verdict, sentence, effects and place; without one nothing changes."""
    diagnosis: dict[str, Any] = {"verdict": "named", "statement": "a lag", "effects": [{"id": "lag"}], "location": {}}
    assert with_faults(diagnosis, ()) is diagnosis
    fault = ChannelFault("sensor_sign", "output:y", ("y",), -1.0, 99.0, "y is reversed", "y_recorded = -y")
    told = with_faults(diagnosis, [fault])
    assert told["verdict"] == "data_fault" and [e["id"] for e in told["effects"]] == ["sensor_sign", "lag"]
    assert told["statement"] == "y is reversed. With that put right: a lag"
    assert told["location"] == {"entry": "output:y", "outputs": ["y"]}


def test_what_cannot_be_asked_is_left_alone() -> None:
    """Short recordings, channels that stand still, more holes than a tenth: no answer, no error."""
    case, u, y = draw_case(3)
    assert isinstance(case.baseline, StateSpace)
    holes = u.copy()
    holes[::4] = np.nan
    for inputs, outputs in ((u[:100], y[:100]), (0 * u, y), (holes, y)):
        spoilt = as_case(case.baseline, inputs, outputs)
        assert channel_faults(spoilt) == ((), spoilt)


def test_known_factors_are_those_of_their_units() -> None:
    """By their definitions."""
    factors = {words: ratio for ratio, words, _ in RATIOS}
    assert factors["degrees to a radian"] == pytest.approx(np.degrees(1.0), rel=1e-12)
    assert factors["rpm to a rad/s"] == pytest.approx(60 / (2 * np.pi), rel=1e-12)
    assert factors["deg/s to an rpm"] == pytest.approx(360 / 60)
    assert factors["km/h to a m/s"] == pytest.approx(3600 / 1000)


PLATES = """
[model]
name = "plates"
time = "continuous"
[parameters]
c = { value = 700.0, min = 200.0, max = 3000.0, unit = "J/K", free = true }
g = { value = 4.4, min = 1.0, max = 20.0, unit = "W/K", free = true }
[[state]]
name = "a"
derivative = "(heater - g*(a - b) - 2*(a - air))/c"
initial = 30.0
[[state]]
name = "b"
derivative = "(g*(a - b) - 3*(b - air))/c"
initial = 25.0
[[output]]
name = "ta"
equation = "a"
unit = "degC"
[[output]]
name = "tb"
equation = "b"
unit = "degC"
"""


def plates(fahrenheit: str = "", lacking: float = 0.0) -> Case:
    """Return two heated plates, one channel of which may be in degrees Fahrenheit; lacking: W/K lost besides."""
    rng, rows, step = np.random.default_rng(4), 900, 5.0
    heater = np.repeat(rng.uniform(20, 120, rows // 30), 30)
    air = 18 + np.cumsum(0.1 * rng.standard_normal(rows))
    model = equations_file.from_toml(tomllib.loads(PLATES), PLATES, "plates.toml")
    signals = {"heater": heater, "air": air}
    driven = np.column_stack([signals[i.name] for i in model.inputs])
    text = PLATES.replace("3*(b", f"{3 + lacking}*(b")
    true = equations_file.from_toml(tomllib.loads(text), text, "plates.toml")
    y = simulate(compile_equations(true), driven, np.array([640.0, 4.0]), true.x0, step)
    y += 0.1 * rng.standard_normal(y.shape)
    table = dict(zip(("heater", "air", "ta", "tb"), np.column_stack([heater, air, y]).T, strict=True))
    if fahrenheit:
        table[fahrenheit] = 1.8 * table[fahrenheit] + 32
    units, roles = ("W", "degC", "degC", "degC"), ("input", "input", "output", "output")
    channels = tuple(Channel(n, u, r) for n, u, r in zip(table, units, roles, strict=True))
    record = Record(step * np.arange(rows), np.column_stack(list(table.values())), channels, step, "a.csv", "")
    return Case("plates", (record,), "equations", model, "plates.toml", "", {}, Path())


@pytest.mark.parametrize("channel", ["air", "ta", "tb"])
def test_degrees_fahrenheit_among_degrees_celsius_are_found_by_their_level(channel: str) -> None:
    """An output or an input, whose unit stands in the roles only; the recording is put right."""
    faults, repaired = channel_faults(plates(channel))
    assert [(f.id, f.channels) for f in faults] == [("sensor_scale", (channel,))]
    assert faults[0].statement.startswith(f"{channel} is recorded in degrees Fahrenheit, though its unit is degC")
    assert faults[0].equation == f"{channel}_recorded = 1.8*{channel} + 32"
    assert repaired.records[0].values == pytest.approx(plates().records[0].values, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("lacking", [0.0, 1.0, 4.0])
def test_a_model_that_lacks_a_loss_of_heat_has_no_channel_in_another_unit(lacking: float) -> None:
    assert channel_faults(plates(lacking=lacking))[0] == ()


def test_the_unit_that_the_roles_give_is_asked_where_the_model_has_none() -> None:
    """An input in degrees, recorded in radians: the same fault, whether the model repeats the unit or leaves it out."""
    whole, u, y = draw_case(1)
    spoilt = spoil(whole, u, y, "input in radians")
    assert isinstance(spoilt.baseline, StateSpace)
    bare = replace(
        spoilt.baseline,
        inputs=tuple(replace(s, unit="") for s in spoilt.baseline.inputs),
        outputs=tuple(replace(s, unit="") for s in spoilt.baseline.outputs),
    )
    told = [channel_faults(replace(spoilt, baseline=b))[0] for b in (spoilt.baseline, bare)]
    assert [(f.id, f.entry, f.factor) for f in told[1]] == [(f.id, f.entry, f.factor) for f in told[0]] != []
