"""Check the block lattices against Yule–Walker, least squares and processes whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.lattice import (
    estimate_by_covariance,
    estimate_by_prediction_error,
    sample_covariances,
    solve_yule_walker,
)
from aeolid.identify.markov import estimate_markov
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.hawt import Excitation, simulate_closed_loop
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record

METHODS = [estimate_by_covariance, estimate_by_prediction_error]
NONE = (False, False)


def distance(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def record_of(values, like):
    return replace(like, values=values, time_s=np.arange(len(values), dtype=float))


def pair(values):
    """Return a record of one input and one output."""
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    return Record(np.arange(len(values), dtype=float), np.asarray(values, float), channels, 1.0, "two channels", "0")


def stable_process(order, m, seed):
    """Return coefficients (order, m, m) of a stable vector process: every companion eigenvalue inside radius 0.9."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((order, m, m))
    companion = np.zeros((order * m, order * m))
    companion[:m] = np.hstack(A)
    companion[m:, :-m] = np.eye((order - 1) * m)
    shrink = 0.9 / np.abs(np.linalg.eigvals(companion)).max()
    return np.array([a * shrink ** (i + 1) for i, a in enumerate(A)])


def true_covariances(A, Q, count):
    """Return φ_0 … φ_count of z_k = Σ A_i z_{k−i} + e, cov e = Q, from the companion form's Lyapunov equation."""
    order, m, _ = A.shape
    F, G = np.zeros((order * m, order * m)), np.zeros((order * m, order * m))
    F[:m] = np.hstack(A)
    F[m:, :-m] = np.eye((order - 1) * m)
    G[:m, :m] = Q
    P = np.linalg.solve(np.eye(F.size) - np.kron(F, F), G.ravel()).reshape(F.shape)
    found = [P[:m, i * m : (i + 1) * m] for i in range(order)]  # E z_k z_{k-i}ᵀ
    while len(found) <= count:
        found.append(sum(A[i] @ found[len(found) - 1 - i] for i in range(order)))
    return np.array(found)


def simulate(A, count, seed, burn=500):
    order, m, _ = A.shape
    e = np.random.default_rng(seed).standard_normal((count + burn, m))
    z = np.zeros_like(e)
    for k in range(order, len(e)):
        z[k] = e[k] + sum(A[i] @ z[k - 1 - i] for i in range(order))
    return z[burn:]


@pytest.mark.parametrize("order", [1, 2, 4])
def test_true_covariances_give_the_process_back(order):
    A = stable_process(order, 3, order)
    Q = np.array([[1.0, 0.3, 0.0], [0.3, 0.5, 0.1], [0.0, 0.1, 2.0]])
    found = solve_yule_walker(true_covariances(A, Q, order + 3), order + 3)
    np.testing.assert_allclose(found.forward[:order], A, atol=1e-8)
    np.testing.assert_allclose(found.forward[order:], 0, atol=1e-8)
    np.testing.assert_allclose(found.forward_covariance, Q, atol=1e-8)


@pytest.mark.parametrize("past", [1, 2, 7])
def test_recursion_solves_the_yule_walker_equations(past):
    z = simulate(stable_process(2, 3, 5), 400, 5)
    phi = sample_covariances([z], past)
    found = solve_yule_walker(phi, past)

    def block(t):
        return phi[t] if t >= 0 else phi[-t].T

    # eq. (11), (12): block (i, j) of the matrix is φ_{j−i}ᵀ = E z_{k−i} z_{k−j}ᵀ with z_k first
    Phi = np.block([[block(j - i) for j in range(past + 1)] for i in range(past + 1)])
    forward = np.hstack([np.eye(3), *(-found.forward)]) @ Phi
    backward = np.hstack([*(-found.backward[::-1]), np.eye(3)]) @ Phi
    zeros = np.zeros((3, 3 * past))
    np.testing.assert_allclose(forward, np.hstack([found.forward_covariance, zeros]), atol=1e-9)
    np.testing.assert_allclose(backward, np.hstack([zeros, found.backward_covariance]), atol=1e-9)


