"""From files to a case: what headings mean, what units values have, what is written, what was understood."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study

from aeolid.begin.guess import guess
from aeolid.begin.make import begin
from aeolid.begin.survey import survey
from aeolid.begin.understood import holes_of, sparkline
from aeolid.cli.common import console
from aeolid.cli.main import main
from aeolid.diagnose.data.case import load_case
from aeolid.errors import DataError
from aeolid.formats import read_record, write_table
from aeolid.formats.meanings import KINDS, meaning_of
from aeolid.plants import hawt
from aeolid.record import Record, Roles

HEADINGS = {
    "OpenFAST": {
        "BldPitch1": "pitch 1", "BldPitch3_[deg]": "pitch 3", "BlPitchC1 (deg)": "pitch 1 demand", "GenTq": "torque",
        "GenSpeed": "generator_speed", "RotSpeed": "rotor_speed", "Azimuth": "azimuth", "LSSTipPxa": "azimuth",
        "LSSTipVxa": "rotor_speed", "YawBrTAxp": "tower_acc_fore_aft", "NcIMUTAys": "tower_acc_side_side",
        "RootMyb2": "flap_moment 2", "RootMxb1": "edge_moment 1", "RootMyc3": "flap_moment 3", "Wind1VelX": "wind",
        "TTDspFA": "tower_fore_aft", "GenPwr": "power", "RotThrust": "thrust", "RotTorq": "shaft_torque",
        "TwrBsMyt": "tower_moment_fore_aft", "TTAccFA": "tower_acc_fore_aft", "TTAccSS": "tower_acc_side_side",
        "LSShftTq": "shaft_torque", "RtVAvgxh": "wind", "Wind1VelY": "", "YawPzn": "", "TipDxc1": "",
        "PtfmPitch": "", "OoPDefl1": "",
    },
    "ROSCO": {
        "rootMOOP(1)": "flap_moment 1", "WE_Vw": "wind", "PC_PitComT": "pitch demand", "GenTqMeas": "torque",
        "FA_Acc": "tower_acc_fore_aft", "VS_LastGenTrq": "torque demand", "GenSpeedF": "generator_speed",
        "NacIMU_FA_Acc": "tower_acc_fore_aft", "HorWindV": "wind",
    },
    "Bladed": {
        "Blade 1 pitch angle": "pitch 1", "Demanded pitch angle": "pitch demand", "Blade 2 pitch rate": "",
        "Generator torque": "torque", "Demanded generator torque": "torque demand", "Rotor speed": "rotor_speed",
        "Generator speed": "generator_speed", "Nacelle fore-aft acceleration": "tower_acc_fore_aft",
        "Nacelle side-side acceleration": "tower_acc_side_side", "Blade 1 My (Root axes)": "flap_moment 1",
        "Blade 3 Mx (Root axes)": "edge_moment 3", "Hub wind speed magnitude": "wind", "Electrical power": "power",
        "Rotor azimuth angle": "azimuth",
    },
    "HAWC2": {
        "shaft_rot angle": "azimuth", "shaft_rot angle speed": "rotor_speed", "pitch1 angle": "pitch 1",
        "pitch2 angle speed": "", "Omega": "rotor_speed", "Ae rot. torque": "shaft_torque",
        "Free wind speed Vy": "wind",
    },
    "SCADA": {
        "Pitch angle A (°)": "pitch 1", "Blade angle (pitch position) B (°)": "pitch 2", "GenRPM": "generator_speed",
        "Generator RPM (RPM)": "generator_speed", "Wind direction (°)": "", "Power (kW)": "power",
        "Gear oil temperature (°C)": "", "Wind speed, Standard deviation (m/s)": "", "PITCH_DEMAND": "pitch demand",
        "GEN_SPD": "generator_speed", "GEN_TRQ_REF": "torque demand", "TWR_ACC_FA": "tower_acc_fore_aft",
        "TT_ACC_SS": "tower_acc_side_side", "BladeRootFlap1": "flap_moment 1", "BLD1_ROOT_MY": "flap_moment 1",
        "rotor_position": "azimuth", "yaw angle": "", "Nacelle position": "", "Reactive power": "", "drive": "",
        "PitchMotorTorque": "", "PitchAngleSP_deg": "pitch demand", "Pitch_Excitation": "pitch_excitation",
    },
}  # fmt: skip


@pytest.mark.parametrize("program", HEADINGS)
def test_headings_mean_what_an_engineer_reads(program: str) -> None:
    found = {}
    for heading in HEADINGS[program]:
        m = meaning_of(heading)
        parts = [] if m is None else [m.kind, *([str(m.blade)] if m.blade else []), *(["demand"] if m.demand else [])]
        found[heading] = " ".join(parts)
    assert found == HEADINGS[program]


def test_the_names_given_are_recognised_again() -> None:
    """A file that carries the names of this tool is read as it was meant."""
    for kind in KINDS:
        found = meaning_of(kind)
        assert found is not None and found.kind == kind, kind


def test_guessed_roles_read_the_file(tmp_path: Path) -> None:
    record = hawt.simulate_closed_loop(600, 2, excitation=hawt.Excitation(noise=0.1))
    columns = {
        "time": record.time_s, "Blade angle A": 0.2 + 0.01 * record.column("pitch"),
        "Blade angle B": 0.2 + 0.01 * record.column("pitch"), "Gen torque": 43000 + record.column("generator_torque"),
        "Gen speed": 122.9 + 0.1 * record.column("generator_speed"), "never": np.ones(600),
        "Nacelle acceleration X": record.column("generator_speed") ** 2,
    }  # fmt: skip
    write_table(tmp_path / "a.csv", columns)
    assert main(["init", str(tmp_path / "a.csv")]) == 0
    roles = Roles.load(tmp_path / "roles.toml")
    assert [(c.name, c.unit, c.role) for c in roles.channels] == [
        ("pitch", "rad", "input"), ("torque", "N m", "input"), ("generator_speed", "rad/s", "output"),
        ("tower_acc_fore_aft", "m/s^2", "output"),
    ]  # fmt: skip
    back = read_record(tmp_path / "a.csv", roles)
    np.testing.assert_array_equal(back.column("torque"), columns["Gen torque"])
    text = (tmp_path / "roles.toml").read_text()
    assert "#   never" in text and "#   Blade angle B: blade pitch angle: Blade angle A is used" in text


@pytest.mark.parametrize(
    ("said", "unit"),
    [("KW", "kW"), ("mW", "mW"), ("MW", "MW"), ("mNm", "mNm"), ("MNm", "MN m"), ("knm", "kN m"), ("DEG", "deg")],
)
def test_a_heading_in_capitals_is_understood_where_it_can_mean_one_unit(said: str, unit: str, tmp_path: Path) -> None:
    """Milli and mega differ by nine powers of ten and by the capital alone."""
    (tmp_path / "a.csv").write_text(f"time_s,load [{said}]\n" + "".join(f"{i},{i % 3}\n" for i in range(20)))
    assert survey(tmp_path / "a.csv").unit(f"load [{said}]") == unit


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    study = load_study("newcomer")
    if not study.CASE.is_dir():
        pytest.skip(f"{study.CASE.name}: the known cases are not beside the repository")
    return study.make_files(tmp_path_factory.mktemp("newcomer"), 30.0)


def test_a_pair_of_files_becomes_a_case(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """A logger's CSV with dates in N m, a simulator's .outb in kN m, other headings: one case, one unit."""
    field, simulator = pair
    facts_file = tmp_path / "facts.json"
    assert main(["init", str(field), "--baseline", str(simulator), "--json", str(facts_file)]) == 0
    facts = json.loads(facts_file.read_text())
    assert facts["missing"] == [] and facts["context"]["blades"]["value"] == 3
    assert facts["context"]["rated_speed_rad_s"]["value"] == pytest.approx(1.267, rel=0.02)
    assert facts["context"]["gearbox_ratio"]["value"] == pytest.approx(97, rel=0.01)
    case = load_case(field.parent)
    (record,), run = case.records, case.baseline
    assert isinstance(run, Record) and case.kind == "run" and record.begins == "2024-03-01T13:00:00Z"
    assert record.names("input") == run.names("input") == ("pitch", "torque")
    assert [run.unit(n) for n in ("torque", "pitch")] == ["N m", "deg"]
    assert np.mean(run.column("torque")) == pytest.approx(43_000, rel=0.03)
    assert len(record.names("output")) == 6


def test_check_says_what_was_understood(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "width", 120)  # a terminal with room for the picture
    field, simulator = pair
    page = field.parent / "page.html"
    main(["init", str(field), "--baseline", str(simulator), "--force"])
    capsys.readouterr()
    assert main(["check", str(field.parent), "--picture", str(page), "--json", str(page.with_suffix(".json"))]) == 0
    told = capsys.readouterr().out
    assert "601 samples, 20 samples a second, 30.05 s, from 2024-03-01T13:00:00Z, no holes" in told and "▁" in told
    facts = json.loads(page.with_suffix(".json").read_text())
    assert [f["kind"] for f in facts["files"]] == ["recording", "baseline run"] and facts["look_at"] == []
    rows = {c["name"]: c for c in facts["files"][1]["channels"]}
    assert rows["torque"]["unit"] == "N m" and rows["torque"]["hold"] == "by likelihood (smooth)"
    assert page.read_text().count("<svg") == 1


def test_check_says_a_thing_once_and_draws_each_channel_on_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the model is not there yet, so that the recordings are read a second time."""
    monkeypatch.setattr(console, "width", 100)  # the environment's is read when the console is made
    rows = [f"{1709290800 + 0.1 * k:.1f},{np.sin(k):.4f},{1170 + np.cos(k):.3f},{np.sin(2 * k):.4f}" for k in range(99)]
    text = "\n".join(["time,BldPitch1,GenSpeed,Nacelle fore-aft acceleration", *rows])
    (tmp_path / "turbine.csv").write_text(text + "\n")
    assert main(["init", str(tmp_path / "turbine.csv")]) == 0
    capsys.readouterr()
    caplog.clear()
    assert main(["check", str(tmp_path)]) == 3
    out = capsys.readouterr().out
    assert caplog.text.count("counts s since 1970") == 1
    line = next(row for row in out.splitlines() if "tower_acc_fore_aft" in row)
    assert re.search("[▁-█]{10}", line) and not any(re.fullmatch("[ ▁-█]+", row) for row in out.splitlines())


