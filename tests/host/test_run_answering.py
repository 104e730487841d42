"""How a rotor answers its pitch angle, on made turbines in a control loop: estimated without bias, told by its form."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.compiled import njit
from aeolid.diagnose.run_prior.answering import Seen, is_building_up, left_late, named, replicated, told_apart
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.responses import Answering, answering_of, fitted
from aeolid.diagnose.run_prior.shown import answers_of
from aeolid.record import Channel, Record
from aeolid.report.pair import sides

Array = NDArray[np.float64]
STEP, SAMPLES, SPEED = 0.05, 12_000, 1.267
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": SPEED}
CHANNELS = (
    Channel("pitch_demand", "deg", "input"), Channel("torque_demand", "kN m", "input"),
    Channel("rotor_speed", "rad/s", "output"),
    Channel("flap_moment_1", "kN m", "output"), Channel("flap_moment_2", "kN m", "output"),
    Channel("flap_moment_3", "kN m", "output"), Channel("azimuth", "rad", "azimuth"),
    Channel("pitch_excitation", "deg", "excitation"), Channel("torque_excitation", "kN m", "excitation"),
)  # fmt: skip
OF_PITCH = -3.0  # of the flap moment, a degree
BEND = (6.0, 0.7)  # rad/s and damping: 2 ζ Ω/ω = 0.30 rad late
LIFT = (0.8, 0.2, 0.006)  # a share that comes by a lag in s, and s² of the angle's acceleration: about 0.1 rad late


@njit(cache=True)
def _loop(
    wind: Array, excited: Array, torque: Array, gain: float, delay: int, bend: tuple[float, float],
    lift: tuple[float, float, float],
) -> Array:  # fmt: skip
    """Return pitch, speed and flap moment (N, 3) of a rotor whose speed a PI controller holds by the pitch angle."""
    out = np.zeros((len(wind), 3))
    speed, integral, late, rate = 0.0, 0.0, 0.0, 0.0
    at, to = np.zeros(2), np.zeros(2)  # the blades' bending and its rate, of wind and angle
    for k in range(len(wind)):
        integral += STEP * speed
        out[k, 0] = 12 * speed + 3 * integral + excited[k]
        angle = out[max(k - delay, 0), 0]
        if lift[0] > 0:
            late += STEP / lift[1] * (angle - late)
            now = (angle - out[max(k - delay - 1, 0), 0]) / STEP
            angle, rate = (1 - lift[0]) * angle + lift[0] * late + lift[2] * (now - rate) / STEP, now
        drive = np.array([gain * wind[k], gain * angle])
        if bend[0] > 0:
            for _ in range(5):  # small steps: the explicit rule is stable
                to += STEP / 5 * (bend[0] ** 2 * (drive - at) - 2 * bend[0] * bend[1] * to)
                at += STEP / 5 * to
            drive = at.copy()
        speed += STEP * (0.05 * drive[0] - 0.04 * drive[1] - 0.05 * speed + 0.01 * torque[k])
        out[k, 1], out[k, 2] = speed, 4 * drive[0] + OF_PITCH * drive[1]
    return out


def coloured(rng: np.random.Generator, tau: float, size: float) -> Array:
    """Return a first-order process of that time constant in s and deviation."""
    a = float(np.exp(-STEP / tau))
    out: Array = lfilter([size * np.sqrt(1 - a * a)], [1.0, -a], rng.standard_normal(SAMPLES))
    return out


@cache
def turbine(
    seed: int, gain: float = 1.0, delay: int = 0, bend: tuple[float, float] = (0.0, 0.0),
    lift: tuple[float, float, float] = (0.0, 1.0, 0.0), samples: int = SAMPLES,
) -> Record:  # fmt: skip
    """Return a recording of 600 s in wind that the loop answers, with an excitation on both demands."""
    rng = np.random.default_rng(seed)
    wind, excited, torque = (coloured(rng, tau, size) for tau, size in ((5.0, 1.0), (0.3, 0.4), (0.3, 1.0)))
    pitch, speed, flap = _loop(wind, excited, torque, gain, delay, bend, lift).T
    azimuth = np.cumsum(SPEED + speed) * STEP
    noise = 0.02 * rng.standard_normal((SAMPLES, 4))
    outputs = np.column_stack([speed, flap, flap, flap]) + noise * [0.01, 1, 1, 1]
    values = np.column_stack([pitch, torque, outputs, azimuth, excited, torque])[:samples]
    return Record(STEP * np.arange(samples), values, CHANNELS, STEP, f"turbine {seed}", "")


def answers(recording: Record, run: Record) -> Answering:
    """Return how both sides answer."""
    found = answering_of(pair_of([recording], [run], CONTEXT), [recording], [run], CONTEXT, 0.7)
    assert found is not None
    return found


def entries(recording: Record, run: Record, still: bool | None = True) -> tuple[str, ...]:
    """Return what is named."""
    pair = pair_of([recording], [run], CONTEXT)
    found = named(pair, answering_of(pair, [recording], [run], CONTEXT, 0.7), still)
    return () if found is None else found.entries


def test_the_loop_does_not_bend_the_responses() -> None:
    """The flap moment is -3 of the angle. Inputs as their own instruments take the loop's answer to wind for more."""
    recording = turbine(1)
    free = answers(recording, turbine(2))
    place = 1  # the flap moments' mean, behind the speed
    H, deviation = free.whole.H[:, 0, place], np.sqrt(free.whole.V[:, 0, place])
    assert np.sqrt(np.mean(np.abs((H - OF_PITCH) / deviation) ** 2)) < 1.5  # near 1, of 15 to 20 complex values
    values = recording.values.copy()
    values[:, -2:] = values[:, :2]
    bent = answers(replace(recording, values=values), turbine(2)).whole.H[0, 0, place]
    assert abs(bent - OF_PITCH) > 5 * abs(H[0] - OF_PITCH)
    assert abs(bent - OF_PITCH) > 2 * deviation[0]


