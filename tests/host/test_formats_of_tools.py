"""Files of simulators and measuring programs: Bladed, HAWC2, Excel, HDF5, TDMS give the recording that was written."""

from __future__ import annotations

import logging
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.begin.survey import survey
from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.formats import extras, read_record, read_table
from aeolid.record import Channel, Roles

pytestmark = pytest.mark.usefixtures("forking_throughout")

COUNT, STEP = 60, 0.05
AT = STEP * np.arange(COUNT)
PITCH, SPEED = 0.2 + 0.01 * np.sin(AT), 122.9 + np.cos(3 * AT)
CHANNELS = (
    Channel("pitch", "rad", "input", "Blade 1 pitch angle"),
    Channel("speed", "rad/s", "output", "Generator speed"),
)


def bladed_header(names: list[str], codes: list[str], *, access: str = "D", samples: int = COUNT) -> str:
    quoted = " ".join(f"'{n}'" for n in names)
    return "\n".join([
        "FILE run.$04", f"ACCESS {access}", "FORM U", "RECL 4", "FORMAT R*4", "CONTENT 'POWPROD'",
        "NDIMENS 2", f"DIMENS {len(names)} {samples}", "GENLAB 'Drive train variables'", f"VARIAB {quoted}",
        f"VARUNIT {' '.join(codes)}", "AXISLAB 'Time'", "AXIUNIT T", "AXIMETH 2", "MIN 0.0", f"STEP {STEP}", "NVARS 0",
    ]) + "\n"  # fmt: skip


def as_bladed(folder: Path, access: str = "D") -> Path:
    """Write two results of one run and its project: pitch in one, speed in the other."""
    for number, name, code, values in (
        ("04", "Generator speed", "A/T", SPEED),
        ("08", "Blade 1 pitch angle", "A", PITCH),
    ):
        (folder / f"run.%{number}").write_text(bladed_header([name, f"other {number}"], [code, "N"], access=access))
        table = np.column_stack([values, AT])
        if access == "D":
            (folder / f"run.${number}").write_bytes(table.astype("<f4").tobytes())
        else:
            np.savetxt(folder / f"run.${number}", table)
    (folder / "run.$PJ").write_text("<?xml version='1.0'?>\n")
    return folder / "run.$PJ"


def as_hawc2(folder: Path, form: str = "BINARY") -> Path:
    columns = [("Time", "s", "Time", AT), ("bea2  angle_speed", "rad", "Blade 1 pitch angle", PITCH),
               ("shaft angle speed", "rad/s", "Generator speed", SPEED)]  # fmt: skip
    head = [
        "_" * 60,
        "  Version ID : HAWC2MB 12.8",
        "",
        "  Time : 1",
        "  Date : 2",
        "",
        "  Result file : run",
        "_" * 60,
    ]
    head += [f" {COUNT:8d} {len(columns):8d} {COUNT * STEP:12.3f} {form}", "", "  Channel  Variable Description", ""]
    head += [f"{i + 1:7d}     {n:30s} {u:10s} {t}" for i, (n, u, t, _) in enumerate(columns)]
    scale = [float(np.max(np.abs(v))) / 32000 for *_, v in columns]
    if form == "BINARY":
        head += ["_" * 60, "Scale factors:", *(f"{s:.8E}" for s in scale)]
        packed = [np.rint(v / s).astype("<i2") for (*_, v), s in zip(columns, scale, strict=True)]
        (folder / "run.dat").write_bytes(b"".join(p.tobytes() for p in packed))
    else:
        np.savetxt(folder / "run.dat", np.column_stack([v for *_, v in columns]))
    (folder / "run.sel").write_text("\n".join(head) + "\n")
    return folder / "run.sel"


def as_xlsx(folder: Path) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["about this file"])
    sheet = book.create_sheet("data")
    sheet.append(["made by a logger"])
    sheet.append(["Timestamp", "Blade 1 pitch angle", "Generator speed", "note"])
    sheet.append(["", "rad", "rad/s", ""])
    for t, p, s in zip(AT.tolist(), PITCH.tolist(), SPEED.tolist(), strict=True):
        sheet.append([datetime(2024, 3, 1, 12) + timedelta(seconds=t), p, s, "ok"])
    book.save(folder / "run.xlsx")
    return folder / "run.xlsx"


