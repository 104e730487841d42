"""Check the asymptotic uncertainty: the derivative of the whole estimation, the freedom of basis and units, scatter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from aeolid.identify.bands import (
    Band,
    curvature_covariance,
    frequency_response,
    grid,
    on_circle,
    response_covariance,
)
from aeolid.identify.markov import estimate_markov
from aeolid.identify.quantify import in_order_of
from aeolid.identify.subspace import ScaledModel, StateBasis, find_states, system_matrices
from aeolid.identify.uncertainty import covariance_of, matrix_spread, pole_covariance
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import WindowFactor
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order

N_STATES, INPUTS, OUTPUTS, PAST, FUTURE = 4, 2, 2, 24, 6
AT = np.exp(0.7j) * np.array([1.1, 1.0, 0.95])  # where G is looked at
MASKS = [(True, True), (False, False), (True, False)]


def exact_factor(through: tuple[bool, bool]) -> WindowFactor:
    """Return a factor whose regressions hold exactly: y = Ξ ψ + e, e at right angles to ψ, |A − K C| = 0.3.

    Ξ of the window has then a ΓK of rank n up to 0.3²⁴, and the first-order formula is the very derivative of the
    estimation. e is not at right angles to inputs without feedthrough, as under feedback.
    """
    random = np.random.default_rng(1)
    C, B = random.standard_normal((OUTPUTS, N_STATES)), random.standard_normal((N_STATES, INPUTS))
    K, D = random.standard_normal((N_STATES, OUTPUTS)), random.standard_normal((OUTPUTS, INPUTS)) * through
    closed = random.standard_normal((N_STATES, N_STATES))
    closed *= 0.3 / abs(np.linalg.eigvals(closed)).max()
    block, m = np.hstack([B - K @ D, K]), INPUTS + OUTPUTS
    theta = np.hstack([*(C @ np.linalg.matrix_power(closed, PAST - 1 - j) @ block for j in range(PAST)), D])
    q, width = (PAST + 1) * m, PAST * m
    psi = random.standard_normal((q, width + INPUTS))
    used = np.linalg.qr(psi[:, [*range(width), *(width + i for i, t in enumerate(through) if t)]])[0]
    e = random.standard_normal((q, OUTPUTS))
    e -= used @ (used.T @ e)
    full = np.zeros((q + 1, q + 1))
    full[0, 0] = 100.0
    full[1:, 1:] = np.hstack([psi, psi @ theta.T + e])
    return WindowFactor(full, PAST, INPUTS, OUTPUTS, 10_000, 0)


def estimated(factor: WindowFactor, through: tuple[bool, bool]):
    """Return Ξ, states and matrices as the identification finds them, without a penalty."""
    estimate = estimate_markov(factor, through, "none")
    basis = find_states(factor, estimate.theta, FUTURE)
    return estimate, basis, system_matrices(factor, basis.state_map(N_STATES), through)


@pytest.mark.parametrize("through", MASKS)
def test_first_order_is_the_derivative_of_the_whole_estimation(through):
    """The noise ΔΞ Ψ added to the outputs, everything estimated again, SVD included: central differences."""
    factor = exact_factor(through)
    estimate, basis, model = estimated(factor, through)
    assert np.count_nonzero(basis.singular_values > 1e-9 * basis.singular_values[0]) == N_STATES
    spread = matrix_spread(factor, basis, model, estimate, through)
    root = np.linalg.cholesky(estimate.residual_covariance)
    poles = np.linalg.eigvals(model.A)
    width, step, responses, moved_poles = PAST * (INPUTS + OUTPUTS), 1e-5, [], []
    for j, k in np.ndindex(OUTPUTS, estimate.spread.shape[1]):
        noise = factor.R[:, : width + INPUTS] @ np.outer(estimate.spread[:, k], root[:, j])
        sides = []
        for sign in (1, -1):
            full = factor.full.copy()
            full[1:, 1 + width + INPUTS :] += sign * step * noise
            again = estimated(replace(factor, full=full), through)[2]
            values = np.linalg.eigvals(again.A)
            nearest = values[abs(values[:, None] - poles[None]).argmin(axis=0)]
            sides.append((frequency_response(again, AT), nearest))
        responses.append((sides[0][0] - sides[1][0]) / (2 * step))
        moved_poles.append((sides[0][1] - sides[1][1]) / (2 * step))
    for found, expected in (
        (response_covariance(model, spread, AT), covariance_of(np.array(responses))),
        (pole_covariance(model.A, spread), covariance_of(np.array(moved_poles))),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-6 * expected.max())


@dataclass(frozen=True, eq=False)
class OtherBasis(StateBasis):
    """Choose other coordinates of the same states."""

    def selector(self, order):
        change = np.random.default_rng(5).standard_normal((order, order))
        return change @ super().selector(order)


def test_choice_of_the_basis_of_states_cancels():
    through = (True, False)
    factor = exact_factor(through)
    estimate, basis, model = estimated(factor, through)
    other = OtherBasis(basis.singular_values, basis.left, basis.gamma_k, basis.windows)
    turned = system_matrices(factor, other.state_map(N_STATES), through)
    first, second = (matrix_spread(factor, b, m, estimate, through) for b, m in ((basis, model), (other, turned)))
    assert abs(first.root.T @ first.root - second.root.T @ second.root).max() > 0.1 * abs(first.root).max() ** 2
    base = response_covariance(model, first, AT)
    np.testing.assert_allclose(response_covariance(turned, second, AT), base, atol=1e-8 * base.max())
    poles, turned_poles = np.linalg.eigvals(model.A), np.linalg.eigvals(turned.A)
    nearest = abs(turned_poles[None] - poles[:, None]).argmin(axis=1)
    spread = pole_covariance(model.A, first)
    np.testing.assert_allclose(pole_covariance(turned.A, second)[nearest], spread, atol=1e-8 * spread.max())


def test_band_travels_with_the_units():
    record = simulate_fourth_order(2000, 3, feedback=0.25, noise_variance=0.49)
    gains = np.array([1e-3, 57.3, 1e6, 0.02])
    base, other = (
        identify_varx([r], past=10, order=4).band for r in (record, replace(record, values=record.values * gains + 5.0))
    )
    factor = gains[2:, None] / gains[:2]
    np.testing.assert_allclose(other.response, base.response * factor, rtol=1e-6)
    np.testing.assert_allclose(other.gain_std, base.gain_std * factor, rtol=1e-5)
    np.testing.assert_allclose(other.phase_std, base.phase_std, rtol=1e-5)


@pytest.mark.parametrize("feedback", [0.0, 0.25])
def test_band_is_the_scatter_of_many_experiments(feedback):
    """100 experiments: deviations of G within the scatter's own error (7 % of one entry), and 95 % ellipses hold G."""
    true, responses, covariances = fourth_order(), [], []
    at = np.array([0.01, 0.05, 0.1, 0.12, 0.2, 0.3, 0.38, 0.45])
    for seed in range(100):
        result = identify_varx(
            [simulate_fourth_order(2000, 1000 + seed, feedback=feedback, noise_variance=0.49)], past=15, future=10,
            order=4, regularization="none",
        )  # fmt: skip
        band = result.band
        place = [int(abs(band.frequency_hz - f).argmin()) for f in at]
        own = frequency_response_of(result.model, band.frequency_hz[place])
        np.testing.assert_allclose(own, band.response[place], rtol=1e-6, atol=1e-9)
        responses.append(band.response[place] - frequency_response_of(true, band.frequency_hz[place]))
        covariances.append(band.covariance[place])
    error, said = np.array(responses), np.array(covariances)
    parts = np.stack([error.real, error.imag], axis=-1)
    ratio = np.sqrt(said.trace(axis1=-2, axis2=-1).mean(axis=0) / (parts**2).sum(axis=-1).mean(axis=0))
    assert 0.93 < ratio.mean() < 1.07 and np.all((ratio > 0.8) & (ratio < 1.25)), ratio
    distance = np.einsum("...i,...ij,...j", parts, np.linalg.inv(said), parts)
    assert 0.92 < np.mean(distance < 5.991) < 0.98