@pytest.mark.parametrize("delay", [1, 3])
def test_a_delay_and_a_gain_are_told_with_their_deviations(delay: int) -> None:
    found = answers(turbine(3, 1.2, delay), turbine(4))
    slow = found.orders < 6
    fit = fitted(found.whole, found.run, slow, found.orders, found.hz, (0, [1]), 0.0)
    assert abs(fit.delay_s - delay * STEP) < 4 * fit.delay_std_s
    assert abs(fit.gain[0] - np.log(1.2)) < 4 * fit.gain_std[0]
    assert fit.delay_std_s < 0.02


@pytest.mark.parametrize("seed", range(10, 18))
def test_other_wind_is_no_other_answer(seed: int) -> None:
    """Less than 12 nats on the sealed part: a sum of 20 halves of χ² less their mean has a deviation of 4.5."""
    recording, run = turbine(seed), turbine(seed + 1)
    assert entries(recording, run) == ()
    assert replicated(answers(recording, run), 0, [1, 0]) < 12


@pytest.mark.parametrize(
    ("recording", "name"),
    [
        (turbine(21, bend=BEND), "blade_flap"),
        (turbine(22, lift=LIFT), "unsteady_aero"),
        (turbine(23, gain=1.2), "dynamic_inflow"),
    ],
)
def test_a_form_is_told_and_foretells_the_sealed_part(recording: Record, name: str) -> None:
    run = turbine(0)
    assert entries(recording, run) == (name,)
    assert replicated(answers(recording, run), 0, [1, 0]) > 10


def test_a_stronger_answer_is_a_wake_only_where_levels_stand_still() -> None:
    """Denser air is as strong, and moves the levels; without a recorded wind both names remain."""
    recording, run = turbine(23, gain=1.2), turbine(0)
    assert entries(recording, run, None) == ("dynamic_inflow", "air_density")
    assert entries(recording, run, False) == ()


@pytest.mark.parametrize(
    ("recording", "told"), [(turbine(21, bend=BEND), True), (turbine(22, lift=LIFT), False), (turbine(10), False)]
)
def test_a_rotor_later_than_lift_can_be_has_blades_that_bend(recording: Record, told: bool) -> None:
    """Whatever wind's loads show; asked where no drive explains it."""
    pair = pair_of([recording], [turbine(0)], CONTEXT)
    found = left_late(pair, answers(recording, turbine(0)))
    assert (found is not None) is told
    assert found is None or (found.entries == ("blade_flap",) and "no drive" in found.words["blade_flap"])


def test_a_late_command_alone_is_neither_blade_nor_lift() -> None:
    """Late answers of the angle alone, behind which wind's loads are as before, are a drive's or a delay's."""
    for delay in (1, 4):
        assert entries(turbine(24, delay=delay), turbine(0)) == ()


@pytest.mark.parametrize(
    ("late", "quick", "told"),
    [(0.046, 0.59, True), (0.095, 0.53, True), (0.034, -0.05, False), (0.01, 0.59, False), (0.16, 0.59, False)],
)
def test_lift_of_slender_blades_is_late_by_little_and_strong_when_quick(late: float, quick: float, told: bool) -> None:
    """Seen on rotors of 15 and 2.8 MW, a null, and what only one of both shows."""
    seen = Seen(late, 0.016, 0.29, 0.04, 0.1, quick, 0.12, 2.3, 0.7, 0.14)
    assert is_building_up(seen) == told


@pytest.mark.parametrize(("gain", "told"), [(0.319, True), (0.0, False), (-0.3, False)])
def test_lift_that_builds_up_is_weaker_in_the_whole(gain: float, told: bool) -> None:
    """Seen on blades of 100 m at 5 MW: late by 3.1 and quick by 2.9 deviations, all answers stronger by 6.7."""
    assert is_building_up(Seen(0.0514, 0.0168, gain, 0.047, 0.01, 0.719, 0.251, 0.69, 0.61, 0.14)) == told


