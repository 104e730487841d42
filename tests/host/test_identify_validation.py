"""Check fit and residual tests: their level on exact models, their power on wrong ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import aeolid as ae
from aeolid.errors import NotIdentifiable
from aeolid.identify.correlation import whiten
from aeolid.identify.fit import measure_fit
from aeolid.identify.ort import identify_ort
from aeolid.identify.residuals import run_residual_tests
from aeolid.identify.validation import validate_model
from aeolid.identify.varx import identify_varx
from aeolid.models.load import LinearModel
from aeolid.models.prediction import predict
from aeolid.plants.disturbed_loop import disturbed_plant, simulate_disturbed_loop
from aeolid.plants.lti import fourth_order, simulate_fourth_order

NAMES = ("y1", "y2"), ("u1", "u2")


def test_level_on_the_exact_model_in_closed_loop():
    """200 closed-loop recordings, exact predictor: 1 % of runs may alarm, 8 of 200 once in 1000."""
    model, alarms = fourth_order(), 0
    for seed in range(200):
        record = simulate_fourth_order(600, seed, feedback=0.25)
        u, y = record.matrix("input"), record.matrix("output")
        innovations = y - predict(model, u, y, 1, np.zeros(4))
        report = run_residual_tests(innovations, u, *NAMES)
        alarms += report.verdict != "pass"
    assert alarms <= 7


def test_coloured_inputs_do_not_raise_the_level():
    """Without whitening the input a strongly coloured one alarms in most runs."""
    random, alarms = np.random.default_rng(1), 0
    for _ in range(100):
        e = random.standard_normal((800, 1))
        u = np.zeros((800, 1))
        for k in range(1, 800):
            u[k] = 0.98 * u[k - 1] + random.standard_normal(1)
        alarms += run_residual_tests(e, u, ("y",), ("u",)).verdict != "pass"
    assert alarms <= 5


def test_whitening_leaves_no_correlation():
    random = np.random.default_rng(2)
    u = np.convolve(random.standard_normal(20000), [1, 0.9, 0.5, 0.2], mode="valid")
    white = whiten(u)[30:]
    lags = [white[t:] @ white[:-t] / (white @ white) for t in range(1, 10)]
    assert np.max(np.abs(lags)) < 0.03


def test_a_missing_pole_fails_and_a_negligible_one_is_immaterial():
    record = simulate_fourth_order(8000, 5, feedback=0.25)
    small = identify_varx([record], past=10, order=2)
    result = validate_model(LinearModel(small.model), simulate_fourth_order(4000, 6, feedback=0.25))
    assert result.residuals.verdict == "fail"
    random = np.random.default_rng(3)
    u = random.standard_normal((200_000, 1))
    e = random.standard_normal((200_000, 1))
    e[1:] += 0.03 * u[:-1]  # 0.09 % of the variance: true, and of no consequence
    report = run_residual_tests(e, u, ("y",), ("u",))
    found = next(t for t in report.tests if t.against == "u")
    assert report.verdict == "immaterial" and found.predictable == pytest.approx(9e-4, rel=0.3)


def test_identified_model_passes_on_fresh_data():
    model = identify_varx([simulate_fourth_order(20000, 7, feedback=0.25)], past=20, order=4).model
    result = validate_model(LinearModel(model), simulate_fourth_order(2000, 8, feedback=0.25), (5, 20))
    assert result.residuals.verdict in ("pass", "immaterial")
    one, five, twenty = (s.nrmse["y1"] for s in (result.fit.one_step, result.fit.steps[5], result.fit.steps[20]))
    assert one < five < twenty <= result.free_run.nrmse["y1"] * 1.05
    assert "innovations: " in result.summary()


def test_advice_tells_a_wrong_gain_from_missing_dynamics():
    """The same plant with five times its K, an identified one, one with too few states, one that has changed."""
    fresh, true = simulate_disturbed_loop(4000, 100), disturbed_plant()
    wrong = validate_model(LinearModel(replace(true, K=5 * true.K)), fresh)
    assert wrong.residuals.verdict == "fail" and len(wrong.advice) == 1
    assert "The gain K does not fit the noise of y: " in wrong.advice[0] and "longer past window" in wrong.summary()
    assert wrong.advice[0].endswith("A free run predicts better here than K does.")
    assert wrong.to_json()["advice"] == list(wrong.advice)
    found = identify_ort([simulate_disturbed_loop(20000, 1)], past=20, order=2, joint_order=3)
    right = validate_model(LinearModel(found.model), fresh)
    assert right.residuals.verdict == "pass" and right.advice == ()
    slow = identify_varx([simulate_fourth_order(8000, 5)], past=10, order=2)
    missing = validate_model(LinearModel(slow.model), simulate_fourth_order(4000, 6))
    assert any("dynamics are missing or have changed" in a for a in missing.advice)
    model = fourth_order()
    changed = replace(model, B=model.B * 0.9)  # the plant's gain has moved, its noise has not
    moved = validate_model(LinearModel(changed), simulate_fourth_order(20000, 7))
    assert moved.residuals.verdict == "fail" and any("Past u" in a for a in moved.advice)


def test_advice_for_another_plant_does_not_blame_the_gain():
    """A model with the wrong sign predicts worse than the mean, with and without its K: K is not what is wrong."""
    model = fourth_order()
    other = validate_model(LinearModel(replace(model, B=-3 * model.B)), simulate_fourth_order(4000, 7))
    assert len(other.advice) == 1
    assert "the plant is not this model" in other.advice[0]
    assert "gain K" not in other.advice[0]
    growing = validate_model(LinearModel(replace(model, K=1e4 * np.abs(model.K))), simulate_fourth_order(400, 7))
    assert len(growing.advice) == 1
    assert "A - K C has an eigenvalue outside the unit circle" in growing.advice[0]


def test_rounding_is_no_finding():
    """Exact data, as they are and with seven digits: what is left is not white, and of no consequence."""
    clean, fresh = (simulate_fourth_order(2000, seed, noise_variance=0.0) for seed in (0, 1))
    digits = replace(fresh, values=fresh.values.astype(np.float32).astype(np.float64))
    found = identify_varx([clean], past=6, order=4, regularization="none").model
    for model in (found, fourth_order()):
        for record in (fresh, digits):
            result = validate_model(LinearModel(model), record)
            assert result.residuals.verdict in ("pass", "immaterial") and result.advice == ()
    slightly = replace(fourth_order(), B=fourth_order().B * 1.00001)
    assert validate_model(LinearModel(slightly), fresh).residuals.verdict == "fail"


def test_model_without_noise_model_is_scored_by_its_free_run():
    record = simulate_fourth_order(1000, 9)
    bare = replace(fourth_order(), K=None)
    result = validate_model(LinearModel(bare), record)
    assert result.fit is None and result.residuals is None
    assert result.worst_nrmse("one-step") == np.inf > result.worst_nrmse("free-run")
    assert "no noise model" in result.summary()


def test_fit_goes_around_gaps_and_refuses_a_recording_of_gaps():
    record = simulate_fourth_order(1000, 10)
    values = record.values.copy()
    values[400:420, 2] = np.nan
    fit = measure_fit(fourth_order(), [replace(record, values=values)])
    assert fit.samples == 980
    np.testing.assert_allclose(np.cov(fit.innovations.T), np.eye(2), atol=0.2)
    values[::5] = np.nan
    with pytest.raises(NotIdentifiable, match="10 samples in a row"):
        measure_fit(fourth_order(), [replace(record, values=values)])


def test_diverging_model_is_not_a_number_in_json_but_null():
    record = simulate_fourth_order(3000, 11)
    wild = replace(fourth_order(), A=1.5 * fourth_order().A)
    result = validate_model(LinearModel(replace(wild, K=None)), record)
    assert result.to_json()["free_run"]["vaf"]["y1"] is None
    assert result.free_run.text("y1") == "diverges"


def test_too_few_samples_decide_nothing_and_a_fail_among_them_stands():
    """Over 19 samples not even a memory that explains half of the innovations is found in one of 50 recordings."""
    random, found = np.random.default_rng(4), []
    for _ in range(50):
        e = lfilter([1.0], [1.0, -np.sqrt(0.5)], random.standard_normal((19, 1)), axis=0)
        found.append(run_residual_tests(e, random.standard_normal((19, 1)), ("y",), ("u",)).verdict)
    assert set(found) == {"undecided"}
    e, u = random.standard_normal((99, 1)), random.standard_normal((99, 1))
    report = run_residual_tests(e, u, ("y",), ("u",))
    assert report.verdict == "undecided" and (report.samples, report.needed) == (99, 100)
    assert {t.verdict for t in report.tests} == {"undecided"}
    assert run_residual_tests(np.cumsum(e, axis=0), u, ("y",), ("u",)).verdict == "fail"
    longer = run_residual_tests(np.append(e, [[0.0]], axis=0), np.append(u, [[0.0]], axis=0), ("y",), ("u",))
    assert longer.verdict == "pass"


def test_a_short_validation_says_in_all_forms_that_nothing_is_decided():
    record = simulate_fourth_order(19, 7)
    result = validate_model(LinearModel(fourth_order()), record)
    assert "innovations: not decided (too few samples: 19, of 120 that are needed" in result.summary()
    facts = result.to_json()["residuals"]
    assert (facts["verdict"], facts["samples"], facts["needed"]) == ("undecided", 19, 120)
    told = ae.validate(ae.LinearModel(fourth_order()), ae.Record.of_core(record))
    assert told.verdict == "undecided" and "innovations undecided" in repr(told)


def test_few_lines_in_an_input_do_not_raise_the_level():
    """A sine or a few lines are predicted to rounding: 2 of 300 may alarm by chance, 10 in no 10,000 trials."""
    alarms = 0
    for lines in (1, 8, 14, 30):
        for seed in range(75):
            random = np.random.default_rng(seed)
            phases, t = random.uniform(0, 2 * np.pi, lines), np.arange(600)
            u = np.sin(2 * np.pi * np.outer(t, np.linspace(0.01, 0.2, lines)) + phases).sum(axis=1)
            report = run_residual_tests(random.standard_normal((600, 1)), u[:, None], ("y",), ("u",))
            alarms += any(t.p_value <= report.level for t in report.tests if t.kind == "input")
    assert alarms < 10


def test_a_right_model_of_few_samples_passes_on_many():
    """Each of p parameters adds 1/(l N) to its errors on fresh samples: no missing dynamics, and no advice."""
    failed, wrong, gains = 0, 0, 0
    for seed in range(12):
        first, fresh = (simulate_fourth_order(n, k, feedback=0.25) for n, k in ((300, seed), (3000, seed + 100)))
        for order in (4, 3):
            found = identify_varx([first], past=10, order=order, uncertainty="none")
            report = validate_model(LinearModel(found.model), fresh, (), found.windows).residuals
            failed += order == 4 and report.verdict == "fail"
            wrong += order == 3 and report.verdict == "fail"
            if order == 4:
                other = replace(found.model, K=0.0 * found.model.K)  # no noise model
                gains += validate_model(LinearModel(other), fresh, (), found.windows).residuals.verdict == "fail"
    assert failed <= 1 and wrong == gains == 12


def test_a_model_without_the_facts_of_its_identification_is_tested_as_exact_and_says_so():
    model, fresh = fourth_order(), simulate_fourth_order(2000, 5)
    other = LinearModel(replace(model, K=0.0 * model.K))
    assert "the model is taken as exact" in validate_model(other, fresh).summary()
    assert "the model is taken as exact" not in validate_model(other, fresh, (), 2000.0).summary()
