"""An output that holds one value is told apart: a machine at rest, one that friction may hold, a stuck sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import examine
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.data.standing import stretches_of
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.1
CAR = """
[model]
name = "car"
time = "continuous"
[parameters]
K = { value = 7.0, min = 0, max = 20, free = true }
b = { value = 0.8, min = 0, max = 20, free = true }
[[state]]
name = "v"
derivative = "K*throttle - b*v - 0.5*tanh(20*v)"
initial = { value = 0.0 }
[[output]]
name = "speed"
equation = "v"
"""


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Equations:
    path = tmp_path_factory.mktemp("car") / "model.toml"
    path.write_text(CAR)
    return equations_file.load(path)


def pulses(rows: int, *spans: tuple[int, int, float]) -> Array:
    u = np.zeros(rows)
    for a, b, value in spans:
        u[a:b] = value
    return u


def record(throttle: Array, speed: Array, source: str = "run.csv") -> Record:
    channels = (Channel("throttle", "1", "input"), Channel("speed", "m/s", "output"))
    time = STEP * np.arange(len(speed))
    return Record(time, np.column_stack([throttle, speed]), channels, STEP, source, "")


def drive(car: Equations, throttle: Array, seed: int, band: float = 0.0) -> Array:
    """Return the speed to the fourth digit, with noise where the car rolls; throttle below `band` does nothing."""
    felt = np.where(np.abs(throttle) > band, throttle, 0.0)
    v = car.simulate(record(felt, np.zeros(len(felt))))[:, 0]
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(v))
    speed: Array = np.round(np.where(v > 0.02, v + noise, 0.0), 4)
    return speed


def kinds(car: Equations, throttle: Array, speed: Array) -> list[tuple[int, int, str]]:
    return [(s.start, s.stop, s.kind) for s in stretches_of([record(throttle, speed)], car)]


def test_a_car_that_stands_is_at_rest(car: Equations) -> None:
    """It stands, drives from 40 to 120, rolls out and stands: throttle is off both times."""
    u = pulses(200, (40, 120, 0.3))
    y = drive(car, u, 1)
    rolls = int(np.flatnonzero(y)[-1]) + 1
    assert kinds(car, u, y) == [(0, 40, "rest"), (rolls, 200, "rest")]


def test_a_dead_band_is_no_dead_sensor(car: Equations) -> None:
    """With a throttle that its model drives at, the car stands and starts from zero when the throttle grows."""
    u = pulses(300, (10, 100, 0.12), (100, 180, 0.4))
    found = kinds(car, u, drive(car, u, 2, band=0.15))
    assert found[0][2] == "still" and found[0][1] > 95


def test_what_stands_at_inputs_that_moved_it_is_no_dead_band(car: Equations) -> None:
    """Five times it starts at a throttle of 0.3; before the sixth it stands at 0.4 for two seconds."""
    u = pulses(900, *((150 * k + 50, 150 * k + 90, 0.3) for k in range(6)))
    y = drive(car, u, 6)
    u[805:815] = 0.4  # while it was lifted
    assert [k for _, _, k in kinds(car, u, y)].count("stuck") == 0 < len(kinds(car, u, y))
    u[770:790] = 0.4
    found = kinds(car, u, y)
    assert [(k, a <= 770 and b >= 790) for a, b, k in found if k == "stuck"] == [("stuck", True)]


@pytest.mark.parametrize("until", [90, 160])
def test_a_sensor_that_holds_while_the_machine_moves_is_stuck(car: Equations, until: int) -> None:
    u = 0.3 + 0.1 * np.sin(np.arange(160) / 9.0)
    y = drive(car, u, 3)
    y[50:until] = y[50]
    assert kinds(car, u, y) == [(50, until, "stuck")]


def test_rows_that_were_lost_do_not_part_a_stuck_sensor(car: Equations) -> None:
    """On coarse steps, where a fifth of the recording must stand: neither its stretch nor the model's run is broken."""
    u = 0.3 + 0.1 * np.sin(np.arange(600) / 9.0)
    y = np.round(drive(car, u, 3), 1)
    y[198:400] = y[200]
    for values in (u, y):
        values[[260, 320, 321, 380, 500]] = np.nan
    assert kinds(car, u, y) == [(198, 400, "stuck")]
    y[250:310] = np.nan  # silent for longer than a stretch must be: what was held meanwhile is not known
    assert kinds(car, u, y) == []


@pytest.mark.parametrize("lost", [100, 130, 145, 151, 170, 199])
@pytest.mark.parametrize("with_model", [True, False])
def test_a_row_that_was_lost_is_no_motion_of_an_input(car: Equations, lost: int, with_model: bool) -> None:
    """A car that stands from row 90 on, its throttle at zero; without a model it was a stuck sensor."""
    u = pulses(200, (0, 60, 0.3))
    y = drive(car, u, 1)
    baseline = car if with_model else None
    whole = [(s.start, s.stop, s.kind) for s in stretches_of([record(u, y)], baseline)]
    u[lost] = y[lost] = np.nan
    assert [k for _, _, k in whole] == ["rest"]
    assert [(s.start, s.stop, s.kind) for s in stretches_of([record(u, y)], baseline)] == whole
    u[lost], y[lost] = 0.0, 0.0
    u[lost] = np.nan
    assert [(s.start, s.stop, s.kind) for s in stretches_of([record(u, y)], baseline)] == whole


