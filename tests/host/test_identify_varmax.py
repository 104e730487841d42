"""Check VARMAX identification: laws, the papers' systems, the positive-real condition, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from test_identify_varx import BOTH, REFERENCE, needs_reference, pole_errors, stored_record

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.identify.extended import collect, innovations, run_pass
from aeolid.identify.positive_real import check_positive_real, noise_polynomial
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.models.prediction import free_run, vaf
from aeolid.models.state_space import from_json
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order
from aeolid.record import Channel, Record

TURBINE = ("pitch", "generator_torque")
TRUE = np.linalg.eigvals(fourth_order().A)


@pytest.fixture(scope="module")
def loop_record():
    return simulate_fourth_order(4000, 11, feedback=0.25, noise_variance=0.49)


@pytest.fixture(scope="module")
def turbine_record():
    return simulate_closed_loop(10000, 1, excitation=Excitation(noise=0.01))


def armax(samples, seed, c, a=(-1.6, 0.8), b=(1.0, 0.5)):
    """Simulate y_k = −a₁ y_{k−1} − a₂ y_{k−2} + b₁ u_{k−1} + b₂ u_{k−2} + e_k + c₁ e_{k−1} + c₂ e_{k−2}."""
    random = np.random.default_rng(seed)
    u, e, y = random.standard_normal(samples), 0.5 * random.standard_normal(samples), np.zeros(samples)
    for k in range(2, samples):
        y[k] = e[k] + c[0] * e[k - 1] + c[1] * e[k - 2] + b[0] * u[k - 1] + b[1] * u[k - 2]
        y[k] -= a[0] * y[k - 1] + a[1] * y[k - 2]
    channels = (Channel("u", "", "input"), Channel("y", "", "output"))
    return Record(np.arange(samples) * 1.0, np.column_stack([u, y]), channels, 1.0, "armax", ""), e


def textbook_pass(x, past, inputs, theta, forgetting, rho, through=()):
    """Run the recursion of paper 000 section II-E as printed, on P itself; for data where it does not diverge."""
    outputs = x.shape[1] - inputs
    e = np.zeros((len(x), outputs))
    P = np.eye(theta.shape[1]) / rho
    for k in range(past, len(x)):
        z = np.hstack([*(np.concatenate([x[t], e[t]]) for t in range(k - past, k)), x[k, list(through)]])
        G = P @ z / (forgetting + z @ P @ z)
        theta = theta + np.outer(x[k, inputs:] - theta @ z, G)
        P = (P - np.outer(G, z @ P)) / forgetting
        e[k] = x[k, inputs:] - theta @ z
    return theta, e


@pytest.mark.parametrize("forgetting", [0.99, 1.0])
@pytest.mark.parametrize("through", [(), (1,), (0, 1)])
def test_a_pass_is_the_recursion_of_the_paper(loop_record, forgetting, through):
    scaling = find_scaling([loop_record])
    samples = collect([loop_record.slice(0, 400)], scaling, 3)
    start = 0.1 * np.random.default_rng(0).standard_normal((2, 18 + len(through)))
    theta, e = start.copy(), np.zeros((400, 2))
    run_pass(samples, 3, through, theta, e, forgetting, 0.1)
    expected, residual = textbook_pass(samples.x, 3, 2, start, forgetting, 0.1, through)
    np.testing.assert_allclose(theta, expected, atol=1e-9)
    np.testing.assert_allclose(e, residual, atol=1e-9)


def test_passes_go_through_where_the_conventional_form_is_lost(turbine_record):
    """λ = 0.99 on the printed study, N = 10,000, three outputs with innovations of rank two."""
    record = simulate_closed_loop(10000, 3)
    samples = collect([record], find_scaling([record]), 10)
    with np.errstate(all="ignore"):
        _, lost = textbook_pass(samples.x, 10, 2, np.zeros((3, 80)), 0.99, 1e-3)
    assert not np.isfinite(lost).all() or np.abs(lost).max() > 1e3  # several thousand standard deviations of y
    theta, e = np.zeros((3, 80)), np.zeros((10000, 3))
    for _ in range(2):
        run_pass(samples, 10, (), theta, e, 0.99, 0.1)
    assert np.abs(e[200:]).max() < 1.0 and np.isfinite(theta).all()


def test_a_pass_does_not_run_across_a_hole_or_from_one_recording_into_the_next(loop_record):
    """Windows with a missing sample and windows over two recordings are no regressors: P, Ξ and e skip them."""
    first, second = loop_record.slice(0, 150), loop_record.slice(1000, 1150)
    values = first.values.copy()
    values[70, 1] = np.nan
    samples = collect([replace(first, values=values), second], find_scaling([loop_record]), 3)
    assert samples.starts.tolist() == [0, 71, 150] and samples.stops.tolist() == [70, 150, 300]
    theta, e = np.zeros((2, 18)), np.zeros((300, 2))
    run_pass(samples, 3, (), theta, e, 0.995, 0.1)
    expected, P, residual = np.zeros((2, 18)), np.eye(18) / 0.1, np.zeros((300, 2))
    for k in [*range(3, 70), *range(74, 150), *range(153, 300)]:
        z = np.hstack([np.concatenate([samples.x[t], residual[t]]) for t in range(k - 3, k)])
        G = P @ z / (0.995 + z @ P @ z)
        expected = expected + np.outer(samples.x[k, 2:] - expected @ z, G)
        P = (P - np.outer(G, z @ P)) / 0.995
        residual[k] = samples.x[k, 2:] - expected @ z
    np.testing.assert_allclose(theta, expected, atol=1e-9)
    np.testing.assert_allclose(e, residual, atol=1e-9)
    used = samples.used(3)
    assert used.sum() == 67 + 76 + 147 and not e[~used].any()
    held = innovations(samples, 3, np.hstack([theta, np.zeros((2, 2))]), np.zeros(2), e, feed_back=False)
    assert not held[~used].any() and np.abs(held[used]).min() > 0


def test_fed_back_innovations_are_the_predictor_run_by_hand(loop_record):
    scaling = find_scaling([loop_record])
    samples = collect([loop_record.slice(0, 60)], scaling, 2)
    theta = 0.2 * np.random.default_rng(0).standard_normal((2, 14))
    constant, zero = np.array([0.3, -0.1]), np.zeros((60, 2))
    e = np.zeros((60, 2))
    for k in range(2, 60):
        z = np.concatenate([samples.x[k - 2], e[k - 2], samples.x[k - 1], e[k - 1], samples.x[k, :2]])
        e[k] = samples.x[k, 2:] - constant - theta @ z
    np.testing.assert_allclose(innovations(samples, 2, theta, constant, zero, feed_back=True), e, atol=1e-12)
    held = innovations(samples, 2, theta, constant, e, feed_back=False)
    np.testing.assert_allclose(held, e, atol=1e-12)  # e is its own image


def test_arma_parameters_converge_to_the_true_ones():
    """N = 40,000: the moving average, which VARX of this window cannot hold, comes out within 0.03 (3 deviations)."""
    record, e = armax(40000, 5, (-0.7, 0.2))
    result = identify_varmax([record], past=2, order=2, regularization="none")
    theta = result.markov_parameters[0]  # [u y e] of k − 2, then of k − 1, then the present input
    np.testing.assert_allclose(theta[[3, 0]], [1.0, 0.5], atol=0.03)
    np.testing.assert_allclose(theta[[4, 1]], [1.6, -0.8], atol=0.03)
    np.testing.assert_allclose(theta[[5, 2]], [-0.7, 0.2], atol=0.03)
    assert result.model.innovation_covariance[0, 0] == pytest.approx(0.25, rel=0.03)
    short = identify_varx([record], past=2, order=2)
    assert short.model.innovation_covariance[0, 0] > 1.02 * result.model.innovation_covariance[0, 0]
    assert e.std() == pytest.approx(0.5, rel=0.02)


def test_short_varmax_window_does_what_a_long_varx_window_does():
    """Fourth-order loop, N = 3000, 12 experiments: p = 3 against VARX p = 15, whose memory covers the predictor."""
    short, long, truncated = [], [], []
    for seed in range(12):
        record = simulate_fourth_order(3000, seed, feedback=0.25, noise_variance=0.49)
        short.append(pole_errors(identify_varmax([record], past=3, order=4).eigenvalues, TRUE).mean())
        long.append(pole_errors(identify_varx([record], past=15, order=4).eigenvalues, TRUE).mean())
        truncated.append(pole_errors(identify_varx([record], past=3, order=4).eigenvalues, TRUE).mean())
    assert np.mean(short) < 1.1 * np.mean(long)
    assert np.mean(short) < np.mean(truncated)


def test_noise_free_data_give_the_exact_system():
    model = replace(fourth_order(), D=np.array([[0.5, 0.0], [-0.2, 0.0]]), K=None)
    u = np.random.default_rng(0).standard_normal((2000, 2)) + 3.0
    clean = replace(simulate_fourth_order(2000, 0), values=np.hstack([u, model.simulate(u)]))
    result = identify_varmax([clean], past=6, order=4, feedthrough=("u1",), regularization="none")
    assert np.max(pole_errors(result.eigenvalues, TRUE)) < 1e-6
    assert min(result.fit.free_run.vaf.values()) > 100 - 1e-6
    assert result.extra["varmax"]["positive_real"]["innovation_rank"] <= 2
    assert result.extra["varmax"]["forgetting"] == [] and not any("diverged" in n for n in result.notes)


def test_units_and_offsets_change_nothing_but_the_numbers_units(loop_record):
    gains, offsets = np.array([1e-3, 57.3, 1e6, 0.02]), np.array([5.0, -3.0, 1e4, 0.0])
    base = identify_varmax([loop_record], past=5, order=4)
    other = identify_varmax([replace(loop_record, values=loop_record.values * gains + offsets)], past=5, order=4)
    assert np.max(pole_errors(other.eigenvalues, base.eigenvalues)) < 1e-8
    assert other.extra["varmax"]["positive_real"]["margin"] == pytest.approx(
        base.extra["varmax"]["positive_real"]["margin"], abs=1e-6
    )
    factor = np.tile(np.concatenate([gains, gains[2:]]), 5)
    expected = base.markov_parameters[:, :30] * gains[2:, None] / factor
    np.testing.assert_allclose(other.markov_parameters[:, :30], expected, rtol=1e-5, atol=1e-12)


def test_closed_loop_estimate_is_consistent():
    record = simulate_fourth_order(60000, 3, feedback=0.25, noise_variance=0.49)
    result = identify_varmax([record], past=5, order=4)
    assert np.max(pole_errors(result.eigenvalues, TRUE)) < 0.003
    fresh = simulate_fourth_order(4000, 4, noise_variance=0.0)
    assert vaf(fresh.matrix("output"), free_run(result.model, fresh.matrix("input"), np.zeros(4))).min() > 99.9
    assert result.extra["varmax"]["positive_real"]["holds"]


def test_recordings_are_merged_and_none_is_lost():
    long, short = simulate_fourth_order(4000, 1), simulate_fourth_order(400, 2)
    both = identify_varmax([long, short], past=5, order=4)
    alone = [identify_varmax([r], past=5, order=4) for r in (long, short)]
    assert both.windows == alone[0].windows + alone[1].windows
    distance = [pole_errors(both.eigenvalues, a.eigenvalues).max() for a in alone]
    assert 1e-6 < distance[0] < 0.3 * distance[1]
    turned = identify_varmax([short, long], past=5, order=4)
    assert pole_errors(turned.eigenvalues, both.eigenvalues).max() < 0.3 * distance[1]


def test_missing_samples_are_left_out_and_said(loop_record):
    values = loop_record.values.copy()
    values[np.random.default_rng(0).integers(0, 4000, 30), 2] = np.nan
    result = identify_varmax([replace(loop_record, values=values)], past=5, order=4)
    plain = identify_varx([replace(loop_record, values=values)], past=5, order=4)
    assert result.skipped == plain.skipped and "were left out" in result.notes[0]
    assert plain.windows - 31 * 5 <= result.windows < plain.windows  # e is not known for 5 samples after each hole
    assert np.max(pole_errors(result.eigenvalues, TRUE)) < 0.02


def test_order_of_the_turbine_is_seven_with_a_reason(turbine_record):
    result = identify_varmax([turbine_record], past=10, feedthrough=TURBINE)
    assert result.order == 7
    assert result.order_choice.reason.startswith("order 7: the smallest whose one-step error on the held-out last 30%")


def test_turbine_with_ten_blocks_is_as_good_as_varx_with_thirty():
    """Four realisations, 1 % noise: poles on average within 15 % (twice the scatter of this ratio), VAF within 0.01."""
    true, ours, theirs, gains = np.linalg.eigvals(build_turbine().A), [], [], []
    for seed in range(4):
        record = simulate_closed_loop(10000, seed, excitation=Excitation(noise=0.01))
        short = identify_varmax([record], past=10, order=7, feedthrough=TURBINE)
        long = identify_varx([record], past=30, future=10, order=7, feedthrough=TURBINE)
        ours.append(pole_errors(short.eigenvalues, true))
        theirs.append(pole_errors(long.eigenvalues, true))
        gains.append([short.fit.one_step.vaf[n] - long.fit.one_step.vaf[n] for n in record.names("output")])
    assert np.mean(ours) < 1.15 * np.mean(theirs)
    assert np.mean(gains, axis=0).min() > -0.01


@needs_reference
def test_stored_turbine_recordings_no_farther_than_the_toolbox():
    """Paper 000's study, p = f = 10, four stored recordings; the toolbox's extended least squares as shipped."""
    true = np.linalg.eigvals(build_turbine().A)
    ours, theirs = [], []
    for i in range(4):
        result = identify_varmax([stored_record(f"hawt_0{i}")], past=10, order=7, feedthrough=BOTH)
        ours.append(pole_errors(result.eigenvalues, true).mean())
        answer = np.load(REFERENCE / "toolbox" / f"hawt_elsdef_0{i}.npz")
        theirs.append(pole_errors(np.linalg.eigvals(answer["A"]), true).mean())
    assert np.mean(ours) <= np.mean(theirs), (ours, theirs)


def test_standard_deviations_of_poles_cover_the_scatter():
    """Predicted deviations of the poles against the scatter of 60 closed-loop experiments (16 % at one sigma)."""
    frequencies, dampings, predicted = [], [], []
    for seed in range(60):
        record = simulate_fourth_order(1500, seed, feedback=0.25, noise_variance=0.49)
        modes = identify_varmax([record], past=5, order=4, regularization="none").modes
        assert len(modes) == 2
        frequencies.append([m.frequency_hz for m in modes])
        dampings.append([m.damping for m in modes])
        predicted.append([[m.frequency_std_hz, m.damping_std] for m in modes])
    scatter = np.column_stack([np.std(frequencies, axis=0), np.std(dampings, axis=0)])
    ratio = np.mean(predicted, axis=0) / scatter
    assert np.all((ratio > 0.7) & (ratio < 1.35)), ratio


def test_positive_real_condition_of_first_and_second_order():
    """Closed forms: Re 1/(1 + c z⁻¹) is least 1/(1 + |c|); with c₂ the minimum is found on a fine grid."""
    for c in (0.5, -0.9, 0.0):
        verdict = check_positive_real(np.array([[0.0, 0.0, c]]), 1, 1, np.eye(1), 0.1)
        assert verdict.margin == pytest.approx(1 / (1 + abs(c)) - 0.5, abs=1e-9) and verdict.holds
        assert verdict.radius == pytest.approx(abs(c), abs=1e-9)
    omega = np.linspace(0, np.pi, 200001)
    for c1, c2 in ((1.8, 0.9), (-1.5, 0.7)):
        verdict = check_positive_real(np.array([[0.0, 0.0, c2, 0.0, 0.0, c1]]), 2, 1, np.eye(1), 0.1)
        exact = np.real(1 / (1 + c1 * np.exp(-1j * omega) + c2 * np.exp(-2j * omega))).min() - 0.5
        assert verdict.margin == pytest.approx(exact, rel=1e-3) and not verdict.holds
        assert "fails" in verdict.text and verdict.radius == pytest.approx(np.sqrt(c2), rel=1e-9)
    for radius in (0.999, 0.99999):  # between two of the even frequencies: the dip is as narrow as its distance
        c1, c2 = -2 * radius * np.cos(1.0), radius**2
        near = 1.0 + np.linspace(-50, 50, 100001) * (1 - radius)
        exact = np.real(1 / (1 + c1 * np.exp(-1j * near) + c2 * np.exp(-2j * near))).min() - 0.5
        verdict = check_positive_real(np.array([[0.0, 0.0, c2, 0.0, 0.0, c1]]), 2, 1, np.eye(1), 0.1)
        assert verdict.margin == pytest.approx(exact, rel=0.06)
    outside = check_positive_real(np.array([[0.0, 0.0, -1.5]]), 1, 1, np.eye(1), 0.1)
    assert not outside.holds and "does not forget" in outside.text


def test_positive_real_condition_does_not_depend_on_units_or_on_silent_directions():
    random = np.random.default_rng(4)
    theta = 0.15 * random.standard_normal((3, 2 * 8))
    root = random.standard_normal((3, 3))
    base = check_positive_real(theta, 2, 2, root @ root.T, 0.1)
    T = np.diag([2.0, 0.5, 1.5])  # y' = T y: Ξᵉ' = T Ξᵉ T⁻¹
    other = theta.copy().reshape(3, 2, 8)
    other[:, :, 5:] = np.einsum("ij,jpk,kl->ipl", T, other[:, :, 5:], np.linalg.inv(T))
    scaled = check_positive_real(other.reshape(3, 16), 2, 2, T @ root @ root.T @ T, 0.1)
    assert scaled.margin == pytest.approx(base.margin, abs=1e-9) and base.rank == 3
    silent = root[:, :2] @ root[:, :2].T  # two noise sources for three outputs
    wild = theta.copy().reshape(3, 2, 8)
    null = np.linalg.svd(root[:, :2].T)[2][2]
    wild[:, :, 5:] += 50 * np.einsum("i,k->ik", random.standard_normal(3), null)[:, None, :]  # acts on no innovation
    silent = silent + 1e-5 * np.eye(3)  # what is left there by rounding and regularisation
    quiet, loud = (check_positive_real(t.reshape(3, 16), 2, 2, silent, 0.1) for t in (theta, wild))
    assert loud.margin == pytest.approx(quiet.margin, abs=1e-3) and loud.rank == 2


def test_noise_polynomial_reads_the_blocks_of_e():
    theta = np.arange(2 * 12.0).reshape(2, 12)  # r = 1, l = 2, p = 2: blocks of 5, and 2 more that are not read
    H = noise_polynomial(theta, 2, 1)
    np.testing.assert_array_equal(H[0], np.eye(2))
    np.testing.assert_array_equal(H[1], theta[:, 8:10])
    np.testing.assert_array_equal(H[2], theta[:, 3:5])


def test_a_system_far_from_positive_real_is_told_and_still_identified():
    """H̄ = 1 + 1.8 z⁻¹ + 0.9 z⁻²: (25) fails by several units; the verdict says so, a longer start saves the model."""
    record, _ = armax(20000, 7, (1.8, 0.9))
    result = identify_varmax([record], past=2, order=2)
    facts = result.extra["varmax"]["positive_real"]
    assert not facts["holds"] and facts["margin"] < -0.5
    assert any("positive-real condition fails" in n for n in result.notes)
    assert result.model.innovation_covariance[0, 0] < 1.1 * 0.25
    np.testing.assert_allclose(result.markov_parameters[0, [5, 2]], [1.8, 0.9], atol=0.03)
    assert any("led astray" in n for n in result.notes) and facts["zero_radius"] < 1
    true = np.roots([1, -1.6, 0.8])
    assert pole_errors(result.eigenvalues, true).max() < 0.01


def test_a_step_gains_more_than_parameters_without_meaning_would():
    """n = 2 (1 + 1 + 1): every step of residual whitening that is taken lowers the log error power by more than n/N."""
    record, _ = armax(20_000, 5, (-1.2, 0.5))
    facts = identify_varmax([record], past=2, order=2, passes=1, uncertainty="none").extra["varmax"]
    gains = -np.diff(facts["log_error_power"][1:])
    assert len(gains) == facts["iterations"] > 2 and np.all(gains > 6 / 20_000)
    assert facts["stopped"] == "no step lowers the log error power by more than 0.0003"


def test_streamed_parameters_equal_to_the_estimate_give_the_same_model(loop_record):
    base = identify_varmax([loop_record], past=5, order=4, feedthrough=("u1",), regularization="none")
    streamed = StreamedMarkov(base.markov_parameters[:, :31], "stream")
    other = identify_varmax([loop_record], past=5, order=4, feedthrough=("u1",), markov=streamed)
    assert other.extra["varmax"]["stopped"] == "Ξ as streamed"
    assert (
        pole_errors(other.eigenvalues, base.eigenvalues).max() < 3e-3
    )  # e is found anew; the poles scatter by as much
    np.testing.assert_allclose(other.markov_parameters[:, :31], streamed.theta, rtol=1e-9)


def test_a_streamed_predictor_that_does_not_forget_needs_its_innovations(loop_record):
    base = identify_varmax([loop_record], past=5, order=4)
    wild = base.markov_parameters[:, :30].copy()
    wild[0, 28] += 3.0  # the newest e of the first output: a zero far outside the circle
    with pytest.raises(DataError, match="does not forget"):
        identify_varmax([loop_record], past=5, order=4, markov=StreamedMarkov(wild, "m.npz"))
    e = np.random.default_rng(0).standard_normal((4000, 2)) * 0.7
    result = identify_varmax([loop_record], past=5, order=4, markov=StreamedMarkov(wild, "m.npz", e))
    assert any("that of the filter" in n for n in result.notes)


def test_result_is_complete_json_and_the_model_reads_back(loop_record):
    result = identify_varmax([loop_record], past=5, passes=3, forgetting=0.995)
    facts = result.to_json()
    assert facts["method"] == "varmax" and facts["settings"]["passes"] == 3
    assert {"order_reason", "eigenvalues", "modes", "fit", "singular_values", "varmax"} <= set(facts)
    assert facts["varmax"]["forgetting"] == pytest.approx([0.995, 0.995**0.5, 1.0])
    assert {"holds", "margin", "verdict", "innovation_rank"} <= set(facts["varmax"]["positive_real"])
    model = from_json(result.model_json(), "memory")
    np.testing.assert_array_equal(model.A, result.model.A)
    assert "positive-real" in result.summary()


@pytest.mark.parametrize(
    "options, error, words",
    [
        ({"past": 0}, UsageError, "past window 0"),
        ({"past": 5, "future": 6}, UsageError, "future window 6"),
        ({"past": 5, "feedthrough": ("u3",)}, UsageError, "'u3'"),
        ({"past": 5, "passes": -1}, UsageError, "passes -1"),
        ({"past": 5, "forgetting": 0.5}, UsageError, "forgetting 0.5"),
        ({"past": 5, "regularization": "lasso"}, UsageError, "'lasso'"),
        ({"past": 600}, NotIdentifiable, "needs at least"),
        ({"past": 5, "markov": StreamedMarkov(np.zeros((2, 20)), "m.npz")}, DataError, "VARX filter: --method varx"),
    ],
)
def test_bad_requests_are_named(loop_record, options, error, words):
    with pytest.raises(error, match=words):
        identify_varmax([loop_record], **options)


def test_too_few_samples_for_the_wider_windows_are_counted():
    record = simulate_fourth_order(70, 1)  # VARX p = 8 needs 37 windows, VARMAX 55 whose e is known: 54 there are
    with pytest.raises(
        NotIdentifiable, match=r": 54 complete windows of 17 samples; .* at least 55, that is 71 samples"
    ):
        identify_varmax([record], past=8, order=4)


def test_holes_that_leave_no_longer_start_are_no_crash():
    """(25) fails, and the longer VARX that would start again has not one window between the holes."""
    record, _ = armax(9000, 7, (1.8, 0.9))
    values = record.values.copy()
    values[::30] = np.nan
    result = identify_varmax([replace(record, values=values)], past=2, order=2)
    assert not result.extra["varmax"]["positive_real"]["holds"]
    assert result.extra["varmax"]["start"] == "varx, past window 2"


def test_holes_that_leave_no_varmax_window_are_counted(loop_record):
    """Every 16th sample missing: VARX windows of 9 samples there are, VARMAX ones of 17 none."""
    values = loop_record.values.copy()
    values[::16] = np.nan
    with pytest.raises(
        NotIdentifiable, match=r": 0 complete windows of 17 samples \(3984 more hold a missing sample\)"
    ):
        identify_varmax([replace(loop_record, values=values)], past=8, order=4, missing="leave-out")
