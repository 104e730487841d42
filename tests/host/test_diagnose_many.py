"""Many cases become one table, and a second run does what is new."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from aeolid.cli.diagnose_many import diagnose_many, fingerprint, names_of
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.output import make_folder, write_json

SETTINGS = {"sham": 2, "seed": 1}


def cases_in(folder: Path, *names: str) -> dict[str, Path]:
    for name in names:
        (folder / name).mkdir(parents=True)
        (folder / name / "case.toml").write_text(f'[case]\ntitle = "{name}"\n')
    return names_of([folder / n for n in names])


class Diagnoses:
    """Stand for the diagnosis: counts the cases it is asked for."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def __call__(self, case: Path, out: Path) -> dict[str, Any]:
        self.asked.append(case.name)
        if case.name == "broken":
            raise DataError("a.csv: sample 3 is 'off'")
        make_folder(out)
        effect = {
            "id": "actuator_lag", "location": {"entry": "input:pitch"},
            "parameters": {"tau": {"value": 0.31, "std": 0.02, "unit": "s"}},
        }  # fmt: skip
        lag = case.name == "lag"
        found = {
            "verdict": "named" if lag else "no_mismatch", "statement": "=pitch, late" if lag else "nothing",
            "effects": [effect] if lag else [], "sealed": {"log_likelihood_gain": 12.5, "interval": [7.0, 18.0]},
        }  # fmt: skip
        write_json(out / "diagnosis.json", found)
        return found


def test_one_table_of_all_and_only_what_is_new(tmp_path: Path) -> None:
    named, out, diagnose = cases_in(tmp_path / "park", "lag", "broken", "still"), tmp_path / "out", Diagnoses()
    out.mkdir()
    rows = diagnose_many(named, out, SETTINGS, diagnose)
    assert [r["verdict"] for r in rows] == ["named", "not read", "no_mismatch"]
    with open(out / "cases.csv", newline="") as handle:
        table = list(csv.DictReader(handle))
    assert table[0] | {"statement": ""} == {
        "case": "lag", "verdict": "named", "effect": "actuator_lag", "where": "input:pitch", "value": "0.31",
        "std": "0.02", "unit": "s", "gain": "12.5", "low": "7", "statement": "",
    }  # fmt: skip
    assert table[0]["statement"] == "'=pitch, late"  # no formula to a spreadsheet
    assert table[1]["statement"] == "a.csv: sample 3 is 'off'" and table[2]["effect"] == ""
    assert json.loads((out / "cases.json").read_text())["cases"] == rows
    again = diagnose_many(named, out, SETTINGS, diagnose)
    assert diagnose.asked == ["lag", "broken", "still", "broken"] and again == rows
    (tmp_path / "park" / "still" / "recording.csv").write_text("other")
    diagnose_many(named, out, SETTINGS, diagnose)
    assert diagnose.asked[4:] == ["broken", "still"]
    diagnose_many(named, out, SETTINGS | {"seed": 2}, diagnose)
    assert diagnose.asked[6:] == ["lag", "broken", "still"]


@pytest.mark.parametrize("content", ["", "{", "[]", '{"verdict": 3}', '{"verdict": "named"}x'])
def test_an_answer_that_was_spoilt_is_made_again(tmp_path: Path, content: str) -> None:
    named, diagnose = cases_in(tmp_path / "park", "lag"), Diagnoses()
    (tmp_path / "out").mkdir()
    for _ in range(2):
        diagnose_many(named, tmp_path / "out", SETTINGS, diagnose)
        (tmp_path / "out" / "lag" / "diagnosis.json").write_text(content)
    assert diagnose.asked == ["lag", "lag"]


def test_two_cases_of_one_name_and_folders_without_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases_in(tmp_path / "a", "t1")
    cases_in(tmp_path / "b", "t1")
    with pytest.raises(UsageError, match="another case is called 't1' too"):
        names_of([tmp_path / "a" / "t1", tmp_path / "b" / "t1"])
    (tmp_path / "x").mkdir()
    (tmp_path / "y").mkdir()
    assert main(["diagnose", str(tmp_path / "x"), str(tmp_path / "y"), "--out", str(tmp_path / "out")]) == 3
    assert "none of 2 cases could be read" in capsys.readouterr().err
    assert len((tmp_path / "out" / "cases.csv").read_text().splitlines()) == 3


def test_what_is_hidden_in_a_folder_does_not_count(tmp_path: Path) -> None:
    (case,) = cases_in(tmp_path, "t1").values()
    before = fingerprint(case, SETTINGS)
    (case / ".aeolid").write_text("ledger")
    assert fingerprint(case, SETTINGS) == before
