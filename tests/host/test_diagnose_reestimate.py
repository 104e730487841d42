"""What was chosen is estimated on all data but the sealed ones before these are opened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_cases import SAMPLES, SWING_STEP, swinging

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates import reestimate
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.candidates.reestimate import baseline_of_all, estimated_on_all
from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.scoring.scores import score_bank


def fitted(folder: Path) -> tuple[Prepared, Candidate]:
    """Return the stage, and a hardening spring fitted on the fit data."""
    stage = prepare(load_case(folder))
    bank = score_bank(stage, [a for a in stage.hypotheses if a.key == "cubic_stiffness state:v"], 1)
    (found,) = fit_rows(stage, bank.rows)
    return stage, found


def value(candidate: Candidate) -> tuple[float, float]:
    return candidate.values["cubic_stiffness state:v"]["k3"]


def test_more_data_sharpen_a_value_and_leave_the_race_as_it_was(tmp_path: Path) -> None:
    """Deviations shrink as 1/sqrt(N): fit and selection data are 1.3 times the fit data and more, gaps taken off.

    The one of half the data may differ from the other by what half the data do not know, 3 deviations of it.
    """
    stage, found = fitted(swinging(tmp_path, hard=60.0))
    last = estimated_on_all(stage, found)
    (before, wide), (after, narrow) = value(found), value(last)
    of_data = [np.sqrt(std**2 - (0.01 * v) ** 2) for v, std in (value(found), value(last))]  # less the form's share
    assert 0.7 < of_data[1] / of_data[0] < 0.93  # 0.85 for 0.7 of the recording, more or less by what moves it there
    assert abs(after - 60.0) < 3 * narrow and abs(after - before) < 3 * wide
    assert (last.fit_gain, last.select_gain, last.score) == (found.fit_gain, found.select_gain, found.score)
    assert last.fit_density is found.fit_density
    rows = sum(len(s.y) - s.burn for s in (*stage.split.fit, *stage.split.select))
    assert len(last.fit.per_sample) == rows


def test_sealed_data_have_no_say_in_any_value(tmp_path: Path) -> None:
    """Against the same recording with noise in place of what the sensors showed in its sealed part."""
    folder = swinging(tmp_path / "whole", hard=60.0)
    stage, found = fitted(folder)
    first = round(stage.split.sealed[0].start_s / SWING_STEP)
    rows = np.loadtxt(folder / "recording.csv", delimiter=",", skiprows=1)
    head = (folder / "recording.csv").read_text().splitlines()[0]
    rows[first:, 2:] = np.random.default_rng(0).standard_normal((SAMPLES - first, 2))
    spoilt = swinging(tmp_path / "spoilt", hard=60.0)
    np.savetxt(spoilt / "recording.csv", rows, delimiter=",", header=head, comments="", fmt="%.9g")
    other, same = fitted(spoilt)
    assert value(estimated_on_all(other, same)) == value(estimated_on_all(stage, found))
    theta = [baseline_of_all(s).fit.point.theta for s in (stage, other)]
    assert np.array_equal(*theta)


def test_what_cannot_be_fitted_again_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage, found = fitted(swinging(tmp_path, hard=60.0))
    with monkeypatch.context() as patched:
        patched.setattr(reestimate, "objection", lambda *_: "ran to the end of its range")
        assert estimated_on_all(stage, found) is found
    monkeypatch.setattr(reestimate, "fit_quietly", lambda *_, **__: None)
    assert estimated_on_all(stage, found) is found
    bare = baseline_of_all(stage)
    assert bare.fit.point is stage.only(()).fit.point or np.array_equal(bare.fit.point.theta, stage.fit.point.theta)
    assert len(bare.predictor.segments) == len(stage.split.fit)


@pytest.mark.diagnosis
def test_the_verdict_tells_the_values_of_all_but_the_sealed_data(tmp_path: Path) -> None:
    """Values, proof and corrected model are of one estimate."""
    result = study(load_case(swinging(tmp_path, hard=60.0)), sham=0, seed=1, progress=lambda *_: None)
    found: dict[str, Any] = diagnose(result)
    assert found["verdict"] == "named" and found["effects"][0]["id"] == "cubic_stiffness"
    told = found["effects"][0]["parameters"]["k3"]
    assert result.winner is not None and (told["value"], told["std"]) == value(result.winner)
    assert len(result.winner.fit.point.x0) == len(result.prepared.split.fit) + len(result.prepared.split.select)
    assert any(c is result.winner for c in result.candidates)
