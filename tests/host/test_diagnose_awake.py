"""Noise that a fit left silent is raised where the recording asks for it, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.challenge.draw import build, draw_all
from aeolid.challenge.write import write_case
from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.predictor import awake
from aeolid.diagnose.predictor.explore import fit_quietly

STOPPED = (0.368, 4.19, 0.01, 63.9, 6.57e-3, 1e-7, 1e-3, 2.86e-4, 16.0, 12.2)  # amplitudes of the free noise, in sizes


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    study = load_study("diagnosis")
    hidden = study.Hidden("null", "equations", noise=(1.0, 0.02, 0.01))
    return prepare(load_case(study.write_case(tmp_path_factory.mktemp("awake") / "case", hidden, 1200, 5)))


@pytest.fixture(scope="module")
def turbine(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    folder = tmp_path_factory.mktemp("awake") / "case"
    sort, items, own = draw_all(30, 5)[12]
    write_case(folder, build(sort, items, own, 1200, False), 1200)
    return prepare(load_case(folder))


def test_one_optimum_is_reached_from_where_a_fit_had_stopped(turbine: Prepared) -> None:
    """A turbine's gust as white noise, its memory silent: a local optimum, where one instruction set's fit ended.

    The other's ended 16 nats higher, and what one of them named was ambiguous with the other.
    """
    found = turbine
    predictor, free, noise = found.predictor, found.free, found.fit.point.noise.copy()
    noise[list(free.noise)] = STOPPED
    stuck = fit_quietly(predictor, replace(found.fit.point, noise=noise), free)
    assert stuck is not None and stuck.log_posterior < found.fit.log_posterior - 5
    raised = awake.awakened(predictor, stuck, free)
    assert raised.log_posterior == pytest.approx(found.fit.log_posterior, abs=1.0)  # less than any decision turns on


def test_what_one_sensor_took_for_its_noise_is_given_back_by_all_others_together(
    turbine: Prepared, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """All amplitudes are measured by one sensor's: where that is loud, each other stays silent alone."""
    predictor, free, noise = turbine.predictor, turbine.free, turbine.fit.point.noise.copy()
    noise[list(free.noise)] *= 1e-3
    stuck = fit_quietly(predictor, replace(turbine.fit.point, noise=noise), free)
    assert stuck is not None and stuck.log_posterior < turbine.fit.log_posterior - 50
    together = awake.awakened(predictor, stuck, free)
    every = awake._moved
    monkeypatch.setattr(awake, "_moved", lambda point, free: every(point, free)[:-1])
    alone = awake.awakened(predictor, stuck, free)
    assert together.log_posterior > alone.log_posterior + 10  # ten nats decide between effects


def test_what_is_raised_is_never_worse_and_ends_where_no_noise_is_worth_raising(prepared: Prepared) -> None:
    found = awake.awakened(prepared.predictor, prepared.fit, prepared.free)
    assert found.log_posterior >= prepared.fit.log_posterior
    assert awake._best_moved(prepared.predictor, found.point, prepared.free) is None
    closer = fit_quietly(prepared.predictor, found.point, prepared.free, tolerance=1e-4)
    assert closer is not None
    assert closer.log_posterior - found.log_posterior < 0.1  # thresholds are nats; a tenth is what quieting may cost


def test_a_free_gain_has_no_noise_to_raise(prepared: Prepared) -> None:
    gain = np.zeros((len(prepared.fit.point.x0[0]), 1))
    fit = replace(prepared.fit, point=replace(prepared.fit.point, K=gain))
    assert awake.awakened(prepared.predictor, fit, prepared.free) is fit
