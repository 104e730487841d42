"""Levels by law, the disc's unevenness, words of simulators, sizes that are not excluded: on made turbines."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.hypotheses.catalogue import ENTRIES
from aeolid.diagnose.hypotheses.simulators import settings
from aeolid.diagnose.run_prior import standing
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.disc import disc_of
from aeolid.diagnose.run_prior.grams import lagged_gram, with_noise
from aeolid.diagnose.run_prior.hypotheses import Hypothesis
from aeolid.diagnose.run_prior.laws import shifts_of
from aeolid.diagnose.run_prior.least import least_size
from aeolid.diagnose.run_prior.offsets import Offset
from aeolid.diagnose.run_prior.pair import NOTHING
from aeolid.diagnose.run_prior.standing import standing_of
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES = 0.1, 6000
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": 1.2}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("torque", "kN m", "input"), Channel("speed", "rad/s", "output"),
    Channel("flap_1", "kN m", "output"), Channel("flap_2", "kN m", "output"), Channel("flap_3", "kN m", "output"),
    Channel("wind", "m/s", "scheduling"), Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip


def slow(rng: np.random.Generator, tau: float, size: float) -> Array:
    """Return a first-order process of that time constant in s and deviation."""
    a = float(np.exp(-STEP / tau))
    noise = rng.standard_normal(SAMPLES + 1000) * size * np.sqrt(1 - a * a)
    out: Array = lfilter([1.0], [1.0, -a], noise)[1000:]
    return out


@cache
def turbine(
    seed: int,
    mean: float = 18.0,
    density: float = 1.0,
    tilt: float = 1.0,
    uneven: float = 0.0,
    side: float = 1.0,
    thrust: float = 1.0,
) -> Record:
    """Return a recording above rated: the angle keeps the power, the thrust follows density, wind and angle."""
    rng = np.random.default_rng(seed)
    wind = mean + slow(rng, 15.0, 1.2)
    speed = 1.2 + slow(rng, 4.0, 0.02)
    pitch = 14.0 + 1.5 * (wind * density ** (1 / 3) - 18.0) + 20 * (speed - 1.2) + slow(rng, 2.0, 0.05)
    torque = 43.0 * 1.2 / speed + slow(rng, 0.5, 0.2)
    factor, of_side = thrust, side
    thrust = 4800 * factor * density * (wind / 18.0) ** 2 * (1 - 0.06 * (pitch - 14.0)) + slow(rng, 0.5, 60.0)
    azimuth = np.cumsum(speed) * STEP
    up = tilt * 0.3 * thrust + uneven * slow(rng, 3.0, 900.0) + slow(rng, 3.0, 60.0)
    side = of_side * 0.2 * thrust + uneven * slow(rng, 3.0, 900.0) + slow(rng, 3.0, 60.0)
    blades = [thrust + up * np.cos(azimuth + b) + side * np.sin(azimuth + b) for b in 2 * np.pi / 3 * np.arange(3)]
    values = np.column_stack([pitch, torque, speed, *blades, wind, azimuth])
    return Record(STEP * np.arange(SAMPLES), values, CHANNELS, STEP, f"turbine {seed}", "")


def names(recording: Record, run: Record, detected: bool = False) -> list[tuple[str, ...]]:
    """Return the names that levels and unevenness give."""
    pair = pair_of([recording], [run], CONTEXT)
    moved = dict.fromkeys(pair.shown, 1.0)
    return [s.entries for s in standing_of(pair, [recording], [run], CONTEXT, moved, detected)]


@pytest.mark.parametrize(("seed", "mean"), [(1, 18.0), (2, 18.0), (3, 17.0), (4, 19.0), (5, 18.5)])
def test_another_wind_moves_no_law(seed: int, mean: float) -> None:
    assert names(turbine(seed, mean), turbine(0)) == []


@pytest.mark.parametrize("density", [0.9, 0.95, 1.08])
def test_air_of_another_density_is_named_with_its_value(density: float) -> None:
    recording = turbine(11, 18.3, density)
    assert names(recording, turbine(0)) == [("air_density",)]
    pair = pair_of([recording], [turbine(0)], CONTEXT)
    (found,) = standing_of(pair, [recording], [turbine(0)], CONTEXT, dict.fromkeys(pair.shown, 1.0), False)
    value, std = found.told["air_density"]["density_change"]
    assert abs(value - (density - 1)) < 3 * std + 0.005
    assert found.interval[0] > 0


def test_a_tilt_moment_of_its_own_is_shear_or_a_wake() -> None:
    """A wake moves it by a tenth; twice the shear nearly doubled it, and was told as a wake first."""
    run = turbine(0)
    assert names(turbine(12, tilt=1.25), run) == [("wind_shear", "yaw_misalignment", "dynamic_inflow")]
    assert names(turbine(12, tilt=1.25), run, detected=True)[0][0] == "dynamic_inflow"
    assert names(turbine(12, tilt=1.6), run, detected=True) == [("wind_shear", "yaw_misalignment")]


def test_both_components_of_a_turned_load_bear_it_out() -> None:
    """Ten degrees of yaw moved tilt by 18 and yaw by 26 % on 500 s: 7 and 8 nats, either too few alone."""
    both = turbine(12, tilt=1.25, side=1.25)
    pair = pair_of([both], [turbine(0)], CONTEXT)
    (found,) = standing_of(pair, [both], [turbine(0)], CONTEXT, dict.fromkeys(pair.shown, 1.0), False)
    laws = shifts_of([both], [turbine(0)], CONTEXT)
    assert found.nats == pytest.approx(laws["tilt"].nats + laws["yaw"].nats)
    assert min(laws["tilt"].nats, laws["yaw"].nats) > 20


@pytest.mark.parametrize("detected", [False, True])
def test_a_thrust_that_differs_alone_is_thin_air_or_its_gauges(detected: bool) -> None:
    """A large rotor's wind at one point is too noisy for the law of the power: nothing was told of air 8 % thinner."""
    recording, run = turbine(15, thrust=0.93), turbine(0)
    assert names(recording, run, detected) == ([] if detected else [("air_density", "sensor_scale")])
    pair = pair_of([recording], [run], CONTEXT)
    for found in standing_of(pair, [recording], [run], CONTEXT, dict.fromkeys(pair.shown, 1.0), detected):
        value, std = found.told["air_density"]["density_change"]
        assert abs(value + 0.07) < 3 * std
        assert found.interval[0] > 0


