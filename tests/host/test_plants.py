"""Check the built-in plants against published matrices and stored recordings."""

import json
from pathlib import Path

import numpy as np
import pytest

from aeolid.models.recursion import run_states
from aeolid.plants import hawt, lti

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
needs_models = pytest.mark.skipif(not (SHARED / "models/models.json").exists(), reason="../shared/models is absent")
needs_reference = pytest.mark.skipif(not (SHARED / "reference/data").exists(), reason="../shared/reference is absent")
OUTPUT_ROWS = [0, 1, 2]


def published():
    return json.loads((SHARED / "models/models.json").read_text())["wts"]


@needs_models
@pytest.mark.parametrize("rule, key", [("bilinear", "tustin"), ("zoh", "zoh")])
def test_turbine_equals_published_matrices(rule, key):
    turbine, truth = hawt.build_turbine(rule=rule), published()[key]
    for name, rows in (("A", slice(None)), ("B", slice(None)), ("C", OUTPUT_ROWS), ("D", OUTPUT_ROWS)):
        np.testing.assert_allclose(getattr(turbine, name), np.array(truth[name])[rows], rtol=1e-9, atol=1e-15)


@needs_models
def test_continuous_matrices_equal_published_ones():
    A, B, C, D = hawt.continuous_matrices(hawt.Parameters())
    truth = published()["ct"]
    np.testing.assert_allclose(A, truth["A"], rtol=1e-12)
    np.testing.assert_allclose(B, truth["B"], rtol=1e-12)
    np.testing.assert_allclose(C, np.array(truth["C"])[OUTPUT_ROWS])
    assert not D.any()


@needs_models
def test_controllers_from_formulas_equal_published_coefficients():
    for (b, a), key in ((hawt.pitch_controller(), "Cpitch"), (hawt.torque_controller(), "Ctorque")):
        np.testing.assert_allclose(b, published()[key]["b"], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(a, published()[key]["a"], rtol=1e-9, atol=1e-12)


@needs_reference
def test_closed_loop_reproduces_stored_recording():
    stored = dict(np.load(SHARED / "reference/data/hawt_00.npz"))
    loop, answer = hawt.ClosedLoop(0), []
    for excitation, wind in zip(stored["r"], stored["d"], strict=True):
        _, u, y = loop.advance(excitation, wind, np.zeros(3))
        answer.append(np.r_[u, y])
    truth = np.hstack([stored["u"], stored["y"]])
    # coefficients rounded elsewhere in the ninth-order controller leave 4e-8 of the spread
    assert np.max(abs(answer - truth) / truth.std(axis=0)) < 1e-6


def test_poles_of_the_turbine_as_printed():
    poles = np.sort_complex(np.linalg.eigvals(hawt.build_turbine().A))
    printed = [0.4905 - 0.8656j, 0.4905 + 0.8656j, 0.9522 - 0.2726j, 0.9522 + 0.2726j, 0.9605 - 0.2752j]
    np.testing.assert_allclose(poles, [*printed, 0.9605 + 0.2752j, 1.0], atol=6e-5)


def test_stepping_equals_batch_and_seed_matters():
    record = hawt.simulate_closed_loop(2100, 5)
    loop = hawt.ClosedLoop(5)
    for k in range(2100):
        time, u, y = loop.step()
        assert time == record.time_s[k]
        np.testing.assert_array_equal(np.r_[u, y], record.values[k, :5])
    assert not np.allclose(hawt.simulate_closed_loop(50, 6).values, record.values[:50])


def test_excitation_has_the_stated_spread():
    record = hawt.simulate_closed_loop(5000, 1)
    spread = record.matrix("excitation").std(axis=0)
    np.testing.assert_allclose(spread, [1.0, 1000.0], rtol=0.05)
    assert [c.name for c in hawt.roles().channels] == [c.name for c in record.channels]


def test_measurement_noise_is_a_fraction_of_the_outputs():
    quiet = hawt.Excitation(pitch_deg=0, torque_nm=0, wind_m_per_s=0, noise=0.01)
    first = [hawt.ClosedLoop(seed, excitation=quiet).step()[2] for seed in range(200)]  # later ones pass the loop too
    np.testing.assert_allclose(np.std(first, axis=0), 0.01 * hawt.OUTPUT_STD, rtol=0.2)


@needs_reference
def test_fourth_order_example_equals_stored_matrices():
    truth, model = np.load(SHARED / "reference/data/true_four.npz"), lti.fourth_order()
    for key in "ABCDK":
        np.testing.assert_array_equal(getattr(model, key), truth[key])


def test_fourth_order_loop_closes():
    record = lti.simulate_fourth_order(4000, 3, feedback=0.25, noise_variance=0.49)
    excitation = record.matrix("input") + 0.25 * record.matrix("output")
    np.testing.assert_allclose(excitation.var(axis=0), 1.0, rtol=0.08)


@pytest.mark.parametrize("samples", [0, 1, 48, 49, 97, 1000, 1001])
def test_recursion_by_halving_equals_plain_loop(samples):
    random = np.random.default_rng(samples)
    A = random.standard_normal((5, 5))
    A *= 0.99 / abs(np.linalg.eigvals(A)).max()
    forced, x = random.standard_normal((samples, 5)), random.standard_normal(5)
    states = run_states(A, forced, x)
    for k in range(samples):
        np.testing.assert_allclose(states[k], x, rtol=1e-9, atol=1e-9)
        x = A @ x + forced[k]
    np.testing.assert_allclose(states[samples], x, rtol=1e-9, atol=1e-9)