def as_h5(folder: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "run.h5", "w") as file:
        group = file.create_group("logger")
        group["time_s"] = AT
        group.create_dataset("Blade 1 pitch angle", data=PITCH, compression="gzip").attrs["unit"] = "rad"
        group.create_dataset("Generator speed", data=SPEED[:, None])
        group["words"] = "text"
    return folder / "run.h5"


def as_tdms(folder: Path) -> Path:
    nptdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": STEP, "wf_start_offset": 0.0, "wf_start_time": np.datetime64("2024-03-01T12:00:00")}
    with nptdms.TdmsWriter(folder / "run.tdms") as writer:
        writer.write_segment([
            nptdms.ChannelObject("a", "Blade 1 pitch angle", PITCH, properties={**wave, "unit_string": "rad"}),
            nptdms.ChannelObject("a", "Generator speed", SPEED, properties=wave),
        ])  # fmt: skip
    return folder / "run.tdms"


WRITERS: dict[str, Callable[[Path], Path]] = {
    "Bladed": as_bladed, "Bladed as text": lambda f: as_bladed(f, "S"), "HAWC2": as_hawc2,
    "HAWC2 as text": lambda f: as_hawc2(f, "ASCII"), "xlsx": as_xlsx, "h5": as_h5, "tdms": as_tdms,
}  # fmt: skip
WITHIN = {"Bladed": 1e-5, "HAWC2": 4e-3}  # single precision of 123 rad/s; half a step of 16 bits of it


@pytest.mark.parametrize("name", WRITERS)
def test_what_was_written_is_read(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path)
    record = read_record(path, Roles(CHANNELS, None, None, "roles.toml"))
    assert record.sample_time_s == pytest.approx(STEP) and len(record) == COUNT
    expected: NDArray[np.float64] = np.column_stack([PITCH, SPEED])
    np.testing.assert_allclose(record.values, expected, atol=WITHIN.get(name, 1e-12))
    assert len(record.sha256) == 64


@pytest.mark.parametrize("name", ["Bladed", "HAWC2", "tdms"])
def test_init_understands_it(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path)
    assert main(["init", str(path)]) == 0
    roles = Roles.load(tmp_path / "roles.toml")
    assert {(c.name, c.unit, c.role) for c in roles.channels} == {
        ("pitch", "rad", "input"),
        ("generator_speed", "rad/s", "output"),
    }
    assert len(read_record(path, roles)) == COUNT


def test_one_result_of_bladed_and_its_hash(tmp_path: Path) -> None:
    """A header or its numbers name one result; the hash is that of both, so that other numbers are another file."""
    project = as_bladed(tmp_path)
    speed = Roles(CHANNELS[1:], None, None, "roles.toml")
    first, second = (read_record(tmp_path / n, speed) for n in ("run.%04", "run.$04"))
    np.testing.assert_array_equal(first.values, second.values)
    with pytest.raises(DataError, match="no channel 'Blade 1 pitch angle'"):
        read_record(tmp_path / "run.%04", Roles(CHANNELS, None, None, "roles.toml"))
    before = read_record(project, speed).sha256
    (tmp_path / "run.$04").write_bytes(np.column_stack([SPEED + 1, AT]).astype("<f4").tobytes())
    assert read_record(project, speed).sha256 != before


def test_channels_of_one_name_in_bladed_are_told_apart(tmp_path: Path) -> None:
    """Four in three results, two of them in one of these: none is dropped, and none answers for another."""
    held = {"04": ["v", "v", "Time"], "05": ["v", "w"], "06": ["x", "v"]}
    for k, (number, names) in enumerate(held.items()):
        (tmp_path / f"run.%{number}").write_text(bladed_header(names, ["N"] * len(names)))
        table = 10 * k + np.arange(len(names)) + 0.0 * AT[:, None]
        (tmp_path / f"run.${number}").write_bytes(table.astype("<f4").tobytes())
    (tmp_path / "run.$PJ").write_text("<?xml version='1.0'?>\n")
    found = read_table(tmp_path / "run.$PJ")
    means = {"v (.$04 1)": 0, "v (.$04 2)": 1, "Time (.$04)": 2, "v (.$05)": 10, "w": 11, "x": 20, "v (.$06)": 21}
    assert {n: v[0] for n, v in found.columns.items() if n != "Time"} == means
    np.testing.assert_allclose(found.columns["Time"], AT)
    with pytest.raises(DataError, match=r"'v' stands there 4 times \(v \(.\$04 1\), .*; name one of them in full"):
        read_table(tmp_path / "run.$PJ", ["v"])
    assert read_table(tmp_path / "run.$PJ", ["v (.$06)"]).columns["v (.$06)"][0] == 21