def test_covariance_estimate_is_least_squares_with_zeros_outside():
    record = simulate_fourth_order(300, 1, feedback=0.25)
    scaling, past = find_scaling([record]), 4
    z = scaling.apply(record.columns(scaling.inputs + scaling.outputs))
    padded = np.vstack([np.zeros((past, z.shape[1])), z, np.zeros((past, z.shape[1]))])
    rows = np.hstack([padded[i : i + len(z) + past] for i in range(past)])  # oldest first
    expected = np.linalg.lstsq(rows, padded[past:], rcond=None)[0].T
    found = estimate_by_covariance([record], scaling, past, NONE)
    np.testing.assert_allclose(found.theta[:, : rows.shape[1]], expected[len(scaling.inputs) :], atol=1e-8)
    np.testing.assert_array_equal(found.theta[:, rows.shape[1] :], 0)


@pytest.mark.parametrize("method", METHODS)
def test_distance_from_least_squares_falls_as_one_over_samples(method):
    # mean over seeds of the distance from the covariance method's least squares, which counts nothing as 0
    means = []
    for count in (500, 8000):
        found = []
        for seed in range(6):
            record = simulate_fourth_order(count, seed, feedback=0.25)
            scaling = find_scaling([record])
            exact = estimate_markov(factorise([record], scaling, 6), NONE, "none").theta
            found.append(distance(method([record], scaling, 6, NONE).theta, exact))
        means.append(np.mean(found))
    assert means[1] < means[0] / 8  # 1/N alone would be 16
    assert means[0] < 0.2


def test_prediction_error_is_close_to_least_squares_on_a_turbine():
    record = simulate_closed_loop(5000, 2, excitation=Excitation(noise=0.01))
    scaling, mask = find_scaling([record]), (False, False)
    exact = estimate_markov(factorise([record], scaling, 10), mask, "none")
    sharp = estimate_by_prediction_error([record], scaling, 10, mask)
    blunt = estimate_by_covariance([record], scaling, 10, mask)
    # zeros outside the record cost more where channels are strongly coloured
    assert distance(sharp.theta, exact.theta) < 0.01 < distance(blunt.theta, exact.theta)
    np.testing.assert_allclose(sharp.residual_covariance, exact.residual_covariance, rtol=0.1, atol=1e-4)
    assert sharp.samples == 5000


def test_estimates_converge_to_the_process():
    A = stable_process(2, 2, 8)
    record = pair(simulate(A, 100_000, 3))
    scaling = find_scaling([record])
    T = np.diag(scaling.scale)
    for method in METHODS:
        found = method([record], scaling, 2, (False,)).predictors
        forward = np.array([T @ block @ np.linalg.inv(T) for block in found.forward])
        np.testing.assert_allclose(forward, A, atol=0.02)  # six standard deviations 1/√N
        np.testing.assert_allclose(T @ found.forward_covariance @ T, np.eye(2), atol=0.03)


