"""Cases made, diagnosed blind and scored, four by day and sixty by night: claims that a stranger can repeat hold."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binom

from aeolid.challenge.run import RESULT
from aeolid.challenge.score import score
from aeolid.cli.main import main

CASES, SAMPLES, SEED = 4, 1000, 12
MANY = 60  # what the claims are counted with; the few go the same way from end to end
LEAST_RECALL = 0.4  # recordings of 6000 samples show about twice as much (README)
FALSE = 0.1  # per null recording; the aim is 0.02, which 17 recordings cannot tell from this
pytestmark = pytest.mark.diagnosis


@pytest.fixture(scope="module", params=[CASES, pytest.param(MANY, marks=pytest.mark.nightly)])
def facts(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Make, run and score the challenge as the command line does."""
    folder, cases = tmp_path_factory.mktemp("proof") / "challenge", request.param
    made = [
        "make",
        str(folder),
        "--chain",
        "none",
        "--cases",
        str(cases),
        "--seed",
        str(SEED),
        "--samples",
        str(SAMPLES),
    ]
    assert main(["challenge", *made]) == 0
    assert main(["challenge", "run", str(folder), "--workers", "2"]) == 0
    assert main(["challenge", "score", str(folder), "--fail-below", "0.1"]) == 0
    assert (folder / "results" / "score.html").stat().st_size > 20_000
    assert len(list((folder / "results").glob(f"case-*/{RESULT}"))) == cases
    return score(Path(folder), folder / "results")


def row(facts: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(r for r in facts["table"] if r["metric"].startswith(name))
    return found


def test_every_case_ends_in_a_verdict(facts: dict[str, Any]) -> None:
    assert [c for c in facts["cases"] if c["outcome"] != "done"] == []


def test_most_effects_hide_from_the_fit_and_can_be_decided(facts: dict[str, Any]) -> None:
    measured = [c for c in facts["cases"] if c["vaf_points"] is not None and c["class"] not in ("impossible", "fault")]
    assert sum(c["vaf_points"] < 1 for c in measured) > 0.6 * len(measured)
    hidden = [c for c in facts["cases"] if c["class"] in ("single", "double", "fault")]
    assert sum(c["decidable"] for c in hidden) >= 0.7 * len(hidden)


def test_recall_lies_above_its_floor(facts: dict[str, Any]) -> None:
    """Of few cases, above what chance makes of the floor once in a thousand times, and not nothing."""
    recall = row(facts, "recall")
    few = len(facts["cases"]) < MANY
    least = max(1.0, binom.ppf(0.001, recall["of"], LEAST_RECALL)) if few else LEAST_RECALL * recall["of"]
    assert recall["count"] >= least


def test_nothing_is_named_where_nothing_is_hidden_more_often_than_chance_allows(facts: dict[str, Any]) -> None:
    false = row(facts, "false name")
    assert false["of"] >= 0.25 * len(facts["cases"])
    assert false["count"] <= binom.ppf(0.999, false["of"], FALSE)