def test_blades_of_hawc2_bend_flapwise_about_their_x_axis(tmp_path: Path) -> None:
    as_hawc2(tmp_path)
    text = (tmp_path / "run.sel").read_text().replace("Generator speed", "MomentMx Mbdy:blade1 nodenr: 1 root")
    (tmp_path / "run.sel").write_text(text)
    kinds = {m.kind for m in survey(tmp_path / "run.dat").meanings.values()}
    assert kinds == {"pitch", "flap_moment"}


def test_rates_of_tdms_are_brought_to_one(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    slow = np.cos(0.2 * np.arange(15))
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        for name, values, step in (("Blade 1 pitch angle", PITCH, STEP), ("Generator speed", slow, 4 * STEP)):
            writer.write_segment([nptdms.ChannelObject("g", name, values, properties={"wf_increment": step})])
    roles = Roles(CHANNELS, None, None, "roles.toml")
    with pytest.raises(DataError, match="different clocks; let --resample"):
        read_record(tmp_path / "a.tdms", roles)
    record = read_record(tmp_path / "a.tdms", Roles(CHANNELS, None, None, "roles.toml", resample="auto"))
    assert record.sample_time_s == pytest.approx(0.2)
    np.testing.assert_allclose(record.column("pitch"), PITCH[::4][: len(record)], atol=1e-12)


@pytest.mark.parametrize("late", [0.0, 1.0])
def test_waveforms_of_tdms_start_when_they_say(tmp_path: Path, late: float) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        for group, name, values, start in (
            ("b", "Generator speed", SPEED, late),
            ("a", "Blade 1 pitch angle", PITCH, 0.0),
        ):
            at = np.datetime64("2024-03-01T12:00:00") + np.timedelta64(round(1000 * start), "ms")
            wave = {"wf_increment": STEP, "wf_start_time": at}
            writer.write_segment([nptdms.ChannelObject(group, name, values, properties=wave)])
    roles = Roles(CHANNELS, None, None, "roles.toml")
    if not late:
        assert read_record(tmp_path / "a.tdms", roles).begins == "2024-03-01T12:00:00Z"
        return
    with pytest.raises(DataError, match="different clocks; let --resample"):
        read_record(tmp_path / "a.tdms", roles)
    record = read_record(tmp_path / "a.tdms", Roles(CHANNELS, None, None, "roles.toml", resample="auto"))
    assert record.begins == "2024-03-01T12:00:00Z"
    skip = round(late / STEP)
    np.testing.assert_allclose(record.time_s[0], late, atol=1e-9)
    np.testing.assert_allclose(record.column("pitch"), PITCH[skip:][: len(record)], atol=1e-9)
    np.testing.assert_allclose(record.column("speed"), SPEED[: len(record)], atol=1e-9)


def in_workbook(folder: Path, headings: list[str], u: object = 1.0) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(headings)
    for k in range(COUNT):
        row = {"time_s": STEP * k, "u": u if k == 3 else k, "y": k * k}
        book.active.append([row[h] for h in headings])
    book.save(folder / "a.xlsx")
    return folder / "a.xlsx"


SIMPLE = Roles((Channel("u", "", "input"), Channel("y", "", "output")), None, None, "roles.toml")


def test_a_doubled_heading_of_a_workbook_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="heading 'u' stands there 2 times"):
        read_record(in_workbook(tmp_path, ["time_s", "u", "u", "y"]), SIMPLE)


@pytest.mark.parametrize("cell", ["1_000", "\u0661", "1,5"])
def test_texts_that_are_no_numbers_to_a_logger_are_refused(tmp_path: Path, cell: str) -> None:
    with pytest.raises(DataError, match=r"channel 'u', sample 4: .* is not a number"):
        read_record(in_workbook(tmp_path, ["time_s", "u", "y"], cell), SIMPLE)


@pytest.mark.parametrize("cell", [" 2.5 ", "  "])
def test_texts_that_are_numbers_or_blanks_are_read(tmp_path: Path, cell: str) -> None:
    record = read_record(in_workbook(tmp_path, ["time_s", "u", "y"], cell), SIMPLE)
    np.testing.assert_equal(record.column("u")[3], float(cell) if cell.strip() else np.nan)