def test_single_missing_samples_do_not_hide_what_is_told() -> None:
    whole = turbine(21, bend=BEND)
    values = whole.values.copy()
    values[::15, 3] = np.nan
    assert entries(replace(whole, values=values), turbine(0)) == entries(whole, turbine(0)) != ()


def test_what_is_not_recorded_tells_nothing() -> None:
    """No excitation, one that stands still, many samples missing, a recording too short for its sealed part."""
    run, whole = turbine(0), turbine(21, bend=BEND)
    still, gaps = whole.values.copy(), whole.values.copy()
    still[:, -1] = 0.0
    gaps[::15, 3] = gaps[1::15, 3] = np.nan
    roles = tuple(replace(c, role="scheduling") if c.role == "excitation" else c for c in CHANNELS)
    for other in (
        replace(whole, channels=roles), replace(whole, values=still), replace(whole, values=gaps),
        turbine(21, bend=BEND, samples=3000),
    ):  # fmt: skip
        assert entries(other, run) == ()


@pytest.mark.parametrize(("every", "bands"), [(8, True), (40, False)])
def test_rare_samples_are_compared_as_far_as_they_reach(every: int, bands: bool) -> None:
    """At 0.4 s bands reach to five revolutions, above which nothing is told; at 2 s there are none worth the name."""
    slow = [thinned(r, every) for r in (turbine(21, bend=BEND), turbine(0))]
    pair = pair_of(slow[:1], slow[1:], CONTEXT)
    found = answering_of(pair, slow[:1], slow[1:], CONTEXT, 0.7)
    assert (found is not None) == bands
    assert named(pair, found, True) is None
    assert not bands or found is None or found.orders.max() < 5


def thinned(record: Record, every: int) -> Record:
    """Return every n-th sample."""
    return replace(record, values=record.values[::every], time_s=record.time_s[::every], sample_time_s=every * STEP)


def test_several_regions_and_runs_left_out_are_not_mixed() -> None:
    """Answers of a rotor go with the wind: means over other winds on either side are none of one rotor."""
    near, far = turbine(21, bend=BEND), turbine(25)
    values = far.values.copy()
    values[:, 0] += 12.0  # another pitch angle: another region
    far = replace(far, values=values)
    for recordings, runs in (([near], [turbine(0), far]), ([near, far], [turbine(0), far])):
        pair = pair_of(recordings, runs, CONTEXT)
        assert answering_of(pair, recordings, runs, CONTEXT, 0.7) is None


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (turbine(26), "the answers to pitch_demand and torque_demand differ by no more than other wind makes them"),
        (turbine(27, delay=4), r"the answers to pitch_demand \(\d+ nats on the test data\) differ, those to torque"),
    ],
)  # fmt: skip
def test_what_has_no_name_is_told_by_input(recording: Record, said: str) -> None:
    pair = pair_of([recording], [turbine(0)], CONTEXT)
    assert re.match(said, told_apart(pair, answers(recording, turbine(0))))
    assert told_apart(pair, None) == ""


@pytest.mark.parametrize(
    ("columns", "change"),
    [
        (slice(-1, None), lambda x, noise: 1e-9 * x),
        (slice(-2, -1), lambda x, noise: noise),  # an excitation that excites nothing
        (slice(3, 6), lambda x, noise: 1e9 * x),  # a gain whose exponential would be none
        (slice(2, 6), lambda x, noise: noise),  # outputs that answer nothing
    ],
)
def test_odd_channels_end_in_numbers(columns: slice, change: Callable[[Array, Array], Array]) -> None:
    values = turbine(28).values.copy()
    x = values[:, columns]
    values[:, columns] = change(x, np.random.default_rng(0).standard_normal(x.shape))
    recording, run = replace(turbine(28), values=values), turbine(0)
    pair = pair_of([recording], [run], CONTEXT)
    found = answers(recording, run)
    assert named(pair, found, True) is None
    assert "differ" in told_apart(pair, found)


def test_the_page_shows_what_the_answers_are() -> None:
    """A picture with a column an output; a ratio of 1.2 stands as 1.2 within its deviations."""
    recording, run = turbine(23, gain=1.2), turbine(0)
    pair = pair_of([recording], [run], CONTEXT)
    facts = answers_of(pair, answers(recording, run))
    flap = facts["answers"]["outputs"][0]
    assert flap["output"] == "flap_moment_collective"
    z = np.log(np.array(flap["gain"]) / 1.2) / np.array(flap["std"])
    assert np.sqrt(np.mean(z**2)) < 1.6  # near 1, of 16 bands
    json.dumps(facts, allow_nan=False)
    page = str(sides({**facts, "modes": {}}))
    assert page.count("<svg") == 1
    assert "flap_moment_collective" in page
    assert answers_of(pair, None) == {}
