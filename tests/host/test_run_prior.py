"""The run of a simulator as prior of the recording: laws of its parts, and pairs of a rig with two modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior import operators as op
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.conclude import diagnosis_of, study_run
from aeolid.diagnose.run_prior.evidence import evidence_at, posterior, prior_of
from aeolid.diagnose.run_prior.grams import Moments, lagged_gram
from aeolid.diagnose.run_prior.hypotheses import all_hypotheses
from aeolid.diagnose.run_prior.search import Search
from aeolid.models.multiblade import fixed_frame
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, SAMPLES, WEAK = 0.05, 8000, 0.02


def test_moments_are_those_of_the_windows_themselves() -> None:
    rng = np.random.default_rng(0)
    n, m, p, r = 200, 4, 5, 2
    z, added = rng.standard_normal((n, m)), rng.standard_normal((n, 2))
    gram = lagged_gram(z, p, r, added)
    rows = np.hstack([*[z[p - i : n - i] for i in range(1, p + 1)], z[p:, :r], np.ones((n - p, 1)), added[p:]])
    targets = z[p:, r:]
    for found, expected in ((gram.Z, rows.T @ rows), (gram.ZY, rows.T @ targets), (gram.YY, targets.T @ targets)):
        np.testing.assert_allclose(found, expected, atol=1e-11 * n)  # sums of n products of unit size
    parts = lagged_gram(z[: 100 + p], p, r) + lagged_gram(z[100:], p, r)
    np.testing.assert_allclose(parts.Z, lagged_gram(z, p, r).Z, atol=1e-11 * n)


def test_the_posterior_lies_between_run_and_recording() -> None:
    rng = np.random.default_rng(1)
    z = rng.standard_normal((4000, 3))
    for k in range(1, len(z)):
        z[k, 2] += 0.5 * z[k - 1, 0]
    run, recording = lagged_gram(z[:2000], 3, 2), lagged_gram(z[2000:], 3, 2)
    prior = prior_of(Moments((run,)), np.full(len(run.Z) - 1, 1e-6))
    own = np.linalg.solve(recording.Z, recording.ZY)
    one = Moments((recording,))
    np.testing.assert_allclose(posterior(prior, one, 1e-9)[0][:-1], own[:-1], atol=1e-3)
    # of one law: trusting the run is worth more nats than leaving it
    assert evidence_at(prior, one, 1.0) > evidence_at(prior, one, 1e-4)
    # regions of operation are independent: their evidence adds up
    assert evidence_at(prior * 2, Moments((recording, recording)), 0.3) == pytest.approx(
        2 * evidence_at(prior, one, 0.3), rel=1e-12
    )


def test_operators_do_what_they_say() -> None:
    t = STEP * np.arange(400)
    ramp = 2.0 * t
    # a lag follows a ramp at the distance slope · tau once it has settled
    assert (ramp - op.first_order(ramp, 0.5, STEP))[-1] == pytest.approx(1.0, abs=1e-9)
    assert (ramp - op.first_order_of_past(ramp, 0.5, STEP))[-1] == pytest.approx(1.0, abs=1e-9)
    # a second-order drive at slope · 2 ζ/ω
    assert (ramp - op.second_order(ramp, 4.0, 0.7, STEP))[-1] == pytest.approx(2.0 * 2 * 0.7 / 4.0, abs=1e-6)
    np.testing.assert_allclose(op.delayed(ramp, 3 * STEP, STEP)[10:], ramp[7:-3], atol=1e-9)
    # a resonance that is moved to where another system has it is that system, behind transients from rest
    noise = np.random.default_rng(3).standard_normal(2000)
    noise -= noise.mean()
    noise[0] = 0.0
    one, other = (3.0, 0.2), (4.0, 0.3)
    there = op.resonance_moved(op.second_order(noise, *one, STEP), one, other, STEP)
    found, expected = (x[1000:] - x[1000:].mean() for x in (there, op.second_order(noise, *other, STEP) * (3 / 4) ** 2))
    np.testing.assert_allclose(found, expected, atol=0.02 * expected.std())  # white noise has no spline
    wave = np.sin(t)
    # of a wave with 42 samples a period the answer is known; splines err by some (ω h)⁴, lines by (ω h)²/12
    fast, tau = 3.0, 0.2
    answer = np.imag(np.exp(1j * fast * t) / (1 + 1j * fast * tau))
    angle = fast * STEP
    for operator, room in ((op.first_order, angle**4 / 100), (op.first_order_of_past, angle**2 / 8)):
        assert np.abs(operator(np.sin(fast * t), tau, STEP) - answer)[200:-5].max() < room
    # what comes later changes nothing of an output's filter
    cut = np.where(t < t[300], wave, 5.0)
    np.testing.assert_array_equal(*(op.first_order_of_past(x, tau, STEP)[:300] for x in (wave, cut)))
    assert np.ptp(op.play(wave, 0.5)[100:]) == pytest.approx(np.ptp(wave) - 0.5, abs=1e-3)
    # a dead band holds until the command has moved by its width, as the catalogue and a corrected model have it
    stood = op.dead_band(wave, 0.5)
    assert 0.5 - 0.05 < np.abs(wave - stood).max() <= 0.5
    assert np.abs(np.diff(op.rate_limited(wave, 0.3, STEP))).max() <= 0.3 * STEP + 1e-12


def test_loads_that_turn_with_the_rotor_stand_still_in_the_fixed_frame() -> None:
    azimuth = np.linspace(0, 40, 500)
    blades = np.column_stack([3.0 + 2.0 * np.cos(azimuth + 2 * np.pi * i / 3) for i in range(3)])
    still = fixed_frame(blades, azimuth, ((0, 1, 2),))
    np.testing.assert_allclose(still, np.tile([3.0, 2.0, 0.0], (500, 1)), atol=1e-12)


@cache
def rig(
    seed: int, *, lag: float = 0.0, width: float = 0.0, stiff: bool = False, spring: float = 48.0, loss: float = 0.5,
    level: float = 0.0, held: float = 1.6, gust: float = 0.02, omega: float = 0.0,
) -> Record:  # fmt: skip
    """Return a recording of two modes under feedback: input force, outputs speed and acceleration.

    lag in s, play in N and a second-order drive (omega in rad/s, damping 0.7) lie between command and force; stiff
    leaves the second mode (1.1 Hz) out, spring (1/s²) and loss (1/s) are its own. level: mean force in N; held: spring
    of the first mode in 1/s²; gust: steps of the
    wind in N; one above WEAK is recorded, too.
    """
    rng = np.random.default_rng(seed)
    fine = 5
    h = STEP / fine
    A = np.array([[0, 1, 0, 0], [-held, -0.25, 0.4, 0.0], [0, 0, 0, 1], [0.0 if stiff else 2.0, 0, -spring, -loss]])
    gain = 0.0 if stiff else 1.0
    B = np.array([[0.0], [1.0], [0.0], [6.0 * gain]])
    M = np.zeros((5, 5))
    M[:4, :4], M[:4, 4:] = A * h, B * h
    E = expm(M)
    F, G = E[:4, :4], E[:4, 4]
    drive = expm(np.array([[0.0, 1.0], [-(omega**2), -1.4 * omega]]) * h)
    acting = felt = quick = slow = wind = target = 0.0
    x = np.zeros(4)
    follows = 1.0 if lag == 0.0 else 1 - float(np.exp(-h / lag))
    u, y, d = np.empty(SAMPLES), np.empty((SAMPLES, 2)), np.empty(SAMPLES)
    for k in range(SAMPLES * fine):
        if k % (4 * fine) == 0:
            target = level + float(rng.choice([-1.0, 1.0]))
        wind = 0.99 * wind + gust * rng.standard_normal()
        slow += h / 0.08 * (target - slow)  # the excitation is smooth, as a controller's output is
        command = slow - 0.3 * x[1]
        acting = min(max(acting, command - width / 2), command + width / 2)
        if omega:
            felt, quick = drive @ (felt - acting, quick) + (acting, 0.0)  # the command held over the step
        else:
            felt += follows * (acting - felt)
        if k % fine == 0:
            u[k // fine], d[k // fine] = command, wind
            y[k // fine] = x[1] + 0.3 * x[3], -held * x[0] - spring * x[2] + felt + wind
        x = F @ x + G * (felt + wind)
    y += rng.standard_normal(y.shape) * np.array([2e-3, 2e-2])
    channels: tuple[Channel, ...] = (
        Channel("force", "N", "input"),
        Channel("speed", "m/s", "output"),
        Channel("acc", "m/s^2", "output"),
    )
    columns = [u, y]
    if gust > WEAK:
        columns, channels = [u, y, d], (*channels, Channel("wind", "N", "disturbance"))
    return Record(STEP * np.arange(SAMPLES), np.column_stack(columns), channels, STEP, f"rig {seed}", "")


def told(recording: Record | Sequence[Record], run: Record | Sequence[Record]) -> dict[str, object]:
    """Return the diagnosis of a pair."""
    recordings, runs = ([x] if isinstance(x, Record) else x for x in (recording, run))
    study = study_run(recordings, runs, {}, lambda text, share: None, unlimited())
    return diagnosis_of(study, "rig", {"force": "N", "speed": "m/s", "acc": "m/s^2"})


def test_runs_of_one_machine_in_other_wind_lack_nothing() -> None:
    found = told(rig(2), rig(1))
    assert found["verdict"] == "no_mismatch", found["statement"]


def test_a_lag_is_named_with_its_value() -> None:
    found = told(rig(3, lag=0.15), rig(1))
    effect = found["effects"][0]  # type: ignore[index]
    assert (found["verdict"], effect["id"]) == ("named", "actuator_lag"), found["statement"]
    value = effect["parameters"]["tau_s"]
    assert abs(value["value"] - 0.15) < min(0.1 * 0.15 + 2e-3, 3 * value["std"])


def test_play_is_named_and_no_lag() -> None:
    found = told(rig(4, width=0.3), rig(1))
    effect = found["effects"][0]  # type: ignore[index]
    assert (found["verdict"], effect["id"]) == ("named", "backlash"), found["statement"]
    value = effect["parameters"]["width"]
    assert abs(value["value"] - 0.3) < 0.1 * 0.3


def test_a_mode_that_the_simulation_lacks_is_named() -> None:
    found = told(rig(5), rig(6, stiff=True))
    effect = found["effects"][0]  # type: ignore[index]
    assert (found["verdict"], effect["id"]) == ("named", "structural_mode"), found["statement"]
    assert effect["parameters"]["frequency_hz"]["value"] == pytest.approx(np.sqrt(48.0) / (2 * np.pi), rel=0.02)


@pytest.mark.parametrize(
    ("spring", "loss", "entries"),
    [
        (40.0, 0.5, {"stiffness_change", "added_mass"}),
        pytest.param(48.0, 1.2, {"damping_change"}, marks=pytest.mark.nightly),
    ],
)
def test_a_mode_that_moved_is_named_with_its_frequency(spring: float, loss: float, entries: set[str]) -> None:
    found = told(rig(7, spring=spring, loss=loss), rig(1))
    effect = found["effects"][0]  # type: ignore[index]
    assert effect["id"] in entries, found["statement"]
    value = effect["parameters"]["frequency_hz"]
    assert value["value"] == pytest.approx(np.sqrt(spring) / (2 * np.pi), rel=0.02)


def test_a_second_effect_beside_a_mode_that_the_simulation_lacks() -> None:
    found = told(rig(8, lag=0.15), rig(6, stiff=True))
    ids = {e["id"] for e in found["effects"]}  # type: ignore[attr-defined]
    assert "structural_mode" in ids
    assert ids <= {"structural_mode", "actuator_lag"}, found["statement"]


def test_a_window_holds_the_slowest_mode() -> None:
    pair = pair_of([rig(2)], [rig(1)], {})
    assert pair.past * pair.block_s > 2 * np.pi / np.sqrt(1.6)


def low_and_high(first_seed: int, lag: float = 0.0) -> list[Record]:
    """Return recordings at two levels of the force, at which the first mode is another one."""
    return [rig(first_seed, lag=lag), rig(first_seed + 1, lag=lag, level=6.0, held=4.0)]


def test_each_region_of_operation_has_a_predictor_of_its_own() -> None:
    pair = pair_of(low_and_high(20), low_and_high(10), {})
    assert [s.region for s in (*pair.recordings, *pair.runs)] == [0, 1, 0, 1]
    assert Search(pair).lost < 0.5 * in_force().run_prior.lost_nats
    # in one region the same machine does not foretell itself: two modes are not one
    swapped = pair_of(low_and_high(20), [rig(10), rig(11)], {})
    assert [s.region for s in swapped.runs] == [0, 0]
    assert Search(swapped).lost > 10 * in_force().run_prior.lost_nats


@pytest.mark.nightly  # by day each region has a predictor of its own
def test_an_effect_at_two_wind_speeds_is_one_effect() -> None:
    found = told(low_and_high(30, lag=0.15), low_and_high(10))
    effect = found["effects"][0]  # type: ignore[index]
    assert (found["verdict"], effect["id"]) == ("named", "actuator_lag"), found["statement"]
    value = effect["parameters"]["tau_s"]
    assert abs(value["value"] - 0.15) < min(0.1 * 0.15 + 2e-3, 3 * value["std"])


def test_a_run_that_nothing_was_recorded_near_is_left_out() -> None:
    pair = pair_of([rig(2)], low_and_high(10), {})
    assert len(pair.runs) == len(pair.offset) == 1


def test_recorded_wind_makes_an_effect_easier_to_see() -> None:
    with_wind = [rig(40, lag=0.05, gust=0.2)], [rig(41, gust=0.2)]
    bare = tuple([without_wind(r) for r in side] for side in with_wind)
    gains = []
    for recordings, runs in (with_wind, bare):
        pair = pair_of(recordings, runs, {})
        lag = next(h for h in all_hypotheses(pair, {}) if h.entry == "actuator_lag")
        gains.append(Search(pair).gain(lag, (0.05,))[0])
        assert not any("wind" in h.place for h in all_hypotheses(pair, {}))
    assert gains[0] > 2 * gains[1]


def without_wind(r: Record) -> Record:
    return replace(r, values=r.values[:, :3], channels=r.channels[:3])