def test_formulas_without_a_stored_value_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        record = read_record(in_workbook(tmp_path, ["time_s", "u", "y"], "=C3+1"), SIMPLE)
    assert np.flatnonzero(np.isnan(record.column("u"))).tolist() == [3]
    assert "1 formulas without a stored value are missing samples" in caplog.text


def test_an_absent_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.xlsx").write_bytes(b"PK")
    monkeypatch.setattr(extras.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DataError, match=r"need openpyxl, which is not installed: pip install 'aeolid\[files\]'"):
        read_record(tmp_path / "a.xlsx", Roles(CHANNELS, None, None, "roles.toml"))


def damaged(content: bytes, number: int) -> bytes:
    """Cut a file or change some of its bytes; the same number gives the same file."""
    rng = np.random.default_rng(number)
    if number % 3 == 0:
        return content[: int(rng.integers(0, len(content)))]
    found = bytearray(content)
    for _ in range(int(rng.integers(1, 12))):
        found[int(rng.integers(0, len(found)))] = int(rng.integers(0, 256))
    return bytes(found)


@pytest.mark.parametrize(("name", "file", "count"), [
    ("Bladed", "run.%04", 150), ("Bladed as text", "run.$04", 40), ("HAWC2", "run.sel", 150),
    ("HAWC2 as text", "run.dat", 40), ("xlsx", "run.xlsx", 4), ("h5", "run.h5", 6), ("tdms", "run.tdms", 6),
])  # fmt: skip
def test_damaged_files_are_read_or_refused(name: str, file: str, count: int, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path)
    content, roles = (tmp_path / file).read_bytes(), Roles(CHANNELS, None, None, "roles.toml")
    for number in range(count):
        (tmp_path / file).write_bytes(damaged(content, number))
        try:
            record = read_record(path, roles)
        except DataError as error:
            assert "\n" not in str(error) and "run." in str(error)
        else:
            assert record.values.shape[1] == 2


@pytest.mark.parametrize(("old", "new", "told"), [
    (f"DIMENS 2 {COUNT}", "DIMENS 2 2000000000", "too short"), (f"DIMENS 2 {COUNT}", "DIMENS 99999999 2", "dimensions"),
    ("FORMAT R*4", "FORMAT Z*9", "numbers of kind"), ("STEP 0.05", "STEP 0", "no step of time"),
    ("VARIAB 'Generator speed'", "VARIAB ", "names for"),
])  # fmt: skip
def test_what_a_header_announces_is_held_against_the_file(tmp_path: Path, old: str, new: str, told: str) -> None:
    as_bladed(tmp_path)
    text = (tmp_path / "run.%04").read_text()
    assert old in text
    (tmp_path / "run.%04").write_text(text.replace(old, new))
    with pytest.raises(DataError, match=told):
        read_record(tmp_path / "run.%04", Roles(CHANNELS[1:], None, None, "roles.toml"))


def test_lines_of_a_header_of_bladed_are_bounded(tmp_path: Path) -> None:
    """A line of 60 kB is one, of 70 kB it is no header's. Quoted words keep their blanks."""
    as_bladed(tmp_path)
    header = tmp_path / "run.%08"
    whole = header.read_text()
    header.write_text(whole + "CONTENT2 " + "a" * 60_000 + "\n")
    assert "Blade 1 pitch angle" in survey(header).table.names
    header.write_text(whole + "CONTENT2 " + "a" * 70_000 + "\n")
    with pytest.raises(DataError, match="line 18 has more than 64 KiB"):
        survey(header)


def test_announced_samples_of_hawc2_are_held_against_the_file(tmp_path: Path) -> None:
    for form in ("BINARY", "ASCII"):
        as_hawc2(tmp_path, form)
        text = (tmp_path / "run.sel").read_text()
        (tmp_path / "run.sel").write_text(text.replace(f"{COUNT:8d} ", "99999999 ", 1))
        with pytest.raises(DataError, match=r"too short|do not fit"):
            read_record(tmp_path / "run.sel", Roles(CHANNELS, None, None, "roles.toml"))
    (tmp_path / "run.sel").unlink()
    with pytest.raises(DataError, match="list of channels"):
        read_record(tmp_path / "run.dat", Roles(CHANNELS, None, None, "roles.toml"))