def frequency_response_of(model, frequency_hz):
    z = on_circle(frequency_hz, model.sample_time_s)
    states = np.linalg.solve(z[:, None, None] * np.eye(model.order) - model.A, model.B[None].astype(complex))
    return model.C @ states + model.D


def test_second_moment_of_the_curvature_is_that_of_drawn_poles():
    """Two modes moved at random: what G moves by beyond the first order, against the formula, entry by entry."""
    light, real = np.array([[0.8, 0.5], [-0.5, 0.8]]), np.array([[0.97]])
    A = np.block([[light, np.zeros((2, 1))], [np.zeros((1, 2)), real]])
    change = np.array([[1.0, 0.3, 0.2], [-0.4, 1.0, 0.1], [0.2, 0.5, 1.0]])
    B, C = np.array([[1.0, 0.2], [0.5, -1.0], [0.3, 0.4]]), np.array([[0.3, 1.0, 0.7]])
    model = ScaledModel(np.linalg.solve(change, A @ change), np.linalg.solve(change, B), C @ change, np.zeros((1, 2)),
                        np.zeros((3, 1)), np.eye(1), "")  # fmt: skip
    values, right = np.linalg.eig(model.A)
    left, random = np.linalg.inv(right), np.random.default_rng(2)
    z = on_circle(np.array([0.002, 0.02, 0.09]), 1.0)
    pair = np.array([[4.0, 1.5], [1.5, 1.0]]) * 1e-6
    for moved, covariance in ((values.imag > 0, pair), (values.imag == 0, np.diag([9e-6, 0.0]))):
        (j,) = np.flatnonzero(moved)
        poles = np.zeros((3, 2, 2))
        poles[j] = covariance
        a, b = random.multivariate_normal(np.zeros(2), covariance, 40_000).T
        delta = (a + 1j * b)[:, None, None, None]
        distance = (z - values[j])[:, None, None]
        residue = np.outer(model.C @ right[:, j], left[j] @ model.B)
        rest = residue * (1 / (distance - delta) - 1 / distance - delta / distance**2)
        parts = np.stack([rest.real, rest.imag], axis=-1)
        drawn = np.einsum("k...i,k...j->...ij", parts, parts) / len(a)
        found = curvature_covariance(model, poles, z)
        size = drawn.trace(axis1=-2, axis2=-1)[..., None, None]
        np.testing.assert_allclose(found / size, drawn / size, atol=0.12)  # fourth moments of 40,000 draws


