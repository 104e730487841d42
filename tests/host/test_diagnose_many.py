"""Many cases become one table, and a second run does what is new."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from aeolid.cli.diagnose_many import diagnose_many, fingerprint, in_turn, names_of
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.fleet.cases import write_cases
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
    rows = diagnose_many(named, out, SETTINGS, in_turn(diagnose))
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
    again = diagnose_many(named, out, SETTINGS, in_turn(diagnose))
    assert diagnose.asked == ["lag", "broken", "still", "broken"] and again == rows
    (tmp_path / "park" / "still" / "recording.csv").write_text("other")
    diagnose_many(named, out, SETTINGS, in_turn(diagnose))
    assert diagnose.asked[4:] == ["broken", "still"]
    diagnose_many(named, out, SETTINGS | {"seed": 2}, in_turn(diagnose))
    assert diagnose.asked[6:] == ["lag", "broken", "still"]


@pytest.mark.parametrize("content", ["", "{", "[]", '{"verdict": 3}', '{"verdict": "named"}x'])
def test_an_answer_that_was_spoilt_is_made_again(tmp_path: Path, content: str) -> None:
    named, diagnose = cases_in(tmp_path / "park", "lag"), Diagnoses()
    (tmp_path / "out").mkdir()
    for _ in range(2):
        diagnose_many(named, tmp_path / "out", SETTINGS, in_turn(diagnose))
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


@pytest.mark.parametrize(
    ("named", "files"),
    [
        ('"set"', ("set/1.parquet", "set/b/2.parquet")),
        ('"data/run.sel"', ("data/run.sel", "data/run.dat")),
        ('"run.csv"', ("run.csv",)),
        ('"data/run.%04"', ("data/run.%04", "data/run.$04")),
    ],
)
def test_a_change_in_any_file_of_a_recording_is_seen(named: str, files: tuple[str, ...], tmp_path: Path) -> None:
    """Also below the case's folder; other files there, such as earlier answers, do not count."""
    case = tmp_path / "case"
    for name in (*files, "out/diagnosis.json"):
        (case / name).parent.mkdir(parents=True, exist_ok=True)
        (case / name).write_text("1")
    (case / "case.toml").write_text(f"[recordings]\nfiles = [{named}]\n")
    seen = {fingerprint(case, SETTINGS)}
    for name in files:
        (case / name).write_text("2")
        seen.add(fingerprint(case, SETTINGS))
    (case / "out/diagnosis.json").write_text("2")
    seen.add(fingerprint(case, SETTINGS))
    assert len(seen) == 1 + len(files)


def test_workers_give_the_table_in_the_order_of_the_cases(tmp_path: Path) -> None:
    """Whatever is ready first; a worker that was lost has its sentence, and is asked again by the next run."""
    named, out = cases_in(tmp_path / "park", "a", "b", "c"), tmp_path / "out"
    out.mkdir()
    asked: list[list[str]] = []

    def work(pieces: Any) -> Any:
        asked.append([name for name, _, _ in pieces])
        for index in reversed(range(len(pieces))):
            name, case, folder = pieces[index]
            lost = name == "b" and len(asked) == 1
            yield index, RuntimeError("its process ended") if lost else Diagnoses()(case, folder)

    rows = diagnose_many(named, out, SETTINGS, work)
    assert [r["case"] for r in rows] == ["a", "b", "c"] and rows[1]["fault"] == "RuntimeError: its process ended"
    assert [r["verdict"] for r in diagnose_many(named, out, SETTINGS, work)] == ["no_mismatch"] * 3
    assert asked == [["a", "b", "c"], ["b"]]


def faulty_cases(folder: Path) -> list[str]:
    """Make two cases whose recordings are not there, and a folder without a case."""
    cases = []
    for name in ("t1", "t2"):
        case = folder / name
        case.mkdir()
        (case / "case.toml").write_text(
            '[recordings]\nfiles = ["a.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "state_space"\nfile = "m.json"\n'
        )
        cases.append(str(case))
    (folder / "t3").mkdir()
    return [*cases, str(folder / "t3")]


def faults_of(out: Path) -> list[str]:
    rows = json.loads((out / "cases.json").read_text())["cases"]
    assert [r["case"] for r in rows] == ["t1", "t2", "t3"]
    return [r["fault"] for r in rows]


def test_two_processes_diagnose_faulty_cases(tmp_path: Path) -> None:
    """Recordings that contradict themselves end at once; a folder without a case is said so."""
    out = tmp_path / "out"
    assert main(["diagnose", *faulty_cases(tmp_path), "--out", str(out), "--workers", "2"]) == 3
    assert all("no such file" in fault for fault in faults_of(out))


def test_a_scheduler_diagnoses_as_processes_do(tmp_path: Path) -> None:
    """The same cases on the workers of a Dask scheduler: the same table."""
    distributed = pytest.importorskip("distributed")
    cases = faulty_cases(tmp_path)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", host="127.0.0.1",
        dashboard_address=None, silence_logs="CRITICAL",
    ) as local:  # fmt: skip
        there = ["--scheduler", local.scheduler_address, "--insecure-scheduler"]
        assert main(["diagnose", *cases, "--out", str(tmp_path / "there"), *there]) == 3
        assert not local.scheduler.tasks  # nothing is left behind
        assert sum(w.state.executed_count for w in local.workers.values()) == 3
    assert main(["diagnose", *cases, "--out", str(tmp_path / "here")]) == 3
    assert faults_of(tmp_path / "there") == faults_of(tmp_path / "here")


def test_options_of_workers_are_those_of_the_fleet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases_in(tmp_path, "t1", "t2")
    asked = ["diagnose", str(tmp_path / "t1"), str(tmp_path / "t2"), "--out", str(tmp_path / "out")]
    for more, told in ((["--workers", "0"], "--workers is 1 to"), (["--tls-ca", "x"], "go with --scheduler"),
                       (["--scheduler", "tcp://127.0.0.1:1"], "--insecure-scheduler")):  # fmt: skip
        assert main([*asked, *more]) == 2
        assert told in capsys.readouterr().err


def test_each_turbine_becomes_a_case_of_the_template(tmp_path: Path) -> None:
    (template := tmp_path / "template").mkdir()
    (template / "case.toml").write_text(
        '[case]\ntitle = "x"\n[recordings]\nfiles = ["own.csv"]\nroles = "r.toml"\n[baseline]\nkind = "state_space"\n'
        'file = "model.json"\n[context]\nblades = 3\n'
    )
    members = {"a/b": [tmp_path / "1.csv", tmp_path / "2.csv"], "a_b": [tmp_path / '3 "x".csv']}
    cases = write_cases(template, tmp_path / "roles.toml", members, tmp_path / "cases")
    assert list(cases) == ["a_b", "a_b_"]
    data = [tomllib.loads((folder / "case.toml").read_text()) for folder in cases.values()]
    assert data[0]["recordings"] == {"files": [str(tmp_path / "1.csv"), str(tmp_path / "2.csv")],
                                     "roles": str(tmp_path / "roles.toml")}  # fmt: skip
    assert data[0]["case"]["title"] == "turbine a/b" and data[1]["recordings"]["files"] == [str(tmp_path / '3 "x".csv')]
    assert data[1]["baseline"]["file"] == str(template / "model.json") and data[1]["context"] == {"blades": 3}
    (template / "case.toml").write_text("[case]\n")
    with pytest.raises(DataError, match=r"no \[baseline\] that turbines could be compared with"):
        write_cases(template, tmp_path / "roles.toml", members, tmp_path / "cases")