@pytest.mark.parametrize("width", [30, 60, 80, 100, 200])
def test_check_cuts_no_number_and_no_unit(
    width: int, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a narrow terminal the picture goes first, then cells take several lines."""
    monkeypatch.setattr(console, "width", width)
    head = "time_s,BldPitch1,GenSpeed,Nacelle fore-aft acceleration"
    rows = [f"{0.1 * k:.1f},{np.sin(k):.4f},{1170 + np.cos(k):.3f},{np.sin(2 * k):.4f}" for k in range(99)]
    (tmp_path / "turbine.csv").write_text("\n".join([head, *rows]) + "\n")
    assert main(["init", str(tmp_path / "turbine.csv")]) == 0
    capsys.readouterr()
    assert main(["check", str(tmp_path)]) == 3
    told = "".join(capsys.readouterr().out.split())
    if width >= 80:
        assert all(t in told for t in ("m/s^2", "0.9978", "0.9999", "1169", "1171"))
    assert width < 200 or "▁" in told
    assert "…" not in told


def test_the_picture_of_a_case_may_lie_in_its_folder_and_be_drawn_again(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """As the command's own example has it; what somebody else put there, or changed, stays."""
    folder = pair[0].parent
    picture = folder / "check.html"
    asked = ["check", str(folder), "--picture", str(picture)]
    assert main(["init", str(pair[0]), "--baseline", str(pair[1])]) in (0, 2)
    assert main(asked) == 0 and main(asked) == 0
    picture.write_text("mine")
    assert main(asked) == 2 and picture.read_text() == "mine"
    assert "is an input of this command" in capsys.readouterr().err
    picture.unlink()


def test_nothing_that_exists_is_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_table(tmp_path / "a.csv", {"time_s": np.arange(9) * 0.1, "pitch": np.arange(9.0), "GenSpeed": np.arange(9.0)})
    assert main(["init", str(tmp_path / "a.csv")]) == 0
    mine = (tmp_path / "roles.toml").read_text() + "# mine\n"
    (tmp_path / "roles.toml").write_text(mine)
    assert main(["init", str(tmp_path / "a.csv")]) == 2
    assert "exists already and is not replaced" in capsys.readouterr().err
    assert (tmp_path / "roles.toml").read_text() == mine
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "case.toml").symlink_to(tmp_path / "elsewhere.toml")
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "elsewhere.toml").exists() and not (tmp_path / "other" / "roles.toml").exists()