def test_band_holds_the_truth_near_an_integrator():
    """Turbine, 30 runs: below 0.02 Hz 95 % ellipses from pitch to speed hold G; to first order most do not."""
    true, hits = build_turbine().model(), []
    for seed in range(30):
        record = simulate_closed_loop(3000, seed, excitation=Excitation(noise=0.01))
        band = identify_varx([record], past=20, order=7, feedthrough=("pitch", "generator_torque")).band
        low = band.frequency_hz < 0.02
        error = (frequency_response_of(true, band.frequency_hz[low]) - band.response[low])[:, 0, 0]
        parts = np.stack([error.real, error.imag], axis=-1)
        covariance = band.covariance[low, 0, 0]
        hits.append(np.einsum("ki,kij,kj->k", parts, np.linalg.inv(covariance), parts) < 5.991)
    assert np.mean(hits) > 0.75


def test_unknown_phase_is_said_and_gain_is_a_distance():
    """2 at a deviation of 1 is 4 off in the squared distance: within the 5.99 of the ellipse, the phase is unknown."""
    covariance = np.broadcast_to(np.diag([1.0, 4.0]), (4, 1, 1, 2, 2))
    band = Band(np.array([0.1, 0.2, 0.3, 0.4]), np.array([10.0, 10j, 1 + 1j, 2.0])[:, None, None], covariance)
    np.testing.assert_allclose(band.gain_std.ravel(), [1.0, 2.0, np.sqrt(2.5), 1.0])
    np.testing.assert_allclose(band.phase_std.ravel(), [0.2, 0.1, np.nan, np.nan])
    turned = np.array([[3.0, 1.0], [1.0, 3.0]])[None, None, None]  # axes of 2 and √2, the longer at 45 degrees
    nil = Band(np.array([0.1]), np.zeros((1, 1, 1), complex), turned)
    assert nil.gain_std[0, 0, 0] == pytest.approx(2.0) and np.isnan(nil.phase_std).all()
    facts = band.to_json(["u"], ["y"])
    assert facts["pairs"][0]["phase_std_deg"][2] is None and facts["pairs"][0]["gain"] == [10.0, 10.0, 1.4142, 2.0]


def test_grid_is_closer_at_light_modes():
    poles = np.exp(0.1 * (2 * np.pi * 0.3) * np.array([-0.01 + 1j, -0.01 - 1j]))
    plain, refined = grid(0.1, poles[:0]), grid(0.1, poles)
    assert len(refined) == len(plain) + 5 and refined[0] == pytest.approx(0.005) and refined[-1] < 5
    assert np.count_nonzero(abs(refined - 0.3) < 0.0061) >= 5


def test_deviations_follow_their_poles_into_the_circle():
    """With a stable model asked for, poles that stayed keep their deviation, in whatever order they come."""
    before, after = np.diag([1.01, 0.5, 0.9]), np.diag([0.9, 0.9999, 0.5])
    spread = np.arange(3.0)[:, None, None] * np.eye(2)
    np.testing.assert_allclose(in_order_of(spread, before, after)[:, 0, 0], [2.0, 0.0, 1.0])
    record = simulate_closed_loop(3000, 4, excitation=Excitation(noise=0.01))
    free, stable = (identify_varx([record], past=20, order=7, stable=s) for s in (False, True))
    pairs = {round(m.frequency_hz, 6): m.frequency_std_hz for m in free.modes if m.eigenvalue.imag}
    same = [m for m in stable.modes if m.eigenvalue.imag and round(m.frequency_hz, 6) in pairs]
    assert same and all(m.frequency_std_hz == pytest.approx(pairs[round(m.frequency_hz, 6)]) for m in same)