def test_the_angle_refutes_a_density_only_where_the_wind_tells_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 15 MW air 8 % thinner was an offset of half a degree, sure, since the angle acted no less; the wind was not
    known well enough to tell either."""
    offset = Offset("pitch", "deg", -0.5, 0.1, 0.1)
    monkeypatch.setattr(standing, "offset_of", lambda *_: offset)
    thrust = ("air_density", "sensor_scale")
    for recording, nats, entries in (
        (turbine(11, 18.3, 0.9), -100.0, ("sensor_bias",)),
        (turbine(15, thrust=0.93), -100.0, ("sensor_bias", *thrust)),
        (turbine(15, thrust=0.93), 100.0, thrust),
    ):
        pair = pair_of([recording], [turbine(0)], CONTEXT)
        moved = dict.fromkeys(pair.shown, 1.0)
        found = standing_of(pair, [recording], [turbine(0)], CONTEXT, moved, False, stronger=lambda _, n=nats: n)
        assert [s.entries for s in found] == [entries]


def test_turbulence_over_the_disc_is_told_from_more_wind() -> None:
    run, recording = turbine(0), turbine(13, uneven=1.0)
    assert names(recording, run) == [("rotational_sampling",)]
    other = disc_of(pair_of([turbine(2)], [run], CONTEXT), CONTEXT)
    assert other is not None
    assert not other.is_sure


def test_laws_need_the_region_of_the_run() -> None:
    far = shifts_of([turbine(14, 26.0)], [turbine(0)], CONTEXT)
    assert "wind" not in far


def test_noise_of_channels_adds_to_the_moments() -> None:
    rng = np.random.default_rng(0)
    z = rng.standard_normal((20000, 3))
    gram = lagged_gram(z, 3, 1)
    noisy = lagged_gram(z + 0.3 * rng.standard_normal(z.shape), 3, 1)
    added = with_noise(gram, 0.3)
    # relative deviations of sums of 20,000 products are about 1/141
    np.testing.assert_allclose(np.diag(added.Z), np.diag(noisy.Z), rtol=0.05)
    np.testing.assert_allclose(np.diag(added.YY), np.diag(noisy.YY), rtol=0.05)
    assert added.Z[-1, -1] == gram.Z[-1, -1]


def test_words_of_simulators_are_of_the_catalogue_and_take_values() -> None:
    assert ("ROSCO", "PA_Mode = 1, PA_CornerFreq = 2.5 rad/s") in settings(
        "actuator_lag", "input:pitch", {"tau_s": 0.4}
    )
    assert all(s != "ROSCO" for s, _ in settings("actuator_lag", "input:torque_demand", {"tau_s": 0.4}))
    assert dict(settings("air_density", "rotor", {"density_change": -0.1}))["OpenFAST"].endswith(
        "0.9 times the present value"
    )
    assert settings("sensor_sign") == ()
    further = settings("structural_mode", "output:tower_acc_side_side", {"frequency_hz": 2.99, "damping": 0.03})
    assert [text for s, text in further if s == "OpenFAST"] == [
        "ElastoDyn: TwSSDOF2 = True (the tower's second side-side mode), if that swings at 2.99 Hz"
    ]
    assert settings("structural_mode", "output:pump_pressure", {"frequency_hz": 2.99}) == ()
    with_settings = [e.id for e in ENTRIES if e.settings]
    assert len(with_settings) > 30
    for name in with_settings:
        assert all("{" not in text for _, text in settings(name))


def test_the_least_size_is_where_the_evidence_falls_enough() -> None:
    def change(values: tuple[float, ...]) -> object:
        return NOTHING

    h = Hypothesis("actuator_lag", "input:u", ("tau_s",), ("s",), (0.0,), (1.0,), (), change)  # type: ignore[arg-type]
    # nats fall with the square: 60 at 0.2 s
    assert least_size(h, [((t,), -1500.0 * t * t) for t in (0.1, 0.3, 0.5)]) == pytest.approx(0.2)
    assert least_size(h, [((t,), -1500.0 * t * t) for t in (0.4, 0.8)]) == pytest.approx(
        0.4
    )  # no smaller one was tried
    assert least_size(h, [((0.1,), -2.0)]) is None
