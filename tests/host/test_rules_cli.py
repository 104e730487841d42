"""Decision rules from a file: a diagnosis and a challenge go by them, in this process and in others, and say so."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.challenge.run import Job, Rules, run
from aeolid.challenge.write import make
from aeolid.cli.diagnose_many import settings_of
from aeolid.cli.diagnose_piece import Asked, diagnose_piece
from aeolid.cli.main import main
from aeolid.diagnose.rules import DecisionRules, in_force
from aeolid.fleet.workers import Inline, open_pool

LOST = 0.3  # share of the samples that read a code for a missing value: left out by default, a fault under STRICT
STRICT = {"data": {"missing_share": 0.2}}
FILE = "[data]\nmissing_share = 0.2\n"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """Write a case whose position is lost now and then."""
    rng = np.random.default_rng(5)
    rows: NDArray[np.float64] = rng.standard_normal((400, 3))
    rows[rng.random(400) < LOST, 1] = -9999.0
    folder = tmp_path / "swing"
    folder.mkdir()
    write_case(folder, SWING, 0.05, SWING_CHANNELS, rows)
    return folder


def asked(rules: dict[str, dict[str, float]]) -> Asked:
    return Asked(0, 1, 60.0, False, False, None, False, rules)


def read(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def test_a_diagnosis_goes_by_the_rules_of_a_file_and_says_so(case: Path, tmp_path: Path) -> None:
    (tmp_path / "strict.toml").write_text(FILE)
    out = tmp_path / "out"
    assert (
        main(["diagnose", str(case), "--out", str(out), "--rules", str(tmp_path / "strict.toml"), "--no-report"]) == 0
    )
    found = read(out / "diagnosis.json")
    assert found["verdict"] == "data_fault" and "-9999" in found["statement"] and found["rules"] == STRICT
    assert in_force() == DecisionRules()


def test_nothing_is_said_of_rules_where_none_differs(case: Path, tmp_path: Path) -> None:
    lines = (case / "recording.csv").read_text().splitlines()
    fixed = [lines[0], *(",".join([*line.split(",")[:2], "0.25", line.split(",")[3]]) for line in lines[1:])]
    (case / "recording.csv").write_text("\n".join(fixed) + "\n")  # an output that never moves is a fault in any case
    (tmp_path / "same.toml").write_text("[data]\nmissing_share = 0.5\n")
    for options in ([], ["--rules", str(tmp_path / "same.toml")]):
        out = tmp_path / f"out{len(options)}"
        assert main(["diagnose", str(case), "--out", str(out), "--no-report", *options]) == 0
    first, second = (tmp_path / f"out{n}" / "diagnosis.json" for n in (0, 2))
    assert read(first)["verdict"] == "data_fault" and "rules" not in read(first)
    assert first.read_bytes() == second.read_bytes()


def test_a_file_of_rules_that_is_none_is_refused(
    case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wrong.toml").write_text("[data]\nmissing_share = 2.0\n")
    out = tmp_path / "out"
    assert main(["diagnose", str(case), "--out", str(out), "--rules", str(tmp_path / "wrong.toml")]) == 3
    assert "missing_share" in capsys.readouterr().err and not out.exists()


def test_workers_go_by_the_rules_that_were_asked_for(case: Path, tmp_path: Path) -> None:
    pieces = [("first", str(case)), ("second", str(case))]
    inside = [f"{name}/{file}" for name, _ in pieces for file in ("diagnosis.json", "evidence.json")]
    with open_pool(2) as pool:
        for _, found in pool.run(diagnose_piece, pieces, asked(STRICT), str(tmp_path / "out"), inside, True):
            assert found["verdict"] == "data_fault" and found["rules"] == STRICT


def test_other_rules_are_other_settings_of_a_stored_diagnosis() -> None:
    assert "rules" not in settings_of(asked({}))
    assert settings_of(asked(STRICT)) == settings_of(asked({})) | {"rules": STRICT}


def test_a_stored_result_of_a_challenge_is_that_of_its_rules() -> None:
    plain = Job("case", "out", 0, 1, 60.0, False)
    assert "rules" not in plain.settings()
    assert Job("case", "out", 0, 1, 60.0, False, Rules("same.toml")).settings() == plain.settings()
    strict = Job("case", "out", 0, 1, 60.0, False, Rules("strict.toml", STRICT))
    assert strict.settings() == plain.settings() | {"rules": STRICT}


@pytest.mark.slow
def test_each_diagnosis_of_a_challenge_reads_the_file_of_rules(tmp_path: Path) -> None:
    """One that cannot be read is refused by the process that diagnoses: it has been given the file."""
    make(tmp_path / "cases", cases=1, seed=3, samples=1000, chained=False)
    missing = tmp_path / "missing.toml"
    (result,) = run(tmp_path / "cases", tmp_path / "results", Inline(), rules=Rules(str(missing), STRICT))
    assert result["outcome"] == "refused" and str(missing) in result["reason"]
    assert result["settings"]["rules"] == STRICT


def test_a_challenge_refuses_rules_before_it_begins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make(tmp_path / "cases", cases=1, seed=3, samples=1000, chained=False)
    (tmp_path / "wrong.toml").write_text("[data]\nmissing = 2.0\n")
    assert main(["challenge", "run", str(tmp_path / "cases"), "--rules", str(tmp_path / "wrong.toml")]) == 3
    assert "missing" in capsys.readouterr().err and not (tmp_path / "cases" / "results" / "case-0001").exists()
    assert main(["challenge", "score", str(tmp_path / "cases"), "--rules", str(tmp_path / "wrong.toml")]) == 2
