"""Horizons, control effort and inferred inputs are held against imitations of the baseline in the recording's loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import SWING_STEP, narrow, write_case

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.localise import expected
from aeolid.diagnose.localise.expected import evidence_in_loop
from aeolid.diagnose.localise.loop import LAGS, Controller, _closed, controller_of, imitate_in_loop

Array = NDArray[np.float64]
STEP, ROWS = 0.1, 6000
KI = 3.0  # deg/rad of the controller
CHANNELS = (("pitch", "deg", "input"), ("speed", "rad/s", "output"), ("fore_aft", "m/s", "output"))
MODEL = """[model]
name = "a rotor on a tower"
[parameters]
torque = { value = 0.05, unit = "1", min = 0.005, max = 0.5, free = true }
thrust = { value = 0.2, unit = "1", min = 0.02, max = 2.0, free = true }
drag = { value = 0.1, unit = "1/s", min = 0.01, max = 1.0, free = true }
[[input]]
name = "pitch"
unit = "deg"
[[state]]
name = "w"
unit = "rad/s"
derivative = "torque*(gust - pitch) - drag*w"
[[state]]
name = "x"
unit = "m"
derivative = "v"
[[state]]
name = "v"
unit = "m/s"
derivative = "thrust*(gust - pitch) - 4.0*x - 0.2*v"
[[state]]
name = "gust"
unit = "m/s"
derivative = "-gust/8.0"
[[output]]
name = "speed"
unit = "rad/s"
equation = "w"
[[output]]
name = "fore_aft"
unit = "m/s"
equation = "v"
"""


def recording(seed: int = 1, *, kp: float = 10.0, lag_s: float = 0.0, eddies: float = 0.0) -> Array:
    """Return pitch, speed, fore-aft (N, 3): PI control of the speed, random steps on top; Runge-Kutta, 2 steps a row.

    kp: of the controller, deg s/rad, none in open loop; lag_s: of the pitch drive; eddies: m/s of wind in a narrow band
    about 0.5 Hz that is no wind of one memory.
    """
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(-1.0, 1.0, ROWS // 10), 10)
    fresh = rng.standard_normal(ROWS) * np.sqrt(2 * STEP / 8.0)
    band = eddies * narrow(rng.standard_normal(ROWS), 0.5 * STEP / SWING_STEP, 0.02)
    errors = rng.standard_normal((ROWS, 2)) * (2e-3, 4e-3)
    z, blade, total, rows = np.zeros(4), 0.0, 0.0, np.empty((ROWS, 3))

    def slope(z: Array, pitch: float, band: float) -> Array:
        push = z[3] + band - pitch
        return np.array([0.05 * push - 0.1 * z[0], z[2], 0.2 * push - 4.0 * z[1] - 0.2 * z[2], -z[3] / 8.0])

    for i in range(ROWS):
        seen = z[[0, 2]] + errors[i]
        total += KI * STEP * seen[0]
        demand = steps[i] + (kp * seen[0] + total if kp else 0.0)
        rows[i] = demand, *seen
        for _ in range(2):
            blade = demand + (blade - demand) * (np.exp(-STEP / 2 / lag_s) if lag_s else 0.0)
            h = STEP / 2
            k1 = slope(z, blade, band[i])
            k2 = slope(z + h / 2 * k1, blade, band[i])
            k3 = slope(z + h / 2 * k2, blade, band[i])
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(z + h * k3, blade, band[i]))
        z[3] += fresh[i]
    return rows


def stage(folder: Path, rows: Array) -> Prepared:
    return prepare(load_case(write_case(folder, MODEL, STEP, CHANNELS, rows)))


def marked(maps: dict[str, list[dict[str, Any]]]) -> set[tuple[str, str]]:
    return {(kind, c["output"]) for kind, cells in maps.items() for c in cells if c["significant"]}


def fitted(prepared: Prepared) -> Controller:
    found = controller_of(prepared.predictor.segments, 1, np.array([True, True]))
    assert found is not None
    return found


def test_the_controller_is_found_with_its_gain(tmp_path: Path) -> None:
    """Steps are held for ten samples: an own past of ten told a gain of 5 to 6 (see `controller_of`)."""
    (found,) = fitted(stage(tmp_path, recording())).answers
    at_once, deviation = found.weights[1 + LAGS], float(np.linalg.norm(found.root[1 + LAGS]))
    assert found.place == 0 and at_once == pytest.approx(10.0 + KI * STEP, abs=3 * deviation)
    assert deviation < 2.0 and np.all(found.root[-11:] == 0)  # nothing answers the tower


def test_the_loop_gives_back_the_recording_from_its_own_innovations(tmp_path: Path) -> None:
    """What was added to the inputs is as recorded: with the recording's innovations nothing may differ."""
    bare = stage(tmp_path, recording()).only(())
    predictor, point, controller = bare.predictor, bare.fit.point, fitted(bare)
    segment = predictor.segments[0]
    e = predictor.run(point, 0)[0]
    for chosen in (controller, controller.drawn(np.random.default_rng(1))):
        u, y = _closed(predictor, point, 0, chosen, e)
        np.testing.assert_allclose(u, segment.u, atol=1e-8)
        np.testing.assert_allclose(y, segment.y, atol=1e-8)
    e[1000:] += 0.01
    u, y = _closed(predictor, point, 0, controller, e)
    np.testing.assert_allclose(u[:1000], segment.u[:1000], atol=1e-8)
    assert np.all(u[1000, 0] != segment.u[1000, 0]) and np.all(u[:, 1:] == segment.u[:, 1:])