@pytest.mark.parametrize("visits", [1, 2])
def test_a_range_that_ends_is_no_stuck_sensor(car: Equations, visits: int) -> None:
    """What stands at the extreme that comes at other times as well is kept; a sensor that sticks there once is not."""
    u = pulses(900, *((150 * k + 20, 150 * k + 90, 0.3 + 0.05 * (k % visits)) for k in range(6)))
    u[u > 0] += 0.02 * np.sin(np.arange(int(np.sum(u > 0))) / 5.0)
    y = drive(car, u, 6)
    y = np.where(y > 0, np.abs(y + 0.1 * np.random.default_rng(1).standard_normal(900)), 0.0)  # it comes there in jumps
    high = float(np.sort(y)[-240])
    first = int(np.flatnonzero(y > high)[0])
    if visits == 1:
        y[first : first + 60] = float(y.max()) + 0.1
    else:
        y = np.minimum(y, high)
    found = [k for a, b, k in kinds(car, u, y) if y[a] == y.max()]
    assert found and set(found) == ({"stuck"} if visits == 1 else {"end"})
    kept = masked_case(case_of([record(u, y)], car))[0].records[0].column("speed")
    assert np.isnan(kept[y == y.max()]).any() == (visits == 1)


def case_of(records: Sequence[Record], car: Equations) -> Case:
    return Case("car", tuple(records), "equations", car, "model.toml", "", {}, Path(), False)


def test_what_was_not_measured_is_left_out_and_said(car: Equations) -> None:
    """Of a rest its arrival and the last sample stay, of a stuck sensor the first; neither ends the diagnosis."""
    u = pulses(300, (40, 200, 0.3))
    u[40:200] += 0.1 * np.sin(np.arange(160) / 9.0)
    y = drive(car, u, 4)
    rolls = int(np.flatnonzero(y)[-1]) + 1
    y[100:140] = y[100]
    y[150] = -999.0
    found = examine([record(u, y)], car)
    assert {(f.check, f.severity) for f in found if f.left_out} == {
        ("standing", "info"), ("stuck", "warning"), ("code", "warning"),
    }  # fmt: skip
    case, left = masked_case(case_of([record(u, y)], car))
    assert left == ()
    gone = np.flatnonzero(np.isnan(case.records[0].column("speed"))).tolist()
    assert gone == [*range(2, 39), *range(101, 140), 150, *range(rolls + 2, 299)]
    np.testing.assert_array_equal(case.records[0].column("throttle"), u)


def test_one_dead_recording_of_several_is_not_used(car: Equations) -> None:
    u = 0.3 + 0.1 * np.sin(np.arange(160) / 9.0)
    runs = [record(u, drive(car, u, k), f"{k}.csv") for k in range(4)]
    dead = record(u, np.full(160, 1.3), "dead.csv")
    found = examine([*runs, dead], car)
    assert [(f.check, f.channel, f.left_out) for f in found if f.severity != "info"] == [
        ("stuck", "speed (dead.csv)", True)
    ]
    case, left = masked_case(case_of([*runs, dead], car))
    assert [r.source for r in case.records] == [r.source for r in runs]
    assert [(f.check, f.severity) for f in left] == [("unused", "warning")]


def test_what_never_moves_or_is_mostly_stuck_stays_a_fault(car: Equations) -> None:
    u = 0.3 + 0.1 * np.sin(np.arange(160) / 9.0)
    dead = record(u, np.full(160, 1.3))
    for records in ([dead], [dead, replace(dead, source="b.csv")]):
        assert [f.check for f in examine(records, car) if f.severity == "fault" and not f.left_out] == ["constant"]
    y = drive(car, u, 5)
    y[20:130] = y[20]
    assert [(f.check, f.severity) for f in masked_case(case_of([record(u, y)], car))[1]] == [("left out", "fault")]


@pytest.mark.parametrize(("step", "rows", "said"), [(0.002, 12, True), (0.002, 6, False), (0.5, 12, False)])
def test_a_sensor_that_hangs_shortly_is_stuck(car: Equations, step: float, rows: int, said: bool) -> None:
    """Twelve samples of a level on steps of 12 bits, which the machine left: a null was `unnamed` for their sake.

    Fewer than ten may come by chance, and so do many where the steps are coarse.
    """
    throttle = 0.5 + 0.3 * np.sin(0.05 * np.arange(800))
    speed = np.round(car.simulate(record(throttle, np.zeros(800)))[:, 0] / step) * step
    speed = np.round((speed + 0.01 * np.random.default_rng(2).standard_normal(800)) / step) * step
    speed[400 : 400 + rows] = speed[400]
    found = [s for s in stretches_of([record(throttle, speed)], car) if s.kind == "stuck"]
    assert [abs(s.start - 400) <= 2 and abs(s.stop - 400 - rows) <= 2 for s in found] == [True] * said
