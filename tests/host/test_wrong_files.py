"""A file in the place of another, a mistyped name in equations, a mass of zero, and what `check` remarks."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from aeolid.begin.understood import doubts
from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.record import Channel, Record, Roles
from aeolid.units import alike, conversion, known_units

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("example")
    assert main(["example", str(folder)]) == 0
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert main(command.split()) in (2, 3)
    return capsys.readouterr().err.strip().splitlines()[-1]


ROLES = "--roles roles.toml"
WRONG = {
    "check stage/case.toml": "a case file, where the folder of a case is needed; give its folder: stage",
    "check stage/model.toml": "stage/model.toml: a model file (equations), where the folder of a case is needed;",
    "check my_case/model.json": "my_case/model.json: a model file, where the folder of a case is needed;",
    "check stage/roles.toml": "stage/roles.toml: a roles file, where the folder of a case is needed;",
    "check monday.csv": "monday.csv: a recording, where the folder of a case is needed; a case is a folder with",
    "identify monday.csv --roles blade*:output --out m.json": "blade*:output: no such file; roles are read from a TOML",
    "check nowhere": "nowhere: no such folder; a case is a folder with",
    "diagnose stage/case.toml --out out": "stage/case.toml: a case file, where the folder of a case is needed;",
    f"identify stage/case.toml {ROLES} --out m.json": "stage/case.toml: a case file, where a recording is needed;",
    f"identify my_case/model.json {ROLES} --out m.json": "my_case/model.json: a model file, where a recording is",
    f"simulate stage/case.toml monday.csv {ROLES} --out s.csv": "a case names its model under [baseline] file",
    "identify monday.csv --roles stage/case.toml --out m.json": "stage/case.toml: a case file, where a roles file is",
    "identify monday.csv --roles monday.csv --out m.json": "monday.csv: a recording, where a roles file is needed;",
}


@pytest.mark.parametrize("command", WRONG)
def test_a_file_in_the_place_of_another_is_named(
    command: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert WRONG[command] in said(command, capsys)


def edited(name: str, before: str, after: str) -> None:
    text = Path(name).read_text()
    assert before in text
    Path(name).write_text(text.replace(before, after))


def test_a_mistyped_name_in_equations_is_asked_about(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edited("stage/model.toml", "- k*q", "- kk*q")
    with pytest.raises(DataError, match=r"model.toml: 'kk' in the equations is neither .* did you mean 'k'\?"):
        load_case("stage")
    run = "simulate stage/model.toml stage/recording.csv --roles stage/roles.toml --out s.csv"
    assert "channel 'kk' is missing; did you mean 'k'?" in said(run, capsys)
    edited("stage/model.toml", "kk*q", "k*sine(q)")
    with pytest.raises(DataError, match=r"function 'sine' is not known; did you mean 'sin'\?"):
        load_case("stage")


@pytest.mark.parametrize(
    ("before", "after", "blamed"),
    [
        ("value = 2.0, min = 0.5", "value = 0, min = 0", r"\[parameters\] M: .*\[\[state\]\] v divides by M,"),
        (")/M", ")/(g - 4.0)", r"\[parameters\] g: .*divides by g - 4.0, which is 0"),
        (
            '[[state]]\nname = "q"', '[[auxiliary]]\nname = "inertia"\nequation = "z*k"\n[[state]]\nname = "q"',
            r"\[parameters\] z: .*\[\[state\]\] v divides by inertia, which is 0; give it a value other than 0",
        ),
    ],
)  # fmt: skip
def test_a_parameter_that_is_divided_by_and_zero_is_named(before: str, after: str, blamed: str, folder: Path) -> None:
    edited("stage/model.toml", before, after)
    if "inertia" in after:
        edited("stage/model.toml", ")/M", ")/inertia")
        edited("stage/model.toml", "[parameters]\n", "[parameters]\nz = 0\n")
    with pytest.raises(DataError, match=r"^stage/model.toml " + blamed):
        equations_file.load("stage/model.toml")


def record(columns: dict[str, tuple[str, str, np.ndarray]], source: str = "a.csv") -> Record:
    channels = tuple(Channel(name, unit, role) for name, (unit, role, _) in columns.items())
    values = np.column_stack([v for _, _, v in columns.values()])
    return Record(0.1 * np.arange(len(values)), values, channels, 0.1, source, "")


def wave(mean: float, size: float, rows: int = 200) -> np.ndarray:
    return mean + size * np.sin(0.3 * np.arange(rows))


def test_check_remarks_few_samples_resting_inputs_and_exchanged_channels() -> None:
    pitch, speed = ("deg", "input", wave(1170, 9)), ("rpm", "output", wave(8, 2))
    rest = ("kN m", "input", np.full(200, 43.0))
    told = doubts([record({"pitch": pitch, "torque": rest, "generator_speed": speed})], None, {})
    assert any("torque never changes; what an input does that rests is not to be seen" in t for t in told)
    assert any("pitch from" in t and "or is it exchanged with generator_speed?" in t for t in told)
    sound = {"pitch": ("deg", "input", wave(8, 2)), "generator_speed": ("rpm", "output", wave(1170, 9))}
    assert doubts([record(sound)], None, {}) == ()
    few = {name: (unit, role, v[:20]) for name, (unit, role, v) in sound.items()}
    assert any("20 samples are few" in t for t in doubts([record(few)], None, {}))


def test_check_remarks_channels_that_the_run_has_the_other_way_round() -> None:
    low, high = ("kN m", "output", wave(5, 1)), ("kN m", "output", wave(900, 50))
    told = doubts([record({"one": low, "two": high})], record({"one": high, "two": low}, "run.csv"), {})
    assert any(t.startswith("one is") and t.endswith("is a unit wrong, or is it exchanged with two?") for t in told)


def test_units_are_told_with_their_conversion(folder: Path) -> None:
    Path("a.csv").write_text("time_s,pitch [rad],speed\n0,1,2\n0.1,1,2\n0.2,2,3\n")
    Path("r.toml").write_text(
        '[recording]\ntime = "time_s"\n[[channel]]\nname = "pitch"\nunit = "deg"\nrole = "input"\n'
        '[[channel]]\nname = "speed"\nunit = "rpm"\nrole = "output"\n'
    )
    from aeolid.formats import read_record

    with pytest.raises(DataError, match=r"or multiply the column by 57.2958 \(docs/reference/files.md, Units\)"):
        read_record("a.csv", Roles.load("r.toml"))
    assert conversion("furlong", "m").startswith("convert the column (")


def test_the_page_lists_every_unit_that_is_known() -> None:
    text = (DOCS / "reference" / "files.md").read_text(encoding="utf-8")
    assert "\n## Units\n" in text
    section = text.split("\n## Units\n")[1].split("\n## ")[0]
    assert [unit for unit in known_units() if f"`{unit}`" not in section] == []
    assert all(f"`{unit}`" in section for unit in alike("kN m"))