@pytest.mark.parametrize(
    ("kp", "seed"),
    [
        pytest.param(kp, seed, marks=() if (kp, seed) in ((10.0, 1), (2.0, 2), (0.0, 4)) else pytest.mark.nightly)
        for kp in (10.0, 2.0, 0.0)
        for seed in (1, 2, 4)
    ],
)  # by day every loop once and every seed once
def test_nothing_is_marked_where_nothing_is_missing(tmp_path: Path, kp: float, seed: int) -> None:
    maps = evidence_in_loop(stage(tmp_path, recording(seed, kp=kp)), 0)
    assert marked(maps) == set()
    assert {c["output"] for c in maps["horizon"]} == {"speed", "fore_aft"}
    assert {c["output"] for c in maps["effort"]} == ({"pitch"} if kp else set())
    assert "gust" in {c["output"] for c in maps["inferred"]}
    assert 5.0 in {c["horizon_s"] for c in maps["horizon"]}


def test_a_lag_that_the_loop_makes_up_for_shows_in_the_control_effort(tmp_path: Path) -> None:
    maps = evidence_in_loop(stage(tmp_path, recording(lag_s=0.8)), 0)
    assert ("effort", "pitch") in marked(maps)


def test_eddies_that_are_taken_for_wind_make_it_no_plausible_wind(tmp_path: Path) -> None:
    maps = evidence_in_loop(stage(tmp_path, recording(eddies=0.5)), 0)
    loudest = max((c for c in maps["inferred"] if c["output"] == "gust"), key=lambda c: float(c["value"]))
    assert loudest["significant"] and loudest["frequency_hz"][0] < 0.55 and loudest["frequency_hz"][1] > 0.45


def test_missing_readings_change_little_and_mark_nothing(tmp_path: Path) -> None:
    rows = recording(2)
    rows[1000:1020, 1] = np.nan
    rows[3000:3003, 2] = np.nan
    maps = evidence_in_loop(stage(tmp_path, rows), 0)
    assert marked(maps) == set() and maps["effort"] and maps["horizon"]


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_an_output_that_was_read_in_none_of_the_rows_has_no_error_there(tmp_path: Path) -> None:
    """Nothing is warned of, and the other output's errors are what they were."""
    bare = stage(tmp_path, recording(kp=0.0)[:2000]).only(())
    predictor, point = bare.predictor, bare.fit.point
    runs = [predictor.run(point, i)[2] for i in range(len(predictor.segments))]
    gone = predictor.on([replace(s, y=s.y * [np.nan, 1.0]) for s in predictor.segments])
    whole, half = expected._ahead(predictor, point, runs), expected._ahead(gone, point, runs)
    assert len(half) > 2 and np.isnan(half[:, 0]).all() and np.isfinite(whole).all()
    np.testing.assert_array_equal(half[:, 1], whole[:, 1])


def test_a_loop_whose_outputs_are_read_at_every_other_input_is_seen_but_not_told(tmp_path: Path) -> None:
    """What the controller does between the rows is not known."""
    prepared = stage(tmp_path, recording()).only(())
    segment = prepared.predictor.segments[0]
    half = replace(segment, y=np.ascontiguousarray(segment.y[::2]), stride=2, step=2 * STEP)
    rare = replace(prepared, predictor=prepared.predictor.on([half]))
    found = controller_of([half], 1, np.array([True, True]))
    assert found is not None and found.places == [0]
    assert expected._loop(rare)[1] is False


def test_a_loop_that_runs_away_is_not_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    prepared = stage(tmp_path, recording())
    found = fitted(prepared)
    wild = Controller(tuple(replace(a, weights=-50 * a.weights) for a in found.answers))
    bare = prepared.only(())
    rng = np.random.default_rng(0)
    assert imitate_in_loop(bare.predictor, bare.fit, bare.fit.point, wild, rng) is None
    monkeypatch.setattr(expected, "controller_of", lambda *_: wild)
    assert evidence_in_loop(prepared, 0) == {"horizon": [], "effort": [], "inferred": []}


def test_the_same_input_gives_the_same_answer(tmp_path: Path) -> None:
    prepared = stage(tmp_path, recording(3))
    assert evidence_in_loop(prepared, 5) == evidence_in_loop(prepared, 5)
