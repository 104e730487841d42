"""What the diagnosis adds to a model for itself is known by its exact name; a chain of delays has modes beside it."""

from __future__ import annotations

import numpy as np
import pytest

from aeolid.diagnose.structure.anatomy import motions_of_state_space
from aeolid.diagnose.structure.baseline import equations_of
from aeolid.diagnose.structure.eigenvectors import left_vectors
from aeolid.diagnose.structure.modal import modal_form
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace

STEP = 0.05
POLE = np.exp((-0.05 + 1j) * 8 * STEP)


def delayed(chain: int) -> StateSpace:
    """Return a mode of 1.27 Hz that a force drives through a chain of so many delays of a sample."""
    n = 2 + chain
    A = np.zeros((n, n))
    A[:2, :2] = [[POLE.real, POLE.imag], [-POLE.imag, POLE.real]]
    B, C = np.zeros((n, 1)), np.zeros((1, n))
    C[0, 0] = 1.0
    for k in range(2, n - 1):
        A[k + 1, k] = 1.0
    if chain:
        A[0, n - 1] = 0.1
    B[2 if chain else 0, 0] = 1.0 if chain else 0.1
    signals = (Signal("F", "N"),), (Signal("y", "mm"),), tuple(Signal(f"s{i}") for i in range(n))
    return StateSpace(A, B, C, np.zeros((1, 1)), None, np.zeros(n), None, STEP, *signals)


@pytest.mark.parametrize(
    "name", ["sim_k", "sim_stiffness", "bias_unbalance", "bias_u", "noise_pole", "recorded_wind_x"]
)
def test_a_constant_of_the_user_is_one_however_it_begins(name: str) -> None:
    """A stiffness called sim_k was taken for the diagnosis's own and never accused of a wrong value."""
    assert not is_nuisance(name)


def test_what_the_diagnosis_adds_is_known() -> None:
    linear = delayed(0)
    added = {p.name for p in equations_of(linear, shaped_noise=True).parameters}
    added |= set(modal_form(linear, np.ones(1)).values)
    assert added
    assert all(is_nuisance(name) for name in added)


@pytest.mark.parametrize("chain", [0, 1, 3, 6])
def test_a_mode_behind_a_chain_of_delays_is_read(chain: int) -> None:
    """Equal eigenvalues of the chain have too few eigenvectors for an inverse; the mode has its own."""
    linear = delayed(chain)
    sizes = np.ones(len(linear.A) + 1)
    found, _ = motions_of_state_space(linear, equations_of(linear, shaped_noise=True), sizes, np.ones(1))
    assert [m.location for m in found] == ["mode:1.27 Hz"]
    plain, _ = motions_of_state_space(delayed(0), equations_of(delayed(0), shaped_noise=True), np.ones(3), np.ones(1))
    assert found[0].position_size >= plain[0].position_size  # the chain adds to it what it brings


def test_a_chain_that_is_defective_by_rounding_alone_gives_no_sizes_beyond_measure() -> None:
    """Two modes behind two delays, whose eigenvectors have an inverse of 1e291; the modes had sizes of 1e273."""
    A = np.array([
        [0.92435534, 0, 0.04813041, 0, 0.02851743, 0], [0, 0.56728032, 0, 0.04157025, -0.04088884, 0],
        [-2.97452015, 0, 0.90077224, 0, 1.12137033, 0], [0, -15.80172151, 0, 0.53237794, -1.49314695, 0],
        [0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0],
    ])  # fmt: skip
    B, C = np.array([[0, 0, 0, 0, 0, 1.0]]).T, np.array([[1.0, 1.0, 0, 0, 0, 0]])
    signals = (Signal("F", "N"),), (Signal("y", "mm"),), tuple(Signal(f"s{i}") for i in range(6))
    linear = StateSpace(A, B, C, np.zeros((1, 1)), None, np.zeros(6), None, STEP, *signals)
    found, _ = motions_of_state_space(linear, equations_of(linear, shaped_noise=True), np.ones(7), np.ones(1))
    assert [m.location for m in found] == ["mode:1.25 Hz", "mode:3.1 Hz"]
    assert all(m.position_size < 100 for m in found)
    values, right = np.linalg.eig(A)
    left = left_vectors(A, values, right)
    kept = values.imag > 0
    np.testing.assert_allclose((left @ A)[kept], values[kept, None] * left[kept], atol=1e-12)
    np.testing.assert_allclose(np.sum(left * right.T, axis=1)[kept], 1.0, atol=1e-12)
