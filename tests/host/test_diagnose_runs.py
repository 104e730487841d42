"""A simulator's own run, under another wind, as the baseline: OpenFAST pairs with their truth."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from study_modules import load_study

from aeolid.cli.main import main

KNOWN = Path(__file__).resolve().parents[3] / "shared" / "cases" / "known"
PAIRS = ("openfast_null", "openfast_lag", "openfast_tower")  # nothing, a pitch drive that lags, a rigid tower
pytestmark = [
    pytest.mark.skipif(not KNOWN.is_dir(), reason="no ../shared/cases"),
    pytest.mark.diagnosis,
    pytest.mark.nightly,  # minutes each; a run as the baseline is asked in seconds by test_diagnose_pairs.py
]
study = load_study("known")


@pytest.mark.parametrize("name", PAIRS)
def test_what_the_simulator_lacks_is_named_and_nothing_else(name: str, tmp_path: Path) -> None:
    """Verdict, names, place, and values within the tolerance that comes with the case."""
    assert main(["diagnose", str(KNOWN / name), "--out", str(tmp_path), "--sham", "0", "--no-report"]) == 0
    said = json.loads((tmp_path / "diagnosis.json").read_text())
    truth = json.loads((KNOWN / name / "truth.json").read_text())
    row = study.judge(truth, said)
    assert study.is_right(row), row
    assert said["verdict"] == "multiple" or row["ids"] == truth["ids"], row
    assert not truth["ids"] or said["sealed"]["interval"][0] > 0
