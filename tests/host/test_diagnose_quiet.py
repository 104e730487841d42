"""What the data leave open of silent forces decides nothing: neither their memory nor what they might imitate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.quiet import audible, quieted
from aeolid.diagnose.scoring import directions
from aeolid.diagnose.scoring.scores import score_bank


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    """Prepare the rig without any hidden effect: white force noise, so that no force with a memory is needed."""
    study = load_study("diagnosis")
    hidden = study.Hidden("null", "equations", noise=(1.0, 0.02, 0.01))
    return prepare(load_case(study.write_case(tmp_path_factory.mktemp("quiet") / "case", hidden, 1200, 5)))


def forgetting(prepared: Prepared, rate: float) -> Prepared:
    """Return the stage with its forces silent and forgetting at a rate between slowest (0) and fastest (1)."""
    model, point = prepared.predictor.compiled.model, prepared.fit.point
    theta, noise = point.theta.copy(), point.noise.copy()
    for i, p in enumerate(model.parameters):
        if p.name.startswith("unmeasured_rate_"):
            theta[i] = p.minimum * (p.maximum / p.minimum) ** rate
    forces = [i for i, s in enumerate(model.states) if s.name.startswith("unmeasured_")]
    noise[forces] = 1e-6
    x0 = tuple(np.where(np.isin(np.arange(len(x)), forces), 0.0, x) for x in point.x0)  # nor do they fade from a start
    free = replace(prepared.free, x0=tuple(i for i in prepared.free.x0 if i not in forces))
    return replace(prepared, free=free, fit=prepared.predictor.at(Point(theta, noise, point.K, x0), free))


def test_silent_forces_have_no_column_of_their_own(prepared: Prepared) -> None:
    stage = forgetting(prepared, 0.5)
    free, model = stage.fit.free, stage.predictor.compiled.model
    heard = audible(model, stage.fit)
    silenced = [
        *(model.parameters[i].name.startswith("unmeasured_rate_") for i in free.theta),
        *(i < len(model.states) and model.states[i].name.startswith("unmeasured_") for i in free.noise),
    ]
    assert any(silenced) and len(heard) == stage.fit.jacobian.shape[1]
    assert list(~heard[: len(silenced)]) == silenced and np.all(heard[len(silenced) :])
    loud = stage.fit.point.noise.copy()
    loud[[i for i in free.noise if i < len(model.states)]] = 1.0
    assert np.all(audible(model, replace(stage.fit, point=replace(stage.fit.point, noise=loud))))


def test_the_memory_of_a_silent_force_moves_no_score(prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 80 s to a sample: z above 0 to 0.02, as a millionth of its size still moves residuals by 4e-4 deviations.

    With its columns a stiffness that changes had 2.15 or 1.75. Left out are effects that are rugged: here free values
    absorb all but the share of a play's direction below which it says nothing, and rounding chooses the side.
    """
    wanted = [a for a in prepared.hypotheses if a.entry != "unlisted" and not a.rugged]

    def moved() -> float:
        banks = [score_bank(forgetting(prepared, rate), wanted, 1) for rate in (0.0, 1.0)]
        slow, fast = ({r.attachment.key: r.z for r in bank.rows} for bank in banks)
        return max(abs(slow[k] - fast[k]) for k in slow if max(slow[k], fast[k]) > 0)

    assert moved() < 0.02
    monkeypatch.setattr(directions, "audible", lambda model, fit: np.ones(fit.jacobian.shape[1], dtype=bool))
    assert moved() > 0.2


def test_a_silent_force_gets_its_declared_memory_back(prepared: Prepared) -> None:
    stage = forgetting(prepared, 0.9)
    quiet = quieted(stage.predictor, stage.fit.point, stage.free)
    for i, p in enumerate(stage.predictor.compiled.model.parameters):
        if p.name.startswith("unmeasured_rate_"):
            assert quiet.theta[i] == p.value != stage.fit.point.theta[i]
    assert stage.predictor.objective(quiet) < stage.predictor.objective(stage.fit.point) + 0.1
