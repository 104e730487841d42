"""The next experiment: evidence that both rivals promise, the menu it is chosen from, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.experiments import experiment
from aeolid.diagnose.experiments.experiment import Advice, Experiment, advise, describe
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.record import Channel

DRIVE = (Channel("drive", "V", "input"),)


@pytest.fixture(scope="module")
def rivals(tmp_path_factory: pytest.TempPathFactory) -> tuple[Prepared, dict[str, Candidate]]:
    """A drive with a lag of 0.06 s: the lag, a dead time and, for what cannot be told apart, an offset of the clock."""
    study, ids = load_study("diagnosis"), ("actuator_lag", "transport_delay", "data_time_offset")
    hidden = study.Hidden("lag", "equations", {"lag": 0.06})
    prepared = prepare(load_case(study.write_case(tmp_path_factory.mktemp("case"), hidden, 1200, 5)))
    bank = score_bank(prepared, [a for a in prepared.hypotheses if a.entry in ids], 1)
    return prepared, {c.attachments[0].entry: c for c in fit_rows(prepared, bank.rows)}


def test_a_lag_and_a_dead_time_are_told_apart_soon(rivals: tuple[Prepared, dict[str, Candidate]]) -> None:
    prepared, found = rivals
    advice = advise(prepared, DRIVE, (found["actuator_lag"], found["transport_delay"]), 1)
    assert advice is not None and advice.experiment.channel == "drive" and advice.experiment.unit == "V"
    assert advice.minutes == pytest.approx(np.ceil(6.0 / advice.nats_a_minute)) and advice.minutes < 60
    assert advise(prepared, DRIVE, (found["actuator_lag"], found["transport_delay"]), 1) == advice
    swapped = advise(prepared, DRIVE, (found["transport_delay"], found["actuator_lag"]), 1)
    assert swapped == advice  # the smaller of both promises: order says nothing


def test_one_model_by_two_names_is_told_apart_by_no_experiment(
    rivals: tuple[Prepared, dict[str, Candidate]],
) -> None:
    """A dead time of the only input is an offset of its clock."""
    prepared, found = rivals
    assert advise(prepared, DRIVE, (found["transport_delay"], found["data_time_offset"]), 1) is None
    assert advise(prepared, (), (found["actuator_lag"], found["transport_delay"]), 1) is None  # nothing can be moved


def test_louder_steps_promise_more(rivals: tuple[Prepared, dict[str, Candidate]]) -> None:
    prepared, found = rivals
    stretch, pair = experiment.stretch_of(prepared), (found["actuator_lag"], found["transport_delay"])
    one = Experiment("drive", "V", 1.0, "steps", 0.08)
    rates = [experiment._evidence(pair, stretch, prepared, replace(one, amplitude=a), 1, 0) for a in (1.0, 3.0, 9.0)]
    assert rates[0] < rates[1] < rates[2]


def test_the_signals_are_what_they_say() -> None:
    steps = Experiment("drive", "V", 0.5, "steps", 0.2).signal(400, 0.05, 3)
    assert set(np.abs(steps)) == {0.5} and np.all(np.diff(steps.reshape(-1, 4), axis=1) == 0)
    assert abs(steps.mean()) < 0.1
    ladder = Experiment("drive", "V", 0.5, "ladder", 0.2).signal(64, 0.05, 3)
    assert set(ladder) == {-1.0, -0.5, 0.0, 0.5, 1.0} and np.max(np.abs(np.diff(ladder))) == 0.5


def test_what_is_said_names_channel_size_dwell_and_time() -> None:
    advice = Advice(Experiment("pitch", "deg", 0.8, "steps", 0.4), 0.5)
    entry: dict[str, Any] = describe(advice, ("a", "b"), "look there")
    assert entry["minutes"] == 12.0 and entry["separates"] == ["a", "b"]
    assert all(part in entry["text"] for part in ("pitch", "±0.8 deg", "0.4 s", "12 min", "look there"))
    none: dict[str, Any] = describe(None, ("a", "b"), "look there")
    assert none["minutes"] == 0 and "another sensor" in none["text"]
