"""The zero of one blade's gauge: told from a factor, from a blade that is pitched otherwise and from what others do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.conclude import diagnosis_of, study_run
from aeolid.diagnose.run_prior.gauges import Gauge, gauge_of
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, SPEED, FIT = 0.1, 6000, 1.2, 0.7
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": SPEED}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("rotor_speed", "rad/s", "output"),
    Channel("tower_acc_fore_aft", "m/s^2", "output"), Channel("flap_moment_1", "kN m", "output"),
    Channel("flap_moment_2", "kN m", "output"), Channel("flap_moment_3", "kN m", "output"),
    Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip
LEVEL, FIRST = 5000.0, 3  # kN m; column of the first blade
UNITS = {c.name: c.unit for c in CHANNELS}


@cache
def turbine(seed: int, turning: float = 0.0) -> Record:
    """Return a recording of three blades in wind that is stronger above; turning: of a load once a revolution."""
    rng = np.random.default_rng(seed)
    wind = lfilter([0.1], [1, -0.97], rng.standard_normal(SAMPLES))
    pitch = lfilter([0.3], [1, -0.9], rng.standard_normal(SAMPLES))
    azimuth = np.cumsum(np.full(SAMPLES, SPEED)) * STEP
    thrust = wind - 0.5 * lfilter([0.3], [1, -0.7], pitch)
    speed = lfilter([STEP], [1, -0.98], thrust)
    tower = lfilter([0.2, -0.2], [1, -1.6, 0.9], thrust + turning * np.cos(azimuth))
    shear = 0.8 + 0.2 * lfilter([0.05], [1, -0.99], rng.standard_normal(SAMPLES))
    blades = [LEVEL + 900 * thrust + 700 * shear * np.cos(azimuth + k * 2 * np.pi / 3) for k in range(3)]
    values = np.column_stack([pitch, speed, tower, *blades, azimuth])
    values[:, 1:6] += np.array([1e-3, 1e-2, 20, 20, 20]) * rng.standard_normal((SAMPLES, 5))
    return Record(STEP * np.arange(SAMPLES), values, CHANNELS, STEP, f"turbine {seed}", "")


def changed(record: Record, blade: int, by: Callable[[Array, Array], Array]) -> Record:
    """Return a recording with one blade's moments changed, by their values and times."""
    values = record.values.copy()
    at = FIRST + blade
    values[:, at] = by(values[:, at], record.time_s)
    return replace(record, values=values)


def gauge(recording: Record, run: Record) -> Gauge | None:
    return gauge_of(pair_of([recording], [run], CONTEXT), CONTEXT, FIT)


@pytest.mark.parametrize("blade", [0, 2])
@pytest.mark.parametrize("bias", [250.0, -800.0])
def test_a_zero_that_is_off_is_told_with_its_blade_and_size(blade: int, bias: float) -> None:
    found = gauge(changed(turbine(1), blade, lambda y, t: y + bias), turbine(2))
    assert found is not None and found.channel == f"flap_moment_{blade + 1}" and not found.drifts
    assert found.bias == pytest.approx(bias, abs=4 * found.bias_std + 0.05 * abs(bias))


def test_a_zero_that_drifts_is_told_with_its_rate() -> None:
    found = gauge(changed(turbine(1), 1, lambda y, t: y + 1.5 * t), turbine(2))
    assert found is not None and found.channel == "flap_moment_2" and found.drifts
    assert found.rate == pytest.approx(1.5, abs=4 * found.rate_std)


@pytest.mark.parametrize(
    "recording",
    [
        turbine(1), turbine(3, 0.4), changed(turbine(1), 0, lambda y, t: 1.12 * y),
        changed(turbine(1, 0.4), 0, lambda y, t: y + 600.0),
        changed(changed(turbine(1), 0, lambda y, t: y + 600.0), 1, lambda y, t: y - 400.0),
        changed(turbine(1), 0, lambda y, t: y + 40.0),
    ],
    ids=["null", "heavy blade", "factor", "pitched blade", "two", "small"],
)  # fmt: skip
def test_what_is_no_zero_of_one_gauge_is_left_to_others(recording: Record) -> None:
    """A heavy blade and one that is pitched otherwise shake the tower; a factor is larger where loads turn, too."""
    assert gauge(recording, turbine(2)) is None


def test_without_an_angle_a_speed_or_time_enough_nothing_is_told() -> None:
    off = changed(turbine(1), 0, lambda y, t: y + 600.0)
    run = turbine(2)
    blind = [replace(r, values=r.values[:, :6], channels=CHANNELS[:6]) for r in (off, run)]
    assert gauge(*blind) is None
    kept = [0, 3, 4, 5, 6]
    alone = [replace(r, values=r.values[:, kept], channels=tuple(CHANNELS[k] for k in kept)) for r in (off, run)]
    assert gauge(*alone) is None
    short = [replace(r, values=r.values[:900], time_s=r.time_s[:900]) for r in (off, run)]
    assert gauge(*short) is None
    pump = {"machine": "pump"}
    assert gauge_of(pair_of([off], [run], pump), pump, FIT) is None


def test_the_search_goes_on_behind_a_zero_and_the_fault_is_said() -> None:
    off = changed(turbine(1), 0, lambda y, t: y + 600.0)
    study = study_run([off], [turbine(2)], CONTEXT, lambda *_: None, unlimited())
    told = diagnosis_of(study, "made", UNITS)
    assert told["verdict"] == "data_fault"
    assert [e["id"] for e in told["effects"]] == ["sensor_bias"]
    effect = told["effects"][0]
    assert effect["location"]["entry"] == "output:flap_moment_1" and "flap_moment_1 is off by +" in told["statement"]
    assert effect["parameters"]["bias"]["unit"] == "kN m"
    assert abs(effect["parameters"]["bias"]["value"] / 600 - 1) < 0.1
