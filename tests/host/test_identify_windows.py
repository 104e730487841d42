"""Check the window factor and the Markov estimate against plain definitions."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.markov import estimate_markov
from aeolid.identify.subspace import find_states, gamma_k, largest_useful_order
from aeolid.identify.windows import factorise, find_scaling, require_windows
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Record


def plain_windows(record: Record, scaling, past):
    """Build [z_{k-p} … z_{k-1}, u_k, y_k] row by row, as the definition says."""
    z = scaling.apply(record.columns(scaling.inputs + scaling.outputs))
    return np.array([z[k - past : k + 1].ravel() for k in range(past, len(z))])


def about_mean(rows):
    return rows - rows.mean(axis=0)


def record_of(values, like):
    return replace(like, values=values, time_s=np.arange(len(values), dtype=float))


@pytest.fixture(scope="module")
def noisy():
    return simulate_fourth_order(3000, 1, feedback=0.25)


@pytest.mark.parametrize("past", [1, 2, 7, 20])
def test_factor_squares_to_the_sum_of_windows(noisy, past):
    scaling = find_scaling([noisy])
    factor = factorise([noisy], scaling, past)
    rows = about_mean(plain_windows(noisy, scaling, past))
    np.testing.assert_allclose(factor.R.T @ factor.R, rows.T @ rows, rtol=1e-9, atol=1e-8)
    assert factor.windows == len(rows) == 3000 - past
    np.testing.assert_allclose(factor.mean, plain_windows(noisy, scaling, past).mean(axis=0), atol=1e-12)
    assert np.allclose(factor.R, np.triu(factor.R))


def test_merged_factors_equal_the_stacked_problem(noisy):
    other = simulate_fourth_order(700, 2, feedback=0.25)
    scaling = find_scaling([noisy, other])
    both = factorise([noisy, other], scaling, 6)
    merged = factorise([noisy], scaling, 6).merge(factorise([other], scaling, 6))
    rows = about_mean(np.vstack([plain_windows(r, scaling, 6) for r in (noisy, other)]))
    for factor in (both, merged):
        np.testing.assert_allclose(factor.R.T @ factor.R, rows.T @ rows, rtol=1e-9, atol=1e-8)
        assert factor.windows == len(rows)
        theta = estimate_markov(factor, (False, False), "none").theta
        best = np.linalg.lstsq(rows[:, :24], rows[:, 26:], rcond=None)[0].T
        np.testing.assert_allclose(theta[:, :24], best, atol=1e-10)


def test_parts_of_a_recording_lose_no_window(noisy):
    scaling = find_scaling([noisy])
    parts = factorise([noisy], scaling, 9, last=0.7).merge(factorise([noisy], scaling, 9, first=0.7))
    whole = factorise([noisy], scaling, 9)
    assert parts.windows == whole.windows
    np.testing.assert_allclose(parts.R.T @ parts.R, whole.R.T @ whole.R, rtol=1e-9, atol=1e-8)


def test_windows_with_a_missing_sample_are_left_out_and_counted(noisy):
    values = noisy.values.copy()
    values[500, 2] = np.nan
    values[1000:1005] = np.nan
    values[-1, 0] = np.nan
    gappy = record_of(values, noisy)
    scaling = find_scaling([gappy])
    factor = factorise([gappy], scaling, 5)
    rows = plain_windows(gappy, scaling, 5)
    good = np.isfinite(rows).all(axis=1)
    assert factor.skipped == 6 + 10 + 1 == np.count_nonzero(~good)
    rows = about_mean(rows[good])
    np.testing.assert_allclose(factor.R.T @ factor.R, rows.T @ rows, rtol=1e-9, atol=1e-8)


def test_scaling_is_common_and_ignores_missing_samples(noisy):
    values = noisy.values + 1e6  # a large offset must not cost digits
    values[3, 1] = np.nan
    shifted = [record_of(values[:1000], noisy), record_of(values[1000:], noisy)]
    scaling = find_scaling(shifted)
    np.testing.assert_allclose(scaling.offset, np.nanmean(values, axis=0), rtol=1e-12)
    np.testing.assert_allclose(scaling.scale, np.nanstd(values, axis=0), rtol=1e-9)


@pytest.mark.parametrize(
    "spoil, error, words",
    [
        (lambda v: v.__setitem__((slice(None), 1), 5.0), NotIdentifiable, ["u2", "constant at 5"]),
        (lambda v: v.__setitem__((slice(None), 2), np.nan), NotIdentifiable, ["y1", "no sample"]),
        (lambda v: v.__setitem__((17, 3), np.inf), DataError, ["y2", "infinite at sample 18"]),
    ],
)
def test_dead_channels_are_named(noisy, spoil, error, words):
    values = noisy.values.copy()
    spoil(values)
    with pytest.raises(error) as raised:
        find_scaling([record_of(values, noisy)])
    assert all(w in str(raised.value) for w in words)


def test_too_few_samples_say_how_many_are_needed(noisy):
    short = record_of(noisy.values[:40], noisy)
    with pytest.raises(NotIdentifiable, match=r"30 complete windows .* needs at least 45, that is 55 samples"):
        require_windows([short], 10, 4)
    require_windows([noisy], 10, 4)
    with pytest.raises(NotIdentifiable, match=r"44 complete windows .*\(2946 more hold a missing sample"):
        require_windows([noisy], 10, 4, windows=44)
    with pytest.raises(NotIdentifiable, match="0 complete windows"):
        require_windows([record_of(noisy.values[:3], noisy)], 10, 4)


def test_factors_of_different_windows_do_not_merge(noisy):
    scaling = find_scaling([noisy])
    factor = factorise([noisy], scaling, 4)
    other = replace(factor, outputs=1, innovations=1)  # of as many channels
    for unlike in (factorise([noisy], scaling, 5), other, replace(factor, inputs=1, outputs=3)):
        with pytest.raises(UsageError, match="different window length or channels"):
            factor.merge(unlike)


@pytest.mark.parametrize("through", [(False, False), (True, False), (False, True), (True, True)])
def test_markov_parameters_equal_plain_least_squares(noisy, through):
    scaling = find_scaling([noisy])
    rows = about_mean(plain_windows(noisy, scaling, 5))
    keep = [*range(20), *(20 + i for i in range(2) if through[i])]
    estimate = estimate_markov(factorise([noisy], scaling, 5), through, "none")
    best, *_ = np.linalg.lstsq(rows[:, keep], rows[:, 22:], rcond=None)
    np.testing.assert_allclose(estimate.theta[:, keep], best.T, atol=1e-11)
    left_out = [20 + i for i in range(2) if not through[i]]
    assert not estimate.theta[:, left_out].any()
    residual = rows[:, 22:] - rows[:, keep] @ best
    covariance = residual.T @ residual / (len(rows) - len(keep))
    np.testing.assert_allclose(estimate.residual_covariance, covariance, rtol=1e-9)


def test_penalty_solves_the_ridge_problem(noisy):
    scaling = find_scaling([noisy])
    rows, target = np.split(about_mean(plain_windows(noisy, scaling, 4))[:, [*range(16), 18, 19]], [16], axis=1)
    estimate = estimate_markov(factorise([noisy], scaling, 4), (False, False), 0.05)
    penalty = 0.05 * np.linalg.svd(rows, compute_uv=False)[0]
    ridge = np.linalg.solve(rows.T @ rows + penalty**2 * np.eye(16), rows.T @ target)
    np.testing.assert_allclose(estimate.theta[:, :16], ridge.T, atol=1e-10)


def test_the_penalty_of_the_estimate_has_the_least_textbook_score():
    """The score of the very ridge solution through its hat matrix, at the penalty taken and at others, each output."""
    record = simulate_fourth_order(130, 2)
    scaling = find_scaling([record])
    rows = about_mean(plain_windows(record, scaling, 10))
    X, Y, N = rows[:, :40], rows[:, 42:], len(rows)
    estimate = estimate_markov(factorise([record], scaling, 10), (False, False), "gcv")
    largest = np.linalg.svd(X, compute_uv=False)[0]

    def score(penalty, y):
        hat = X @ np.linalg.solve(X.T @ X + penalty**2 * np.eye(40), X.T)
        residual = y - hat @ y
        return N * float(residual @ residual) / (N - np.trace(hat)) ** 2

    assert np.all(estimate.penalty > 0)
    for y, taken, theta in zip(Y.T, estimate.penalty * largest, estimate.theta, strict=True):
        np.testing.assert_allclose(theta[:40], np.linalg.solve(X.T @ X + taken**2 * np.eye(40), X.T @ y), atol=1e-9)
        others = [score(p, y) for p in np.geomspace(1e-3 * largest, largest, 200)]
        assert score(taken, y) <= min(others) * (1 + 1e-6)


def test_no_window_is_no_direction():
    """A part of a recording without a complete window has a factor of zeros, and nothing follows from it."""
    record = simulate_fourth_order(200, 2)
    for rule in ("gcv", "none", 0.1):
        empty = factorise([record], find_scaling([record]), 5, last=0.02)
        estimate = estimate_markov(empty, (True, False), rule)
        assert empty.windows == estimate.rank == 0 and not estimate.theta.any() and not estimate.penalty.any()
        assert largest_useful_order(find_states(empty, estimate.theta, 5)) == 0


def test_gcv_lowers_the_error_on_short_data():
    truth = simulate_fourth_order(60000, 9)
    scaling = find_scaling([truth])
    exact = estimate_markov(factorise([truth], scaling, 10), (False, False), "none").theta
    error = {"none": 0.0, "gcv": 0.0}
    for seed in range(10):
        factor = factorise([simulate_fourth_order(140, seed)], scaling, 10)
        for kind in error:
            error[kind] += float(np.linalg.norm(estimate_markov(factor, (False, False), kind).theta - exact))
    assert error["gcv"] < error["none"]


def test_exactly_interpolated_data_need_no_penalty():
    """On noise-free data the score is 0/0; the floor keeps the exact solution."""
    clean = simulate_fourth_order(400, 3, noise_variance=0.0)
    estimate = estimate_markov(factorise([clean], find_scaling([clean]), 4), (False, False), "gcv")
    assert not estimate.penalty.any()
    assert np.all(np.linalg.eigvalsh(estimate.residual_covariance) < 1e-20)


def test_rank_decision_counts_excited_directions():
    """Eight past blocks of a noise-free fourth-order system span 8 · 2 inputs and 4 states of 32."""
    clean = simulate_fourth_order(2000, 3, noise_variance=0.0)
    estimate = estimate_markov(factorise([clean], find_scaling([clean]), 8), (False, False), "none")
    assert (estimate.rank, estimate.regressors) == (20, 32)
    assert np.all(np.isfinite(estimate.theta)) and np.linalg.norm(estimate.theta) < 10


def test_gamma_k_shifts_by_one_block_a_row():
    theta = np.arange(1.0, 13.0).reshape(2, 6)  # l = 2, p = 3, m = 2
    expected = np.zeros((6, 6))
    expected[0:2] = theta
    expected[2:4, 2:] = theta[:, :4]
    expected[4:6, 4:] = theta[:, :2]
    np.testing.assert_array_equal(gamma_k(theta, 3, 3, 2), expected)
    np.testing.assert_array_equal(gamma_k(theta, 3, 2, 2), expected[:4])
