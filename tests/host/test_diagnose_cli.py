"""aeolid diagnose as a user calls it: the files it leaves, their schema, and one sentence for every bad case."""

from __future__ import annotations

import csv
import html
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.diagnose.hypotheses.catalogue import ENTRIES

STUDIES = Path(__file__).resolve().parents[1] / "studies"
sys.path.insert(0, str(STUDIES))
import diagnosis as rig  # noqa: E402

VERDICTS = {
    "no_mismatch", "immaterial", "data_fault", "parameter", "named", "ambiguous", "multiple", "unnamed", "not_testable",
}  # fmt: skip
SAMPLES = 1500
pytestmark = pytest.mark.diagnosis


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a case with a concealed lag: 30 s of the rig."""
    hidden = rig.Hidden("lag", "equations", {"lag": 0.08}, noise=(0.5, 0.02, 0.01))
    return rig.write_case(tmp_path_factory.mktemp("case") / "case", hidden, SAMPLES, 21)


def diagnose(case: Path, out: Path, *options: str) -> int:
    return main(["diagnose", str(case), "--out", str(out), "--sham", "0", *options])


@pytest.fixture(scope="module")
def result(case: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    assert main(["diagnose", str(case), "--out", str(out), "--sham", "1", "--json", str(out / "copy.json")]) == 0
    return out


def facts(out: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return loaded


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def test_a_limit_that_is_not_reached_leaves_no_word(result: Path) -> None:
    found = facts(result)
    assert found["time_limit"] == {"limit_s": 3600.0, "reached": False, "not_tried": []} and found["warnings"] == []
    assert found["model"] == {"file": "model/model.toml", "divergence": None}


def check_location(location: dict[str, Any]) -> None:
    assert set(location) >= {"entry", "outputs", "inputs", "frequency_hz", "azimuth_order", "region", "time_s"}
    assert isinstance(location["entry"], str)
    assert all(isinstance(n, str) for n in location["outputs"] + location["inputs"])
    band = location["frequency_hz"]
    assert band is None or (len(band) == 2 and 0 <= band[0] <= band[1])


def check_schema(d: dict[str, Any]) -> None:
    """Compare with the interface: all keys, types, vocabulary."""
    wanted = {"schema", "verdict", "effects", "location", "sealed", "false_alarm", "not_excluded", "next_experiment"}
    assert wanted <= set(d) and d["schema"] == 1 and d["verdict"] in VERDICTS
    families = {e.id: e.family for e in ENTRIES}
    if d["verdict"] in ("no_mismatch", "immaterial", "not_testable"):
        assert d["effects"] == []
    if d["verdict"] in ("named", "parameter", "multiple", "ambiguous"):
        assert d["effects"]
    for effect in d["effects"]:
        assert set(effect) >= {"id", "family", "statement", "location", "equation", "parameters", "rivals", "weight"}
        assert families[effect["id"]] == effect["family"]
        assert effect["statement"] and "\n" not in effect["statement"] and effect["equation"]
        check_location(effect["location"])
        for value in effect["parameters"].values():
            assert set(value) == {"value", "std", "unit"} and is_number(value["value"])
            assert value["std"] is None or (is_number(value["std"]) and value["std"] >= 0)
            assert isinstance(value["unit"], str)
        for rival in effect["rivals"]:
            assert rival["id"] in families and rival["entry"] and 0 <= rival["weight"] <= 1
        assert 0 <= effect["weight"] <= 1
    sealed = d["sealed"]
    assert isinstance(sealed["data"], str) and sealed["data"]
    assert is_number(sealed["log_likelihood_gain"]) and is_number(sealed["recovered_fraction"])
    low, high = sealed["interval"]
    assert low <= sealed["log_likelihood_gain"] <= high or low == high == 0
    assert set(sealed["nrmse_before"]) == set(sealed["nrmse_after"])
    assert all(is_number(v) and v >= 0 for part in ("nrmse_before", "nrmse_after") for v in sealed[part].values())
    alarm = d["false_alarm"]
    assert 0 <= alarm["false_names"] <= alarm["sham_runs"] and (
        alarm["threshold"] is None or is_number(alarm["threshold"])
    )
    for row in d["not_excluded"]:
        assert row["id"] in families
        least = row["minimum_detectable"]
        if least is not None:
            assert (least["value"] is None or is_number(least["value"])) and isinstance(least["unit"], str)
    experiment = d["next_experiment"]
    if experiment is not None:
        assert set(experiment) == {"text", "minutes", "separates"} and len(experiment["separates"]) != 1


def test_the_file_follows_the_schema_and_names_the_lag(result: Path) -> None:
    d = facts(result)
    check_schema(d)
    assert d == json.loads((result / "copy.json").read_text())
    assert d["verdict"] in ("named", "ambiguous") and d["effects"][0]["id"] == "actuator_lag"
    assert d["effects"][0]["parameters"]["tau_s"]["value"] == pytest.approx(0.08, rel=0.15)
    assert d["sealed"]["interval"][0] > 0 and d["false_alarm"]["sham_runs"] == 1
    assert d["effects"][0]["location"]["entry"] == "input:drive"


def test_everything_else_is_there(result: Path) -> None:
    page = (result / "report.html").read_text()
    assert "<html" in page and "first-order lag" in page
    assert "http://" not in page.replace("http://www.w3.org", "") or 'src="http' not in page
    with open(result / "sealed_before_after.csv", newline="") as handle:
        rows = list(csv.DictReader(handle))
    heads = [f"{n}_{k}" for n in ("position", "speed") for k in ("measured", "before", "after")]
    assert list(rows[0]) == ["time_s", *heads, "stretch"] and {r["stretch"] for r in rows} == {"1"}
    table = np.array([[float(v) for v in r.values()] for r in rows])
    assert np.all(np.diff(table[:, 0]) > 0) and table[0, 0] > 0.7 * SAMPLES * rig.STEP_S - 1e-9
    for n in (1, 4):
        before, after = (np.std(table[:, n] - table[:, n + k]) for k in (1, 2))
        assert after < before


def test_the_corrected_model_runs_and_fits_better(case: Path, result: Path, tmp_path: Path) -> None:
    errors = []
    for model in (case / "model.toml", result / "model"):
        out = tmp_path / "sim.csv"
        arguments = ["simulate", model, case / "recording.csv", "--roles", case / "roles.toml", "--out", out]
        assert main([str(a) for a in arguments]) == 0
        simulated = np.genfromtxt(out, delimiter=",", names=True)
        measured = np.genfromtxt(case / "recording.csv", delimiter=",", names=True)
        errors.append(np.std(simulated["speed"] - measured["speed"]))
    assert errors[1] < 0.6 * errors[0]


@pytest.fixture(scope="module")
def corrected(case: Path, result: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a case whose baseline is the corrected model: little is left to fit."""
    second = tmp_path_factory.mktemp("corrected") / "case"
    shutil.copytree(case, second)
    shutil.copy(result / "model" / "model.toml", second / "model.toml")
    return second


