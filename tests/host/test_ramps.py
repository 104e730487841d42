"""What a ramp of the inputs within a sample adds to a model in discrete time, against the integral itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.signal import cont2discrete

from aeolid.models.equations import InputFilter, Parameter
from aeolid.models.exchange.linear_equations import linear_equations
from aeolid.models.integrate import compile_equations, free_run
from aeolid.models.model_file import Signal
from aeolid.models.ramps import added_by_ramps
from aeolid.models.state_space import StateSpace


def plant(rng: np.random.Generator, fastest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return A (4, 4) and B (4, 2) of two random modes, one of them an integrator behind a lag, of up to `fastest`."""
    w = fastest * rng.uniform(0.3, 1.0)
    A = np.zeros((4, 4))
    A[:2, :2] = [[0.0, 1.0], [-w * w, -0.2 * w]]
    A[2:, 2:] = [[0.0, 1.0], [0.0, -fastest * rng.uniform(0.3, 1.0)]]
    turn = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    return turn @ A @ turn.T, rng.standard_normal((4, 2))


@pytest.mark.parametrize(("fastest", "tolerance"), [(0.3, 1e-3), (1.0, 0.02), (1.5, 0.08)])
def test_it_is_the_integral_of_the_ramp(fastest: float, tolerance: float) -> None:
    """Reference: ∫ e^{A (1 − t)} B (t − 1/2) dt. Tolerances: the next term of the series, 0.07 T⁴ of ψ, with room."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        A, B = plant(rng, fastest)
        gain = quad_vec(lambda t, A=A, B=B: expm(A * (1 - t)) @ B, 0, 1)[0]
        expected = quad_vec(lambda t, A=A, B=B: (t - 0.5) * expm(A * (1 - t)) @ B, 0, 1)[0]
        found = added_by_ramps(expm(A), gain)
        np.testing.assert_allclose(found, expected, atol=tolerance * np.max(np.abs(expected)))


def test_a_dead_time_in_samples_hands_on_what_it_was_given() -> None:
    """Two states that delay the input, and a lag behind them that sees the input as well: the lag alone has a ramp."""
    A = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.4, 0.6]])
    B = np.array([[1.0], [0.0], [0.2]])
    found = added_by_ramps(A, B)
    alone = added_by_ramps(A[2:, 2:], B[2:])
    np.testing.assert_array_equal(found[:2], 0.0)
    np.testing.assert_allclose(found[2:], alone)
    assert alone[0, 0] == pytest.approx(-0.2 * (0.5 / np.tanh(np.log(0.6) / 2) - 1 / np.log(0.6)), rel=0.01)


@pytest.mark.parametrize("A", [[[-1.0, 0.0], [0.0, 0.5]], [[np.nan, 0.0], [0.0, 0.5]], [[0.0, 0.0], [0.0, 0.0]]])
def test_what_is_no_sampled_plant_gets_nothing_that_is_not_finite(A: list[list[float]]) -> None:
    assert np.all(np.isfinite(added_by_ramps(np.array(A), np.ones((2, 1)))))


@pytest.mark.parametrize(("kind", "late"), [("actuator_lag", 1.0), ("actuator_lag", 3.0), ("transport_delay", 2.4)])
def test_a_discretised_model_answers_a_filtered_command_as_its_continuous_one(kind: str, late: float) -> None:
    """A mode at 12 samples a period behind a lag or a dead time of so many samples, against a hundred steps a sample.

    The mean of each sample alone leaves 1.7 to 2.8 % of the answer, with the ramp about it 0.1 to 0.2 % are left.
    """
    A, B, C = np.array([[0.0, 1.0], [-0.25, -0.05]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    rng, fine = np.random.default_rng(2), 100
    u = np.repeat(rng.standard_normal(60), 5)[:, None]

    def run(step: float, held: np.ndarray) -> np.ndarray:
        found = cont2discrete((A, B, C, np.zeros((1, 1))), step)
        signals = (Signal("u"),), (Signal("y"),), (Signal("x"), Signal("v"))
        plain = linear_equations(StateSpace(*found[:4], None, np.zeros(2), None, step, *signals), "model.json")
        behind = (InputFilter("u", kind, ("late",)),)
        model = replace(plain, parameters=(*plain.parameters, Parameter("late", late)), filters=behind)
        return free_run(compile_equations(model), held, model.theta, model.x0, step)[:, 0]

    exact = run(1.0 / fine, np.repeat(u, fine, axis=0))[::fine]
    assert np.std(run(1.0, u) - exact) < 0.004 * np.std(exact)
