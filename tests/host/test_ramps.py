"""What a ramp of the inputs within a sample adds to a model in discrete time, against the integral itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from aeolid.models.ramps import added_by_ramps


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
    models, expected = [], []
    for _ in range(5):
        A, B = plant(rng, fastest)
        models.append((expm(A), quad_vec(lambda t, A=A, B=B: expm(A * (1 - t)) @ B, 0, 1)[0]))
        expected.append(quad_vec(lambda t, A=A, B=B: (t - 0.5) * expm(A * (1 - t)) @ B, 0, 1)[0])
    found = added_by_ramps(*(np.array(m) for m in zip(*models, strict=True)))
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(found, expected, atol=tolerance * size)


def test_a_dead_time_in_samples_hands_on_what_it_was_given() -> None:
    """Two states that delay the input, and a lag behind them that sees the input as well: the lag alone has a ramp."""
    A = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.4, 0.6]])
    B = np.array([[1.0], [0.0], [0.2]])
    found = added_by_ramps(A[None], B[None])[0]
    alone = added_by_ramps(A[None, 2:, 2:], B[None, 2:])[0]
    np.testing.assert_array_equal(found[:2], 0.0)
    np.testing.assert_allclose(found[2:], alone)
    assert alone[0, 0] == pytest.approx(-0.2 * (0.5 / np.tanh(np.log(0.6) / 2) - 1 / np.log(0.6)), rel=0.01)


@pytest.mark.parametrize("A", [[[-1.0, 0.0], [0.0, 0.5]], [[np.nan, 0.0], [0.0, 0.5]], [[0.0, 0.0], [0.0, 0.0]]])
def test_what_is_no_sampled_plant_gets_nothing_that_is_not_finite(A: list[list[float]]) -> None:
    assert np.all(np.isfinite(added_by_ramps(np.array([A]), np.ones((1, 2, 1)))))
