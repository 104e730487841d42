"""Check modes, prediction, frequency response, decimation and model loading against independent references."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, signal

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.decimate import decimate
from aeolid.identify.frequency import frequency_response
from aeolid.models.load import LinearModel, discretise, load_model, matched
from aeolid.models.model_file import Signal
from aeolid.models.modes import mark_harmonics, modes_of
from aeolid.models.prediction import complete_stretches, estimate_initial_state, free_run, nrmse, predict, vaf
from aeolid.models.state_space import StateSpace
from aeolid.plants.hawt import build_turbine, simulate_closed_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Channel, Record


def oscillator(frequency_hz, damping, h):
    w = 2 * np.pi * frequency_hz
    A = linalg.expm(h * np.array([[0, 1], [-(w**2), -2 * damping * w]]))
    return StateSpace(
        A, np.zeros((2, 1)), np.array([[1.0, 0]]), np.zeros((1, 1)), None, np.zeros(2), None, h,
        (Signal("u"),), (Signal("y"),), (Signal("x"), Signal("v")),
    )  # fmt: skip


@pytest.mark.parametrize("frequency, damping", [(0.335, 0.084), (1.674, 0.025), (0.05, 0.7)])
def test_modes_of_a_known_oscillator(frequency, damping):
    (mode,) = modes_of(oscillator(frequency, damping, 0.05))
    assert mode.frequency_hz == pytest.approx(frequency, rel=1e-9)
    assert mode.damping == pytest.approx(damping, rel=1e-9)
    assert mode.frequency_std_hz is None and mode.shares == {"y": 1.0}


def test_mode_deviations_equal_a_monte_carlo_over_the_pole():
    model = oscillator(0.335, 0.08, 0.1)
    values = np.linalg.eigvals(model.A)
    covariance = np.array([[4e-8, 1e-8], [1e-8, 9e-8]])
    (mode,) = modes_of(model, pole_covariance=np.array([covariance, covariance * [[1, -1], [-1, 1]]]))
    up = values[values.imag > 0][0]
    drawn = np.random.default_rng(0).multivariate_normal([up.real, up.imag], covariance, 40000)
    s = np.log(drawn[:, 0] + 1j * drawn[:, 1]) / 0.1
    assert mode.frequency_std_hz == pytest.approx(np.std(abs(s)) / (2 * np.pi), rel=0.03)
    assert mode.damping_std == pytest.approx(np.std(-s.real / abs(s)), rel=0.03)


def test_real_and_integrating_poles_are_modes_too():
    model = replace(oscillator(1, 0.1, 0.1), A=np.diag([1.0, 0.5]))
    slow, fast = modes_of(model)
    assert (slow.frequency_hz, slow.damping) == (0.0, 0.0)
    assert fast.damping == pytest.approx(1.0)
    assert fast.frequency_hz == pytest.approx(np.log(2) / 0.1 / (2 * np.pi))


def test_lightly_damped_modes_on_rotor_multiples_are_marked():
    modes = [modes_of(oscillator(f, d, 0.05))[0] for f, d in ((0.4035, 0.003), (0.335, 0.003), (0.6, 0.3))]
    assert [m.rotor_order for m in mark_harmonics(modes, 0.2017)] == [2, None, None]


def test_prediction_at_every_horizon_equals_the_plain_recursion():
    model, record = fourth_order(), simulate_fourth_order(300, 4, feedback=0.25)
    u, y = record.matrix("input"), record.matrix("output")
    x0 = np.array([0.3, -0.2, 0.1, 1.0])
    for steps in (1, 2, 5, 40):
        expected = np.empty_like(y)
        for k in range(len(y)):
            x, start = x0.copy(), max(k - steps + 1, 0)
            for i in range(start):  # filter up to the last sample that may be used
                x = model.A @ x + model.B @ u[i] + model.K @ (y[i] - model.C @ x)
            for i in range(start, k):
                x = model.A @ x + model.B @ u[i]
            expected[k] = model.C @ x
        np.testing.assert_allclose(predict(model, u, y, steps, x0), expected, atol=1e-9)


def test_one_step_errors_of_the_true_model_are_its_innovations():
    model, record = fourth_order(), simulate_fourth_order(20000, 5)
    error = record.matrix("output") - predict(model, record.matrix("input"), record.matrix("output"))
    np.testing.assert_allclose(np.cov(error.T), np.eye(2), atol=0.04)


def test_initial_state_is_recovered_from_noise_free_data_with_offsets():
    base = fourth_order()
    model = replace(
        base, inputs=(Signal("u1", "", 3.0), Signal("u2")), outputs=(Signal("y1", "", -7.0), Signal("y2")), K=None
    )
    u = np.random.default_rng(0).standard_normal((100, 2)) + np.array([3.0, 0.0])
    x0 = np.array([1.0, -2.0, 0.5, 3.0])
    y = free_run(model, u, x0)
    np.testing.assert_allclose(estimate_initial_state(model, u - model.u_offset, y - model.y_offset), x0, atol=1e-8)
    np.testing.assert_allclose(y, model.simulate(u, x0), atol=1e-12)


def test_scores_by_definition():
    y = np.array([[1.0], [2.0], [3.0], [4.0]])
    assert vaf(y, y + 5.0)[0] == pytest.approx(100.0)  # an offset is no variance
    assert nrmse(y, y + 1.0)[0] == pytest.approx(1 / y.std())
    assert nrmse(y, np.full_like(y, y.mean()))[0] == pytest.approx(1.0)


def test_complete_stretches():
    values = np.zeros((12, 2))
    values[[3, 7], [0, 1]] = np.nan
    assert complete_stretches(values, 1) == [(0, 3), (4, 7), (8, 12)]
    assert complete_stretches(values, 4) == [(8, 12)]
    assert complete_stretches(np.full((3, 1), np.nan), 1) == []


def test_frequency_response_equals_scipy():
    model = fourth_order()
    f = np.geomspace(1e-3, 0.499, 50)
    found = frequency_response(model, f)
    for j in range(2):
        b, a = signal.ss2tf(model.A, model.B, model.C, model.D, input=j)
        for i in range(2):
            _, expected = signal.freqz(b[i], a, worN=2 * np.pi * f)
            np.testing.assert_allclose(found.response[:, i, j], expected, rtol=1e-8)
    assert found.magnitude_db.shape == found.phase_deg.shape == (50, 2, 2)
    assert not frequency_response(build_turbine().model()).response[:, 1, 1].any()  # torque leaves fore-aft alone


def test_noise_response_is_one_plus_gain_path():
    model = fourth_order()
    z = np.exp(2j * np.pi * 0.1)
    expected = np.eye(2) + model.C @ np.linalg.inv(z * np.eye(4) - model.A) @ model.K
    np.testing.assert_allclose(frequency_response(model, np.array([0.1]), noise=True).response[0], expected)


def sines(frequencies, h, samples):
    t = np.arange(samples) * h
    values = np.column_stack([np.sin(2 * np.pi * f * t + 0.3) for f in frequencies] + [np.mod(40 * t, 360.0)])
    names = [*(Channel(f"y{i}", "", "output") for i in range(len(frequencies))), Channel("azimuth", "deg", "azimuth")]
    return Record(t, values, tuple(names), h, "sines", "")


def test_decimation_keeps_what_is_below_and_removes_what_would_alias():
    record = sines([0.5, 1.5, 3.6], 0.05, 4000)
    low = decimate(record, 4)  # new Nyquist frequency 2.5 Hz
    assert low.sample_time_s == pytest.approx(0.2)
    t = low.time_s
    np.testing.assert_allclose(low.values[:, 0], np.sin(2 * np.pi * 0.5 * t + 0.3), atol=2e-3)
    np.testing.assert_allclose(low.values[:, 1], np.sin(2 * np.pi * 1.5 * t + 0.3), atol=2e-3)
    assert np.max(abs(low.values[:, 2])) < 2e-3
    difference = np.mod(low.values[:, 3] - np.mod(40 * t, 360.0) + 180, 360.0) - 180
    assert np.max(abs(difference)) < 0.5


def test_decimation_keeps_a_gap_local_and_refuses_nonsense():
    record = sines([0.5], 0.05, 4000)
    record.values[2000, 0] = np.nan
    low = decimate(record, 4)
    missing = np.flatnonzero(np.isnan(low.values[:, 0]))
    assert len(missing) and np.all(abs(low.time_s[missing] - record.time_s[2000]) <= 80 * 0.05)
    assert decimate(record, 1) is record
    with pytest.raises(UsageError):
        decimate(record, 0)
    with pytest.raises(NotIdentifiable, match="decimation by 100 needs at least"):
        decimate(record, 100)


def test_model_file_round_trip_and_simulation(tmp_path):
    model = build_turbine().model()
    path = tmp_path / "model.json"
    path.write_text(json.dumps(model.to_json()))
    loaded = load_model(path)
    record = simulate_closed_loop(400, 2)
    np.testing.assert_allclose(loaded.simulate(record), model.simulate(record.matrix("input")), atol=1)
    assert isinstance(load_model(tmp_path), LinearModel)
    zero = replace(loaded, initial="zero").simulate(record)
    np.testing.assert_array_equal(zero, model.simulate(record.matrix("input")))


def test_unit_that_differs_names_both_units(tmp_path):
    model = build_turbine().model()
    record = simulate_closed_loop(50, 2)
    wrong = replace(record, channels=(replace(record.channels[0], unit="rad"), *record.channels[1:]))
    with pytest.raises(DataError, match=r"'pitch' is in 'rad', the model has it in 'deg'"):
        LinearModel(model).simulate(wrong)
    with pytest.raises(DataError, match="'pitch' is missing"):
        matched(replace(record, values=record.values[:, 1:], channels=record.channels[1:]), model.inputs)


def test_missing_input_and_other_sample_time_are_refused():
    model = LinearModel(build_turbine().model())
    record = simulate_closed_loop(50, 2)
    record.values[7, 1] = np.nan
    with pytest.raises(DataError, match="'generator_torque' is missing at sample 8"):
        model.simulate(record)
    with pytest.raises(DataError, match=r"sample time 0\.2 s, the model has 0\.1 s"):
        model.simulate(replace(simulate_closed_loop(50, 2), sample_time_s=0.2))


def test_continuous_time_model_is_held_over_a_sample():
    """x' = −2x + 2u from rest under a unit step is 1 − exp(−2t)."""
    one = (Signal("u"),), (Signal("y"),), (Signal("x"),)
    A, B = np.array([[-2.0]]), np.array([[2.0]])
    model = StateSpace(A, B, np.eye(1), np.zeros((1, 1)), None, np.zeros(1), None, 0.0, *one)
    t = np.arange(30) * 0.1
    record = Record(t, np.ones((30, 1)), (Channel("u", "", "input"),), 0.1, "step", "")
    np.testing.assert_allclose(LinearModel(model).simulate(record)[:, 0], 1 - np.exp(-2 * t), atol=1e-12)
    assert discretise(build_turbine().model(), 0.3).sample_time_s == 0.1


@pytest.mark.parametrize("content, error", [("{", DataError), ("[]", DataError), ('{"kind": "other"}', DataError)])
def test_broken_model_files_are_refused(tmp_path, content, error):
    path = tmp_path / "model.json"
    path.write_text(content)
    with pytest.raises(error, match=r"model\.json"):
        load_model(path)
    with pytest.raises(UsageError):
        load_model(tmp_path / "model.txt")


@pytest.mark.parametrize("offset", ["high", None, float("nan"), [1]])
@pytest.mark.parametrize("scheduling", [None, {"channels": ["wind"], "first_is_one": True}])
def test_offset_that_is_not_a_number_is_refused(tmp_path, offset, scheduling):
    content = oscillator(0.3, 0.1, 0.1).to_json() | {"scheduling": scheduling}
    content["inputs"] = [{"name": "u", "offset": offset}]
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"model\.json: inputs\[0\] has offset .*, a finite number is needed"):
        load_model(path)


def test_unknown_pole_covariance_leaves_no_deviation():
    (mode,) = modes_of(oscillator(0.3, 0.1, 0.1), pole_covariance=np.full((2, 2, 2), np.nan))
    assert mode.frequency_std_hz is None and mode.damping_std is None