ROLE_READERS = ("identify", "modes", "scales")
HOSTILE = ['a"b', "a\\", "]\nx = 1\n[", "\x1b[31mred", "'''", "\u202eevil", "role", "x" * 300, "#", "\x7f"]


def test_headings_that_are_code_stay_text(tmp_path: Path) -> None:
    """Whatever a file calls its channels, the files written are TOML with no key but ours."""
    names = ["time_s", *(f"pitch {h}" for h in HOSTILE), *(f"{h} gen speed" for h in HOSTILE)]
    cells = ['"' + n.replace('"', '""') + '"' for n in names]
    rows = [",".join(str(0.1 * k if i == 0 else (k * i) % 7) for i in range(len(names))) for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(c.replace("\n", " ") for c in cells), *rows]) + "\n")
    made = begin(tmp_path / "a.csv", None, tmp_path)
    for name, text in made.files.items():
        assert set(tomllib.loads(text)) <= {"recording", "channel", "case", "recordings", "baseline", "context"}, name
        assert not set(text) & {"\x1b", "\u202e", "\x7f"}


def test_unknown_headings_are_left_to_the_user(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("time_s,drive,position,note\n0,1,2,a\n0.1,2,2,b\n0.2,1,3,c\n")
    assert main(["init", str(tmp_path / "a.csv")]) == 0
    out = capsys.readouterr().out
    assert "No input and no output was recognised" in out
    assert "give at least one channel of" in out.partition("Next:")[2].partition("aeolid check")[0]
    content = tomllib.loads((tmp_path / "roles.toml").read_text())
    assert [c["role"] for c in content["channel"]] == ["ignore"] * 3
    roles = str(tmp_path / "roles.toml")
    for command in (["check", str(tmp_path)], *([n, str(tmp_path / "a.csv"), "--roles", roles] for n in ROLE_READERS)):
        asked = [*command, "--out", str(tmp_path / "model.json")] if command[0] == "identify" else command
        assert main(asked) == 3, command
        told = capsys.readouterr().err
        assert "roles.toml: every channel is ignored; give at least one the role output" in told, command
    write_table(tmp_path / "b.csv", {"time_s": np.arange(9) * 0.1, "x": np.arange(9.0), "y": np.arange(9.0)})
    with pytest.raises(DataError, match="no input or no output is recognised in both"):
        begin(tmp_path / "a.csv", tmp_path / "b.csv", tmp_path)


def test_the_clock_is_guessed_too(tmp_path: Path) -> None:
    rows = [f"{50 * k},{k % 5},{1000 + k % 3}" for k in range(40)]
    (tmp_path / "a.csv").write_text("\n".join(["Time,pitch,Generator rpm", *rows]) + "\n")
    assert survey(tmp_path / "a.csv").time_unit == "ms"
    rows = [f"{0.05 * k:.2f},{k % 5},{1000 + k % 3 if k % 4 == 0 else ''}" for k in range(40)]
    (tmp_path / "b.csv").write_text("\n".join(["Time,pitch,Generator rpm", *rows]) + "\n")
    assert survey(tmp_path / "b.csv").resample == "auto"
    (tmp_path / "c.csv").write_text("pitch,Generator rpm\n1,1000\n2,1001\n3,1003\n")
    assert survey(tmp_path / "c.csv").sample_time_s == 0.1
    for name in ("a.csv", "b.csv"):
        made = begin(tmp_path / name, None, tmp_path)
        (tmp_path / "roles.toml").write_text(made.files["roles.toml"])
        record = read_record(tmp_path / name, Roles.load(tmp_path / "roles.toml"))
        assert record.sample_time_s == pytest.approx(0.05 if name == "a.csv" else 0.2)


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "rpm"), (np.pi / 30, "rad/s")])
def test_units_by_size(tmp_path: Path, scale: float, unit: str) -> None:
    values = scale * (1173 + 20 * np.sin(np.arange(50)))
    write_table(
        tmp_path / "a.csv", {"time_s": np.arange(50) * 0.1, "Gen speed": values, "pitch": np.sin(np.arange(50))}
    )
    assert next(g.unit for g in guess(survey(tmp_path / "a.csv")).used if g.name == "generator_speed") == unit


