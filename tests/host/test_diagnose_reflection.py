"""Gains brought back inside the unit circle: the spectrum stays, and fits go on behind it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.predictor.reflection import reflect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
N, OUTPUTS = 5, 2


def innovations_form(seed: int, radii: tuple[float, ...]) -> tuple[Array, Array, Array, Array]:
    """Return A, C, K, R whose A − K C has a pair and single eigenvalues of these moduli (first: the pair's)."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.2, 2.5)
    F = np.zeros((N, N))
    F[:2, :2] = radii[0] * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    F[range(2, N), range(2, N)] = radii[1:]
    T = rng.standard_normal((N, N))
    C, K = rng.standard_normal((OUTPUTS, N)), rng.standard_normal((N, OUTPUTS))
    root = rng.standard_normal((OUTPUTS, OUTPUTS))
    F = T @ F @ np.linalg.inv(T)
    return F + K @ C, C, K, root @ root.T + 0.1 * np.eye(OUTPUTS)


def noise_filter(A: Array, C: Array, K: Array, w: float) -> Complex:
    return np.asarray(np.eye(OUTPUTS) + C @ np.linalg.solve(np.exp(1j * w) * np.eye(N) - A, K), dtype=np.complex128)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "radii", [(1.2, 0.5, -0.4, 0.9), (0.7, 1.00001, -0.4, 0.9), (1.5, 1.1, -3.0, 0.2)], ids=["pair", "hardly", "more"]
)
def test_the_spectrum_stays_and_each_outer_eigenvalue_is_reflected(seed: int, radii: tuple[float, ...]) -> None:
    """S = H R Hᴴ on the circle, so H'⁻¹ S H'⁻ᴴ is one constant: the other gain's covariance. To rounding."""
    A, C, K, R = innovations_form(seed, radii)
    found = reflect(A - K @ C, C, K, R)
    assert found is not None
    before, after = (np.linalg.eigvals(A - G @ C) for G in (K, found))
    expected = np.where(np.abs(before) > 1, 1 / np.conj(before), before)
    distance = np.abs(expected[:, None] - after[None])
    assert np.max(np.min(distance, axis=1)) < 1e-6 and np.max(np.min(distance, axis=0)) < 1e-6
    covariances = []
    for w in np.linspace(0.05, 3.1, 9):
        H, G = noise_filter(A, C, K, w), np.linalg.inv(noise_filter(A, C, found, w))
        covariances.append(G @ H @ R @ H.conj().T @ G.conj().T)
    np.testing.assert_allclose(covariances, [covariances[0]] * 9, rtol=1e-4, atol=1e-5 * np.abs(covariances[0]).max())
    np.testing.assert_allclose(covariances[0].imag, 0.0, atol=1e-5 * np.abs(covariances[0]).max())
    assert np.linalg.det(covariances[0].real) > np.linalg.det(R)  # what cannot be predicted is larger than R


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("outer", [1.0, 1 + 2.3e-16, 1 + 1e-12, 1.2, 1e160])
@pytest.mark.parametrize("covariance", [0.0, 1e-300, 1.0, np.nan])
@pytest.mark.parametrize("seen", [0.0, 1e-160, 1.0])
def test_at_the_edge_of_what_numbers_hold_it_is_a_gain_or_none(outer: float, covariance: float, seen: float) -> None:
    C = np.array([[seen, 1.0]])
    found = reflect(np.diag([outer, 0.5]), C, np.full((2, 1), 0.1), np.array([[covariance]]))
    assert found is None or bool(np.all(np.isfinite(found)))


@pytest.mark.filterwarnings("error")
def test_a_chain_of_eigenvalues_just_outside_warns_nobody() -> None:
    """The equations have a condition of 1e19, of which a general solver warns; the gain shows what it is worth."""
    C = np.array([[1.0, 1.0]])
    found = reflect(np.array([[1.0001, 100.0], [0.0, 1.0001]]), C, np.full((2, 1), 0.1), np.eye(1))
    assert found is None or bool(np.all(np.isfinite(found)))


def test_a_gain_that_forgets_stays_and_what_no_output_shows_cannot_be_reflected() -> None:
    A, C, K, R = innovations_form(1, (0.9, 0.5, -0.4, 0.3))
    assert reflect(A - K @ C, C, K, R) is None
    hidden = np.diag([1.2, 0.5])
    seen = np.array([[0.0, 1.0]])
    assert reflect(hidden, seen, np.zeros((2, 1)), np.eye(1)) is None
