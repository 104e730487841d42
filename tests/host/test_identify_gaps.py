"""Hold fit and residual tests on recordings with gaps, and on sets of short ones, to what complete ones give."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.identify.correlation import Spaced, lagged_correlation, whiten
from aeolid.identify.fit import measure_fit
from aeolid.identify.lpv.fit import measure_lpv_fit
from aeolid.identify.validation import validate_model
from aeolid.models.gap_gains import CHUNK, FADED, GapGains
from aeolid.models.load import LinearModel
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.model_file import Signal
from aeolid.models.prediction import bridged_stretches, estimate_initial_state, predict, predictor_states
from aeolid.models.state_space import StateSpace
from aeolid.plants.lti import fourth_order
from aeolid.record import Channel, Record

STEP, SIGMA = 0.1, 0.3


def slow_model():
    """Return an exact model whose predictor remembers seventy samples."""
    A = np.zeros((4, 4))
    for i, (angle, radius) in enumerate(((0.19, 0.99), (1.4, 0.97))):
        turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = radius * np.array(turn)
    B, C = np.array([[0.3, 0.2, 0.3, -0.2]]).T, np.array([[0.7, 0.2, 0.6, 0.1]])
    K, R = np.array([[0.1, 0.05, 0.1, 0.1]]).T, np.array([[SIGMA**2]])
    states = tuple(Signal(f"x{i}") for i in range(4))
    return StateSpace(A, B, C, np.zeros((1, 1)), K, np.zeros(4), R, STEP, (Signal("u"),), (Signal("y"),), states)


def drawn(model, samples, seed):
    """Return a recording of the model under a white input."""
    random = np.random.default_rng(seed)
    u, e, x = random.standard_normal(samples), SIGMA * random.standard_normal(samples), random.standard_normal(4)
    y = np.empty(samples)
    for k in range(samples):
        y[k] = model.C[0] @ x + e[k]
        x = model.A @ x + model.B[:, 0] * u[k] + model.K[:, 0] * e[k]
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    return Record(STEP * np.arange(samples), np.column_stack([u, y]), channels, STEP, "drawn", "0")


def without(record, rows, columns=1):
    values = record.values.copy()
    values[rows, columns] = np.nan
    return replace(record, values=values)


@pytest.mark.parametrize("every", [3, 13])
def test_an_exact_model_passes_where_single_outputs_are_missing(every):
    """1 % of recordings may alarm: 3 of 20 once in 1000. What a gap leaves unknown adds little to the errors."""
    model, failed, ratios = slow_model(), 0, []
    for seed in range(20):
        record = drawn(model, 2000, seed)
        whole, gappy = (validate_model(LinearModel(model), r) for r in (record, without(record, np.s_[::every])))
        failed += gappy.residuals.verdict == "fail"
        ratios.append(gappy.fit.one_step.nrmse["y"] / whole.fit.one_step.nrmse["y"])
        assert gappy.fit.lengths == (gappy.fit.innovations.shape[0],)
    assert failed <= 2 and 0.99 < np.mean(ratios) < 1.05


def test_pieces_between_missing_rows_are_told_as_one_recording():
    """Every thirteenth row lacks its input too: of 12 numbers 4 are spent on a start, and no lag joins two pieces."""
    model, ratios = slow_model(), []
    for seed in range(10):
        record = drawn(model, 2000, seed)
        whole, pieces = (
            validate_model(LinearModel(model), r) for r in (record, without(record, np.s_[::13], np.s_[:]))
        )
        assert pieces.residuals.verdict != "fail"
        ratios.append(pieces.fit.one_step.nrmse["y"] / whole.fit.one_step.nrmse["y"])
    assert abs(np.mean(ratios) - 1) < 0.05


def test_the_innovations_of_many_short_recordings_have_the_power_of_the_noise():
    model = slow_model()
    fit = measure_fit(model, [drawn(model, 25, seed) for seed in range(240)])
    assert abs(fit.covariance(4)[0, 0] / SIGMA**2 - 1) < 4 * np.sqrt(2 / (240 * 21))


def test_predictions_over_gaps_are_conditional_means():
    """Against the joint normal distribution of all outputs given the first state, with one of two outputs missing."""
    model, count = replace(fourth_order(), innovation_covariance=np.array([[1.0, 0.3], [0.3, 0.5]])), 14
    n, m = model.order, 2
    e_to_y = np.zeros((count * m, count * m))
    for k in range(count):
        state = np.zeros((n, count * m))
        for j in range(count):
            e_to_y[j * m : (j + 1) * m] += model.C @ state
            e_to_y[j * m : (j + 1) * m, j * m : (j + 1) * m] = np.eye(m)
            state = model.A @ state
            if j == k:
                state[:, j * m : (j + 1) * m] += model.K
    covariance = e_to_y @ np.kron(np.eye(count), model.innovation_covariance) @ e_to_y.T
    y = (e_to_y @ np.random.default_rng(0).standard_normal(count * m)).reshape(count, m)
    for k, j in ((2, 0), (3, 0), (3, 1), (7, 1), (8, 0)):
        y[k, j] = np.nan
    found = predict(model, np.tile(model.u_offset, (count, 1)), y + model.y_offset, 1, np.zeros(n)) - model.y_offset
    for k in range(1, count):
        known = np.flatnonzero(np.isfinite(y[:k].ravel()))
        now = np.arange(k * m, (k + 1) * m)
        given = np.linalg.solve(covariance[np.ix_(known, known)], y[:k].ravel()[known])
        np.testing.assert_allclose(found[k], covariance[np.ix_(now, known)] @ given, atol=2e-3)


def test_a_first_state_is_found_over_gaps():
    model, random = fourth_order(), np.random.default_rng(1)
    u, x0 = random.standard_normal((60, 2)), random.standard_normal(4)
    y = model.simulate(u + model.u_offset, x0) - model.y_offset
    y[[3, 4, 20], [0, 1, 0]] = np.nan
    np.testing.assert_allclose(estimate_initial_state(model, u, y), x0, atol=1e-9)


def by_hand(A, C, K, R, known):
    """Return the gain of each sample, (N, n, l), by the filter with the rows of the outputs that are there alone."""
    out, P = [], np.zeros(A.shape[1:])
    for k, seen in enumerate(known):
        G = np.zeros_like(K[k])
        Cs, noise = C[k][seen], K[k] @ R @ K[k].T
        S = Cs @ P @ Cs.T + R[np.ix_(seen, seen)]
        G[:, seen] = (A[k] @ P @ Cs.T + (K[k] @ R)[:, seen]) @ np.linalg.inv(S)
        P = A[k] @ P @ A[k].T + noise - G[:, seen] @ S @ G[:, seen].T
        if np.linalg.norm(P) <= FADED * np.linalg.norm(noise):
            P = np.zeros_like(P)
        out.append(G)
    return np.array(out)


def gappy_system(samples, seed, changing):
    """Return A, C, K of each sample, R, and which of two outputs are there: 5 % of the numbers are not, 50 in a row."""
    random, model = np.random.default_rng(seed), fourth_order()
    wave = 1 + 0.05 * np.sin(0.01 * np.arange(samples))[:, None, None] * changing
    A, C, K = (M * wave for M in (model.A, model.C, model.K))
    known = random.random((samples, 2)) > 0.05
    known[100:150, 0] = False
    known[1000:1400] = True
    return A, C, K, np.array([[0.5, 0.2], [0.2, 0.3]]), known


@pytest.mark.parametrize("changing", [False, True])
def test_gains_are_those_of_the_filter_with_the_outputs_that_are_there(changing, monkeypatch):
    """In parts of any length, and after some thousand samples in the compiled loop, which takes the same steps."""
    A, C, K, R, known = gappy_system(3 * CHUNK, 2, changing)
    expected, solved = by_hand(A, C, K, R, known), []
    solve = np.linalg.solve
    monkeypatch.setattr(np.linalg, "solve", lambda *a: (solved.append(1), solve(*a))[1])
    gaps = GapGains(R, 4)
    cuts = [(0, 120), (120, 1100), (1100, len(known))]
    one = (lambda a, b: (A[a:b], C[a:b], K[a:b])) if changing else (lambda a, b: (A[0], C[0], K[0]))
    found = np.concatenate([gaps.around(*one(a, b), known[a:b]) for a, b in cuts])
    assert abs(found - expected).max() <= 1e-12 * abs(expected).max()
    assert 0 < len(solved) <= CHUNK + 1100


def test_the_predictor_over_many_gaps_is_the_plain_recursion():
    model, random = fourth_order(), np.random.default_rng(3)
    A, C, K, R, known = gappy_system(6000, 4, False)
    model = replace(model, innovation_covariance=R)
    u, y = random.standard_normal((6000, 2)), np.where(known, random.standard_normal((6000, 2)), np.nan)
    x = [np.ones(4)]
    for k, G in enumerate(by_hand(A, C, K, R, known)):
        error = np.where(known[k], y[k] - model.C @ x[k] - model.D @ u[k], 0.0)
        x.append(model.A @ x[k] + model.B @ u[k] + G @ error)
    found = predictor_states(model, u, y, np.ones(4))
    assert abs(found - x).max() <= 1e-12 * abs(np.array(x)).max()


def test_what_overflows_beside_a_gap_ends_in_no_error():
    """A mode that grows and that no output shows: its covariance leaves all bounds in either loop."""
    A, C = np.diag([0.5, 9.0]), np.array([[1.0, 0.0]])
    known = np.ones((3 * CHUNK, 1), dtype=bool)
    known[5] = False
    found = GapGains(np.eye(1), 2).around(A, C, np.array([[0.1], [0.1]]), known)
    assert len(found) == len(known) and np.isfinite(found[:6]).all()


@pytest.mark.parametrize("covariance", [None, np.array([[SIGMA**2]])])
def test_a_scheduled_predictor_runs_over_gaps_too(covariance):
    """A scheduled model that does not vary is the linear one, whose gain stays where its covariance is not known."""
    linear = replace(slow_model(), innovation_covariance=covariance)
    record = drawn(linear, 800, 5)
    scheduled = replace(
        record, values=np.column_stack([record.values, np.linspace(-1, 1, 800)]),
        channels=(*record.channels, Channel("s", "", "scheduling")),
    )  # fmt: skip

    def still(M):
        return np.stack([M, np.zeros_like(M)])

    model = LpvStateSpace(
        still(linear.A), still(linear.B), still(linear.C), still(linear.D), still(linear.K), np.zeros((2, 4)),
        np.zeros(4), covariance, STEP, linear.inputs, linear.outputs, linear.states, (Signal("s"),),
    )  # fmt: skip
    gappy = without(scheduled, np.s_[::13])
    fit, u = measure_lpv_fit(model, [gappy])
    other = measure_fit(linear, [gappy])
    assert fit.lengths == other.lengths == (len(u),)
    np.testing.assert_allclose(fit.innovations, other.innovations, atol=1e-9)


def test_gaps_are_bridged_that_are_short_and_of_outputs():
    u, y = np.zeros((200, 1)), np.zeros((200, 2))
    y[:5, 0] = np.nan
    y[20:30, 1] = y[60:80, 0] = np.nan
    u[150] = y[199] = np.nan
    assert bridged_stretches(u, y, 10) == [(5, 60), (80, 150), (151, 199)]
    assert bridged_stretches(u, y, 46) == [(80, 150), (151, 199)]  # complete samples count


def test_no_lag_joins_two_stretches():
    """What ends each stretch begins the next: joined they follow from each other, apart they do not."""
    random = np.random.default_rng(2)
    x = random.standard_normal((500, 2))
    x[1:, 0] = x[:-1, 1]
    joined = x.ravel()
    assert lagged_correlation(joined, joined, 1)[0] > 0.4
    spaced = Spaced.of(joined, [2] * 500, 3)
    rho, known = spaced.after(spaced, 3)
    assert abs(rho[0]) < 4 / np.sqrt(500) and abs(rho[1:]).max() < 1e-12 and known[0] == 1000
    whole = Spaced.of(joined, [1000], 20)
    np.testing.assert_allclose(whole.after(whole, 20)[0], lagged_correlation(joined, joined, 20), rtol=1e-12)
    assert len(whiten(joined, lengths=[100] * 10)) == 1000
    np.testing.assert_allclose(whiten(joined, lengths=[1000]), whiten(joined), rtol=1e-12)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_a_gain_of_continuous_time_is_no_predictor(hold):
    """Its counterpart at the sample time is not known: a model with it is validated as it is simulated, without it."""
    continuous = StateSpace(
        -np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), 0.5 * np.eye(1), np.zeros(1), np.eye(1), 0.0,
        (Signal("u"),), (Signal("y"),), (Signal("x"),),
    )  # fmt: skip
    record = drawn(slow_model(), 400, 6)
    held = replace(record, channels=(replace(record.channels[0], hold=hold), record.channels[1]))
    with_gain, bare = (validate_model(LinearModel(m), held) for m in (continuous, replace(continuous, K=None)))
    assert with_gain.fit is None and with_gain.residuals is None
    assert with_gain.free_run == bare.free_run