def adversarial():
    rng = np.random.default_rng(4)
    k = np.arange(400)
    noise = rng.standard_normal((400, 2))
    yield "collinear", np.column_stack([noise[:, 0], 3 * noise[:, 0]])
    yield "shifted copy", np.column_stack([noise[:, 0], np.roll(noise[:, 0], 1)])
    yield "one line", np.column_stack([np.sin(0.3 * k), np.cos(0.3 * k)])
    yield "impulse", np.column_stack([(k == 200) * 1.0, (k == 201) * 1.0])
    yield "growing", np.column_stack([1.02**k, 1.02**k * rng.choice([-1, 1], 400)])
    yield "scales", noise * [1e-6, 1e6]
    yield "random walk", np.cumsum(noise, axis=0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name, values", list(adversarial()))
def test_error_covariances_stay_positive_definite(method, name, values):
    record = pair(values)
    found = method([record], find_scaling([record]), 12, (False,))
    for covariance in (found.predictors.forward_covariance, found.predictors.backward_covariance):
        assert np.linalg.eigvalsh(covariance).min() > 0, name
    assert np.isfinite(found.theta).all()
    # E > 0 at every order is what keeps the predictor's inverse stable: roots inside the unit circle
    F = np.zeros((24, 24))
    F[:2] = np.hstack(found.predictors.forward)
    F[2:, :-2] = np.eye(22)
    assert np.abs(np.linalg.eigvals(F)).max() < 1 + 1e-6, name


@pytest.mark.parametrize("method", METHODS)
def test_scales_of_channels_do_not_matter(method):
    record = simulate_fourth_order(500, 7)
    scaling, mask = find_scaling([record]), (True, False)
    other = replace(scaling, scale=scaling.scale * [1024.0, 0.125, 4.0, 0.5])
    A, B = method([record], scaling, 5, mask), method([record], other, 5, mask)
    assert distance(B.theta, A.theta) > 0.1
    np.testing.assert_allclose(
        B.to_streamed(other, mask).theta, A.to_streamed(scaling, mask).theta, rtol=1e-5, atol=1e-7
    )


@pytest.mark.parametrize("method", METHODS)
def test_recordings_merge_and_holes_part(method):
    record = simulate_fourth_order(900, 3, feedback=0.25)
    scaling = find_scaling([record])
    first, second = record_of(record.values[:400], record), record_of(record.values[401:], record)
    holed = record.values.copy()
    holed[400, 0] = np.nan
    parts = method([first, second], scaling, 4, NONE)
    np.testing.assert_array_equal(parts.theta, method([record_of(holed, record)], scaling, 4, NONE).theta)
    np.testing.assert_allclose(parts.theta, method([second, first], scaling, 4, NONE).theta, atol=1e-9)
    # twice the same recording is no news
    np.testing.assert_allclose(
        method([record, record], scaling, 4, NONE).theta, method([record], scaling, 4, NONE).theta, atol=1e-9
    )


@pytest.mark.parametrize("method", METHODS)
def test_feedthrough_is_regressed_last(method):
    # y_k = 2 u_k − u_{k−1} + 0.5 y_{k−1} + noise, u white: D = 2, and without the mask u_k stays in the noise
    rng = np.random.default_rng(9)
    u, e = rng.standard_normal(20_000), 0.1 * rng.standard_normal(20_000)
    y = np.zeros_like(u)
    for k in range(1, len(u)):
        y[k] = 2 * u[k] - u[k - 1] + 0.5 * y[k - 1] + e[k]
    record = pair(np.column_stack([u, y]))
    scaling = find_scaling([record])
    found = method([record], scaling, 2, (True,))
    np.testing.assert_allclose(found.to_streamed(scaling, (True,)).theta, [[0.0, 0.0, -1.0, 0.5, 2.0]], atol=0.02)
    assert found.residual_covariance[0, 0] * scaling.scale[1] ** 2 == pytest.approx(0.01, rel=0.05)
    without = method([record], scaling, 2, (False,))
    assert without.to_streamed(scaling, (False,)).theta.shape == (1, 4)
    assert without.residual_covariance[0, 0] * scaling.scale[1] ** 2 == pytest.approx(4.01, rel=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_identify_takes_the_estimate(method):
    record = simulate_closed_loop(6000, 1, excitation=Excitation(noise=0.01))
    scaling, mask = find_scaling([record]), (False, False)
    streamed = method([record], scaling, 15, mask).to_streamed(scaling, mask)
    plain = identify_varx([record], past=15, order=7)
    ours = identify_varx([record], past=15, order=7, markov=streamed)
    slow = [np.sort_complex(np.linalg.eigvals(i.model.A)) for i in (plain, ours)]
    for wanted in (0.9522 + 0.2726j, 0.9605 + 0.2752j):  # the tower's modes
        for poles in slow:
            assert np.abs(poles - wanted).min() < 0.02


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_estimated_is_refused(method):
    record = simulate_fourth_order(40, 0)
    scaling = find_scaling([record])
    with pytest.raises(UsageError, match="past window 0"):
        method([record], scaling, 0, NONE)
    with pytest.raises(UsageError, match="1 entries for 2 inputs"):
        method([record], scaling, 3, (False,))
    with pytest.raises(NotIdentifiable, match="at least 5"):
        method([record], scaling, 36, NONE)
    assert np.isfinite(method([record], scaling, 20, NONE).theta).all()


def test_what_is_no_covariance_is_refused():
    with pytest.raises(NotIdentifiable, match="predictable"):
        solve_yule_walker(np.array([[[1.0]], [[2.0]]]), 1)
