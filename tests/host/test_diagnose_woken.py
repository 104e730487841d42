"""The best candidates are fitted on from noise that is brought back, as the baseline is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.woken import woken
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.scoring.scores import score_bank


@pytest.fixture(scope="module")
def lag(tmp_path_factory: pytest.TempPathFactory) -> tuple[Prepared, Candidate]:
    """A rig whose drive lags, and that effect as fitted."""
    study = load_study("diagnosis")
    hidden = study.Hidden("lag", "equations", {"lag": 0.06})
    folder: Path = tmp_path_factory.mktemp("lag")
    prepared = prepare(load_case(study.write_case(folder / "case", hidden, 1200, 5)))
    bank = score_bank(prepared, [a for a in prepared.hypotheses if a.entry == "actuator_lag"], 1)
    return prepared, fit_rows(prepared, bank.rows)[0]


def with_a_deaf_sensor(found: Candidate) -> Candidate:
    """Return the candidate with its last sensor so noisy that the filter ignores it, where slopes are gone."""
    free = found.fit.free
    noise = found.fit.point.noise.copy()
    noise[max(free.noise)] = 1e8
    fit = found.predictor.at(replace(found.fit.point, noise=noise), free)
    lost = fit.log_posterior - found.fit.log_posterior
    return replace(found, fit=fit, fit_gain=found.fit_gain + lost)


def test_a_noise_that_is_far_off_is_brought_back(lag: tuple[Prepared, Candidate]) -> None:
    prepared, found = lag
    deaf = with_a_deaf_sensor(found)
    assert deaf.fit.log_posterior < found.fit.log_posterior - 50
    (again,) = woken(prepared, [deaf], ())
    assert again.key == deaf.key and again.fit.log_posterior > found.fit.log_posterior - 1.0
    assert again.fit_gain == pytest.approx(again.fit.log_posterior - prepared.fit.log_posterior, abs=1e-6)
    assert np.sum(again.select_difference) == pytest.approx(again.select_gain)
    tau = [c.values[c.key]["tau_s"][0] for c in (again, found)]
    assert tau[0] == pytest.approx(tau[1], rel=0.02)


def test_what_was_asked_before_or_gains_nothing_stays(lag: tuple[Prepared, Candidate]) -> None:
    prepared, found = lag
    assert woken(prepared, [with_a_deaf_sensor(found)], {found.key}) == []
    for again in woken(prepared, [found], ()):
        assert again.fit.log_posterior > found.fit.log_posterior