def test_holes_are_counted_and_drawn() -> None:
    record = hawt.simulate_closed_loop(100, 1, excitation=hawt.Excitation(noise=0.1))
    values = record.values.copy()
    values[20:25], values[60:80] = np.nan, np.nan
    found = holes_of(Record(record.time_s, values, record.channels, 0.1, "a", ""))
    assert (found.rows, found.stretches) == (25, 2)
    assert found.longest_s == pytest.approx(2.0) and found.at_s == pytest.approx(record.time_s[60])
    assert sparkline(np.array([0.0, 1.0, np.nan, 2.0, 3.0]), 5) == "▁▃ ▆█"


def test_odd_levels_and_impossible_contexts_are_said(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    field, simulator = pair
    main(["init", str(field), "--baseline", str(simulator), "--force"])
    roles, case = field.parent / "roles.toml", field.parent / "case.toml"
    right = roles.read_text(), case.read_text()
    roles.write_text(right[0].replace('unit = "kN m"', 'unit = "N m"'))
    capsys.readouterr()
    assert main(["check", str(field.parent)]) == 0
    assert "flap_moment_1 is" in (told := capsys.readouterr().out) and "is a unit wrong?" in told
    roles.write_text(right[0])
    case.write_text(right[1].replace("rated_speed_rad_s = 1.2", "rated_speed_rad_s = 12.2"))
    assert main(["check", str(field.parent)]) == 3
    assert "rad/s are wanted, not rpm" in capsys.readouterr().err
    case.write_text(right[1].replace("rated_speed_rad_s = 1.2", "rated_speed_rad_s = 48.0"))
    assert main(["check", str(field.parent)]) == 0  # idling at a fortieth: in rpm it would turn at a quarter


def test_headings_of_two_versions_of_openfast_are_one_case(tmp_path: Path) -> None:
    """The turbine's .outb has headings of earlier versions, the simulator's those of today: the same channels."""
    study = load_study("newcomer")
    if not study.CASE.is_dir():
        pytest.skip(f"{study.CASE.name}: the known cases are not beside the repository")
    field, simulator = study.make_files(tmp_path, 10.0, "outb")
    assert main(["init", str(field), "--baseline", str(simulator)]) == 0
    own, other = (Roles.load(tmp_path / name) for name in ("roles.toml", "run_roles.toml"))
    assert [(c.name, c.role) for c in own.channels] == [(c.name, c.role) for c in other.channels]
    same = {c.column for c in own.channels} & {c.column for c in other.channels}
    assert len(own.channels) == 10 and same == {"GenTq", "GenSpeed"}


@pytest.mark.nightly
@pytest.mark.parametrize("field", ["csv", "outb"])
def test_the_newcomer_gets_from_two_files_to_a_named_effect(field: str, tmp_path: Path) -> None:
    """Three commands: init, check, diagnose; a minute of both files is enough for a lag of 0.3 s."""
    study = load_study("newcomer")
    if not study.CASE.is_dir():
        pytest.skip(f"{study.CASE.name}: the known cases are not beside the repository")
    done = subprocess.run(
        [sys.executable, study.__file__, str(tmp_path), "--seconds", "60", "--field", field],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "3 commands" in done.stdout and "named, pitch acts through a first-order lag" in done.stdout
