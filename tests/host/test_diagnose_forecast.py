"""Predictions ahead use what the noise model foretells, and errors one row ahead are what the likelihood says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.predictor.noise import filter_var
from aeolid.diagnose.validation.forecast import Forecast, errors_ahead, noise_ahead, restarted


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    """Prepare the rig with next to no process noise: what that leaves is coloured, and two lags foretell it."""
    study = load_study("diagnosis")
    folder = tmp_path_factory.mktemp("ahead") / "case"
    found = prepare(load_case(study.write_case(folder, study.Hidden("null", "equations"), 900, 5)))
    predictor, noise = found.predictor.with_order(2), found.fit.point.noise.copy()
    noise[: len(found.extended.states)] = 1e-6
    return replace(found, predictor=predictor, fit=predictor.at(replace(found.fit.point, noise=noise), found.free))


def test_one_row_ahead_errs_by_the_whitened_innovation(prepared: Prepared) -> None:
    predictor, fit = prepared.predictor, prepared.fit
    forecast = Forecast(predictor, fit.point, fit, 5)
    segment, e = predictor.segments[0], predictor.innovations(fit.point)[0]
    white = filter_var(e, fit.noise.var)
    for k in (2, 3, 57, 400):
        np.testing.assert_allclose(segment.y[k] - forecast.rows(0, k, 1)[0], white[k], atol=1e-12)
    assert np.any(np.std(white, axis=0) < 0.5 * np.std(e, axis=0))  # there is a colour to foretell


def test_what_is_foretold_follows_the_recursion() -> None:
    rng = np.random.default_rng(2)
    var = 0.3 * rng.standard_normal((2, 3, 3))
    past, known = rng.standard_normal((2, 3)), []
    for j in range(6):
        lags = [*known[::-1], *past][:2] if j else list(past)
        known.append(var[0] @ lags[0] + var[1] @ lags[1])
    np.testing.assert_allclose(noise_ahead(var, 6) @ past.ravel(), known, atol=1e-12)


def test_a_noise_model_that_grows_is_bounded() -> None:
    far = noise_ahead(np.array([[[1.02]], [[0.01]]]), 5000)
    assert np.all(np.abs(far) < 2.0) and abs(far[-1, 0, 0]) < 1.0
    assert noise_ahead(np.zeros((0, 2, 2)), 4).shape == (4, 2, 0)


def test_without_a_noise_model_the_state_alone_predicts(prepared: Prepared) -> None:
    predictor = prepared.predictor.with_order(0)
    fit = predictor.at(prepared.fit.point, prepared.free)
    forecast, states = Forecast(predictor, fit.point, fit, 20), predictor.run(fit.point, 0)[2]
    blank, zero = np.full((20, 2), np.nan), np.zeros_like(predictor.gain(fit.point))
    expected = predictor.run_rows(fit.point, 0, 100, blank, states[100], zero)[1]
    np.testing.assert_allclose(forecast.rows(0, 100, 20), expected, atol=1e-12)
    assert restarted(forecast, 20)[0].shape == predictor.segments[0].y[predictor.segments[0].burn :].shape
    assert np.all(errors_ahead(forecast, 1) < errors_ahead(forecast, 20))