@pytest.fixture(scope="module")
def nothing_left(corrected: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("nothing_left") / "out"
    assert diagnose(corrected, out, "--fail-on-mismatch") in (0, 1)
    return out


def test_the_corrected_model_needs_no_further_name(nothing_left: Path) -> None:
    """Nor anything beside it: what is said then is the experiment that would look closer."""
    d = facts(nothing_left)
    check_schema(d)
    assert d["verdict"] in ("no_mismatch", "immaterial", "parameter")
    assert not [e["id"] for e in d["effects"] if e["id"] != "parameter_error"]
    if d["verdict"] != "parameter":
        assert d["next_experiment"]["text"].startswith("To look closer")


@pytest.fixture(scope="module")
def again(corrected: Path, nothing_left: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Diagnose into a copy of the results without a report, in a process of its own; returns folder and output."""
    out = tmp_path_factory.mktemp("again") / "out"
    shutil.copytree(nothing_left, out)
    (out / "diagnosis.json").unlink()  # to be written anew
    command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(corrected), "--out", str(out), "--sham", "0"]
    done = subprocess.run([*command, "--no-report"], capture_output=True, text=True, timeout=3600)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


def test_the_experiment_is_printed_too(again: tuple[Path, str]) -> None:
    d = facts(again[0])
    assert d["verdict"] == "parameter" or "  record next: To look closer" in again[1]


def test_the_same_input_gives_the_same_file(again: tuple[Path, str], nothing_left: Path) -> None:
    """In a process of its own, so that nothing cached can hide a difference."""
    assert (again[0] / "diagnosis.json").read_bytes() == (nothing_left / "diagnosis.json").read_bytes()


@pytest.mark.nightly  # a diagnosis with fits and a null simulation; by day test_api_example.py compares one in process
def test_a_named_effect_is_the_same_file_in_another_process(case: Path, result: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", str(tmp_path), "--sham", "1"]
    subprocess.run([*command, "--no-report"], check=True, timeout=3600)
    assert (tmp_path / "diagnosis.json").read_bytes() == (result / "diagnosis.json").read_bytes()


def spoilt(case: Path, folder: Path, *, holes: bool, stuck: bool) -> Path:
    """Copy the case: without one cell in twenty of each output, 50 rows and 3 inputs; its speed stuck for 600 rows."""
    copy = folder / "case"
    shutil.copytree(case, copy)
    table = read_rows(copy)
    rng = np.random.default_rng(2)
    for i in range(1, len(table) if holes else 0):
        for column in (2, 3):
            if rng.random() < 0.05 or 1000 <= i < 1050:
                table[i][column] = ""
    for i in (200, 201, 1200) if holes else ():
        table[i][1] = ""
    for i in range(300, 900 if stuck else 0):
        table[i][3] = "0.1"
    write_rows(copy, table)
    return copy


def check_spoilt(case: Path, folder: Path, shown: Callable[[], str], *, holes: bool, stuck: bool) -> None:
    copy = spoilt(case, folder, holes=holes, stuck=stuck)
    assert diagnose(copy, folder / "out", "--fail-on-mismatch", "--no-report") == 1
    d = facts(folder / "out")
    check_schema(d)
    assert d["verdict"] == "named" and [e["id"] for e in d["effects"]] == ["actuator_lag"]
    notes, said = d["data_notes"], shown()
    assert all(f"data: {note['channel']}: {note['finding']}" in said for note in notes)
    assert stuck == any("speed" in note["channel"] and "600" in note["finding"] for note in notes), notes


@pytest.mark.parametrize("holes", [pytest.param(True, marks=pytest.mark.nightly), False])
def test_missing_samples_or_a_stuck_sensor_are_survived(
    case: Path, tmp_path: Path, holes: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a stuck sensor did not measure is left out and said; the name stays."""
    check_spoilt(case, tmp_path, lambda: capsys.readouterr().out, holes=holes, stuck=not holes)


def read_rows(case: Path) -> list[list[str]]:
    return [line.split(",") for line in (case / "recording.csv").read_text().splitlines()]


def write_rows(case: Path, rows: list[list[str]]) -> None:
    (case / "recording.csv").write_text("\n".join(",".join(r) for r in rows) + "\n")


def edit(file: str, old: str, new: str) -> Callable[[Path], None]:
    def change(case: Path) -> None:
        text = (case / file).read_text()
        assert old in text
        (case / file).write_text(text.replace(old, new, 1))

    return change


def rows(change: Callable[[list[list[str]]], list[list[str]]]) -> Callable[[Path], None]:
    return lambda case: write_rows(case, change(read_rows(case)))


def gone(file: str) -> Callable[[Path], None]:
    return lambda case: (case / file).unlink()


def column(index: int, cell: str, first: int = 1, last: int = SAMPLES + 1) -> Callable[[Path], None]:
    def change(table: list[list[str]]) -> list[list[str]]:
        for r in table[first:last]:
            r[index] = cell
        return table

    return rows(change)


BAD: dict[str, tuple[Callable[[Path], None], int, list[str]]] = {
    "no case file": (gone("case.toml"), 3, ["case.toml", "no such file"]),
    "no recording": (gone("recording.csv"), 3, ["recording.csv"]),
    "no roles": (gone("roles.toml"), 3, ["roles.toml"]),
    "no model": (gone("model.toml"), 3, ["model.toml"]),
    "case no toml": (edit("case.toml", "[case]", "[case"), 3, ["case.toml", "TOML"]),
    "unknown table": (edit("case.toml", "[context]", "[contex]"), 3, ["case.toml", "'contex'"]),
    "unknown key": (edit("case.toml", "files =", 'extra = 1\nfiles ='), 3, ["case.toml", "'extra'"]),
    "unknown key of the baseline": (edit("case.toml", "kind =", 'kinds = 1\nkind ='), 3, ["[baseline]", "'kinds'"]),
    "files a text": (edit("case.toml", '["recording.csv"]', '"recording.csv"'), 3, ["[recordings]", "files"]),
    "no files": (edit("case.toml", '["recording.csv"]', "[]"), 3, ["[recordings]", "files"]),
    "no roles key": (edit("case.toml", 'roles = "roles.toml"\n', ""), 3, ["[recordings]", "roles"]),
    "recordings no table": (edit("case.toml", "[recordings]\n", "recordings = 1\n[case.x]\n"), 3, ["case.toml"]),
    "file and files": (edit("case.toml", 'file = "model.toml"', 'file = "model.toml"\nfiles = ["a"]'), 3, ["files ="]),
    "several models": (edit("case.toml", 'file = "model.toml"', 'files = ["a", "b"]'), 3, ['kind = "run"']),
    "runs with the recorded inputs": (
        edit("case.toml", 'kind = "equations"\nfile = "model.toml"',
             'kind = "run"\nsame_inputs = true\nfiles = ["a", "b"]'), 3, ["give one file"],
    ),
    "no names of files": (edit("case.toml", 'file = "model.toml"', "files = [1]"), 3, ["texts"]),
    "no baseline": (edit("case.toml", '[baseline]\nkind = "equations"\nfile = "model.toml"\n', ""), 3, ["[baseline]"]),
    "no kind": (edit("case.toml", 'kind = "equations"\n', ""), 3, ["kind"]),
    "unknown kind": (edit("case.toml", '"equations"', '"guess"'), 3, ["'guess'"]),
    "a model as a run": (edit("case.toml", '"equations"', '"run"'), 3, ["model.toml"]),
    "a model as a unit": (edit("case.toml", '"equations"', '"fmu"'), 3, ["model.toml", "mock-up unit"]),
    "same_inputs a text": (edit("case.toml", "kind =", 'same_inputs = "yes"\nkind ='), 3, ["same_inputs"]),
    "equations as state space": (edit("case.toml", '"equations"', '"state_space"'), 3, ["model.toml"]),
    "title a number": (edit("case.toml", 'title = "rig"', "title = [1]"), 3, ["title"]),
    "output nobody recorded": (edit("model.toml", 'name = "position"', 'name = "height"'), 3, ["'height'"]),
    "input nobody recorded": (edit("model.toml", "g*drive", "g*force"), 3, ["'force'", "recording"]),
    "output with another role": (edit("roles.toml", '"m"\nrole = "output"', '"m"\nrole = "disturbance"'), 3,
                                 ["position", "'disturbance'"]),
    "missing column": (edit("roles.toml", 'name = "speed"', 'name = "pace"'), 3, ["pace"]),
    "two rates": (edit("case.toml", '["recording.csv"]', '["recording.csv", "other.csv"]'), 3, ["other.csv"]),
    "output never measured": (column(2, ""), 3, ["position", "no value"]),
    "input never measured": (column(1, ""), 3, ["drive", "no value"]),
    "no samples": (rows(lambda t: t[:1]), 3, ["recording.csv"]),
    "infinite": (column(2, "inf", 50, 51), 3, ["position", "sample 50"]),
    "text": (column(2, "high", 50, 51), 3, ["position", "sample 50"]),
}  # fmt: skip


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_case_is_one_sentence(case: Path, tmp_path: Path, bad: str, capsys: pytest.CaptureFixture[str]) -> None:
    spoil, code, words = BAD[bad]
    copy = tmp_path / "case"
    shutil.copytree(case, copy)
    (copy / "other.csv").write_text(
        "time_s,drive,position,speed\n" + "".join(f"{i},0,{i % 7},{i % 5}\n" for i in range(500))
    )
    spoil(copy)
    found = diagnose(copy, tmp_path / "out")
    captured = capsys.readouterr()
    assert found == code, captured.err
    message = captured.err.strip()
    assert "Traceback" not in message and message.count("\n") == 0 and message.startswith("aeolid: "), message
    for word in words:
        assert word in message, message
    assert not (tmp_path / "out" / "diagnosis.json").exists()


ENDED: dict[str, tuple[Callable[[Path], None], str, list[str]]] = {
    "output in another unit": (edit("model.toml", 'equation = "q"\nunit = "m"', 'equation = "q"\nunit = "mm"'),
                               "data_fault", ["position", "'mm'", "'m'"]),
    "constant output": (column(2, "0.25"), "data_fault", ["position", "never changes"]),
    "30 samples": (rows(lambda t: t[:31]), "not_testable", ["30 samples"]),
    "sealed part too short": (rows(lambda t: t[:100]), "not_testable", ["99 samples", "are needed"]),
    "diverging model": (edit("model.toml", "- c*v", "+ 1e6*M*v + 0*c"), "not_testable", ["diverges"]),
}  # fmt: skip


@pytest.mark.parametrize("ending", ENDED)
def test_what_cannot_be_tested_ends_in_a_verdict(case: Path, tmp_path: Path, ending: str) -> None:
    """Readable files end in a diagnosis that says why; the page shows it."""
    spoil, verdict, words = ENDED[ending]
    copy = tmp_path / "case"
    shutil.copytree(case, copy)
    spoil(copy)
    assert diagnose(copy, tmp_path / "out") == 0
    d = facts(tmp_path / "out")
    check_schema(d)
    assert d["verdict"] == verdict and d["effects"] == []
    page = (tmp_path / "out" / "report.html").read_text()
    for word in words:
        assert word in d["statement"] and html.escape(word) in page, d["statement"]


def test_without_a_report_the_rest_is_the_same_and_none_is_left(again: tuple[Path, str], nothing_left: Path) -> None:
    out, said = again
    assert (nothing_left / "report.html").exists() and not (out / "report.html").exists() and "report" not in said
    assert (out / "diagnosis.json").read_bytes() == (nothing_left / "diagnosis.json").read_bytes()


def test_wrong_options_are_usage_errors(case: Path, tmp_path: Path) -> None:
    assert main(["diagnose", str(case)]) == 2
    assert main(["diagnose", str(case), "--out", str(tmp_path), "--sham", "-1"]) == 2


def test_the_catalogue_lists_every_entry(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["catalogue", "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [e["id"] for e in listed] == [e.id for e in ENTRIES]
    for e in listed:
        assert {"id", "family", "equation", "parameters"} <= set(e) and e["equation"] and e["source"]
        for p in e["parameters"]:
            assert {"symbol", "unit", "low", "high", "null"} <= set(p) and p["low"] < p["high"]
    assert main(["catalogue"]) == 0
    shown = capsys.readouterr().out
    assert all(e.id in shown and e.family in shown for e in ENTRIES)
