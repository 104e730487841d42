"""Every file format gives the same recording, and every malformed file one sentence."""

from __future__ import annotations

import gzip
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aeolid.confined import start
from aeolid.errors import DataError
from aeolid.formats import read_record, read_table, write_table
from aeolid.formats.headings import plain_unit, same_unit, split_heading
from aeolid.record import Channel, Roles

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
ROLES = Roles((Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output")), None, "time_s", "roles.toml")
TIME = 0.1 * np.arange(7)
PITCH = np.array([0.5, 1.0, np.nan, -2.25, 1e-300, 3.0, 4.0])
SPEED = np.array([12.0, 12.5, 13.0, 12.25, 11.0, np.nan, 10.0])


def as_csv(path: Path) -> None:
    write_table(path, {"time_s": TIME, "pitch": PITCH, "speed": SPEED})


def as_parquet(path: Path) -> None:
    write_table(path, {"time_s": TIME, "pitch": PITCH, "speed": SPEED}, {"pitch": "deg", "speed": "rpm"})


def as_npz(path: Path) -> None:
    np.savez(path, time_s=TIME, pitch=PITCH, speed=SPEED)


def as_mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"time_s": TIME, "pitch": PITCH, "speed": SPEED[:, None]})


def as_mat_structure(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"log": {"time_s": TIME, "pitch": PITCH, "speed": SPEED}})


def as_mf4(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(PITCH, TIME, name="pitch", unit="°"), Signal(SPEED, TIME, name="speed", unit="1/min")])
        file.save(path)


def as_out(path: Path) -> None:
    head = "\n" * 6 + "Time pitch speed\n(s) (deg) (rpm)\n"
    rows = "".join(f"{t:.4f} {p!r} {s!r}\n" for t, p, s in zip(TIME, PITCH.tolist(), SPEED.tolist(), strict=True))
    path.write_text(head + rows)


def as_outb(path: Path, announce: int | None = None, step: float = 0.1) -> None:
    """Write the uncompressed kind (3) of OpenFAST's binary output, as its format description says."""
    names, units = ["Time", "pitch", "speed"], ["(s)", "(deg)", "(rpm)"]
    with open(path, "wb") as handle:
        handle.write(struct.pack("<hiidd", 3, 2, len(TIME) if announce is None else announce, 0.0, step))
        handle.write(struct.pack("<i", 4) + b"test")
        handle.writelines(text.ljust(10).encode() for text in names + units)
        handle.write(np.column_stack([PITCH, SPEED]).astype("<f8").tobytes())


FORMATS = {
    "a.csv": as_csv, "a.csv.gz": as_csv, "a.parquet": as_parquet, "a.npz": as_npz, "a.mat": as_mat,
    "b.mat": as_mat_structure, "a.mf4": as_mf4, "a.out": as_out, "a.outb": as_outb,
}  # fmt: skip


@pytest.mark.parametrize("name", FORMATS)
def test_formats_agree(tmp_path: Path, name: str) -> None:
    FORMATS[name](tmp_path / name)
    record = read_record(tmp_path / name, ROLES)
    assert record.names("input", "output") == ("pitch", "speed")
    np.testing.assert_array_equal(record.column("pitch"), PITCH)
    np.testing.assert_array_equal(record.column("speed"), SPEED)
    np.testing.assert_allclose(record.time_s, TIME, atol=1e-12)
    assert record.sample_time_s == 0.1
    assert len(record.sha256) == 64


numbers = st.floats(allow_nan=True, allow_infinity=False, width=64)


@pytest.mark.usefixtures("forking")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=40), st.sampled_from([".csv", ".csv.gz", ".parquet"]))
def test_round_trip_is_exact(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float]], suffix: str):
    path = tmp_path_factory.mktemp("round") / f"t{suffix}"
    a, b = np.array(rows).T
    write_table(path, {"a": a, "b, odd": b})
    back = read_table(path, ["a", "b, odd"]).columns
    np.testing.assert_array_equal(back["a"].view(np.uint64)[~np.isnan(a)], a.view(np.uint64)[~np.isnan(a)])
    np.testing.assert_array_equal(back["b, odd"], b)
    np.testing.assert_array_equal(np.isnan(back["a"]), np.isnan(a))


@settings(max_examples=30, deadline=None)
@given(st.lists(numbers, min_size=1, max_size=20))
def test_a_single_column_keeps_its_missing_samples(tmp_path_factory: pytest.TempPathFactory, values: list[float]):
    path = tmp_path_factory.mktemp("one") / "t.csv"
    write_table(path, {"a": np.array(values)})
    np.testing.assert_array_equal(read_table(path).columns["a"], values)


@pytest.mark.usefixtures("forking")
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=400), st.sampled_from([n.split(".", 1)[1] for n in FORMATS if n[-4:] != ".mat"]))
def test_garbage_is_refused_in_one_sentence(tmp_path_factory: pytest.TempPathFactory, content: bytes, suffix: str):
    path = tmp_path_factory.mktemp("garbage") / f"g.{suffix}"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"g\."):
        read_record(path, ROLES)


def read_damaged(path: Path, name: str, data: st.DataObject) -> None:
    """Cut and alter a file; it must be a DataError or a readable recording, no other exception and no crash."""
    FORMATS[name](path)
    content = bytearray(path.read_bytes())
    cut = data.draw(st.integers(0, len(content)))
    for _ in range(data.draw(st.integers(0, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content[:cut]))
    try:
        read_record(path, ROLES)
    except DataError as error:
        assert str(path) in str(error)


@pytest.mark.nightly  # by day test_fuzz_readers.py damages files of every format
@pytest.mark.usefixtures("forking")
@pytest.mark.parametrize("name", [name for name in FORMATS if not name.endswith(".mat")])
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_are_refused_or_read(tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject):
    read_damaged(tmp_path_factory.mktemp("damaged") / name, name, data)


@pytest.mark.nightly  # by day test_fuzz_readers.py
@pytest.mark.usefixtures("forking")
@pytest.mark.parametrize("name", ["a.mat", "b.mat"])
@settings(
    max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)  # each starts a process
@given(data=st.data())
def test_damaged_matlab_files_are_refused_or_read(
    tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject
):
    read_damaged(tmp_path_factory.mktemp("damaged") / name, name, data)


@pytest.mark.parametrize("cell", [b"\xa01.5", b"1_5", b"1.5\x85", b"nought"])
def test_a_cell_that_is_no_number_is_named_whatever_blanks_it_has(tmp_path: Path, cell: bytes) -> None:
    """A blank of Latin-1 is one to text and none to bytes: the search for the bad cell found none, and crashed."""
    as_out(tmp_path / "a.out")
    lines = (tmp_path / "a.out").read_bytes().split(b"\n")
    cells = lines[10].split()
    lines[10] = b" ".join([*cells[:-1], cell])
    (tmp_path / "a.out").write_bytes(b"\n".join(lines))
    with pytest.raises(DataError, match=r"a\.out: .*sample 3 \(line 11\)"):
        read_record(tmp_path / "a.out", ROLES)


CRASH = "aeolid.confined.probe:crash", {}


def test_a_reader_that_crashes_is_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    as_mat(tmp_path / "a.mat")
    monkeypatch.setattr("aeolid.formats.matlab.start", lambda _, __, limits: start(*CRASH, limits))
    with pytest.raises(DataError, match=r"a\.mat: not readable as MATLAB \(its reader crashed, SIGSEGV\)"):
        read_record(tmp_path / "a.mat", ROLES)


HEAD = "time_s,pitch,speed\n"
GOOD = "0,1,2\n0.1,1,2\n0.2,1,2\n"
MALFORMED = {
    "text": (HEAD + "0,1,2\n0.1,stuck,2\n0.2,1,2\n", ["'pitch'", "sample 2 (line 3)", "'stuck'", "empty"]),
    "short row": (HEAD + "0,1,2\n0.1,1\n0.2,1,2\n", ["sample 2 (line 3)", "2 cells", "3"]),
    "long row": (HEAD + "0,1,2\n0.1,1,2\n0.2,1,2,9\n", ["sample 3 (line 4)", "4 cells", "3"]),
    "missing column": ("time_s,Pitch,rpm\n" + GOOD, ["'pitch'", "did you mean 'Pitch'", "rpm", "column"]),
    "double column": ("time_s,pitch,speed,pitch\n0,1,2,3\n0.1,1,2,3\n", ["'pitch'", "2 times"]),
    "wrong unit": ("time_s,pitch [rad],speed\n" + GOOD, ["'pitch'", "'rad'", "'deg'"]),
    "wrong time unit": ("time_s [ms],pitch,speed\n" + GOOD, ["'ms'", "'s'"]),
    "unit row": (HEAD + "s,deg,rad/s\n" + GOOD, ["'speed'", "'rad/s'", "'rpm'"]),
    "zero rows": (HEAD, ["no sample"]),
    "empty": ("", ["empty"]),
    "blank": ("\n \n", ["empty"]),
    "no heading": ("0,1,2\n0.1,1,2\n", ["line 1", "heading"]),
    "backwards": (HEAD + "0,1,2\n0.1,1,2\n0.05,1,2\n", ["backwards", "sample 3 (line 4)", "0.1 s", "0.05 s"]),
    "repeated": (HEAD + "0,1,2\n0.1,1,2\n0.1,1,2\n", ["repeats", "sample 3 (line 4)"]),
    "uneven": (
        HEAD + "0,1,2\n0.1,1,2\n0.2,1,2\n0.35,1,2\n0.45,1,2\n",
        ["not uniform", "sample 4 (line 5)", "resample"],
    ),
    "long gap": (HEAD + "0,1,2\n0.1,1,2\n0.2,1,2\n90,1,2\n90.1,1,2\n", ["missing than recorded", "sample 4", "split"]),
    "time missing": (HEAD + "0,1,2\n,1,2\n0.2,1,2\n", ["time is missing", "sample 2 (line 3)"]),
    "infinite": (HEAD + "0,1,2\n0.1,1,inf\n0.2,1,2\n", ["'speed'", "infinite", "sample 2 (line 3)"]),
    "overflowing": (HEAD + "0,1,2\n0.1,1,1e400\n0.2,1,2\n", ["'speed'", "infinite", "sample 2"]),
    "no value": (HEAD + "0,,2\n0.1,,2\n0.2,,2\n", ["'pitch'", "no value", "ignore"]),
    "one sample": (HEAD + "0,1,2\n", ["one sample", "sample_time_s"]),
    "date": (HEAD + "05/01/2024 10:00,1,2\n05/01/2024 10:01,1,2\n", ["'time_s'", "sample 1", "2024-03-01T12:00"]),
    "no date": (HEAD + "2024-05-01 10:00,1,2\n2024-05-01 25:01,1,2\n", ["'time_s'", "sample 2 (line 3)", "no date"]),
    "one zone": (HEAD + "2024-05-01 10:00Z,1,2\n2024-05-01 10:01,1,2\n", ["'time_s'", "sample 2", "no time zone"]),
    "binary": ("time_s,pitch\0,speed\n", ["binary"]),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_tables_name_place_and_remedy(tmp_path: Path, case: str) -> None:
    text, expected = MALFORMED[case]
    path = tmp_path / "rec.csv"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_record(path, ROLES)
    message = str(caught.value)
    assert caught.value.exit_code == 3
    assert "\n" not in message
    for part in ["rec.csv", *expected]:
        assert part in message, message


def test_text_deep_in_a_large_file_is_named(tmp_path: Path) -> None:
    rows = [f"{0.1 * k:.1f},1,2\n" for k in range(400_000)]  # more than one block of the fast reader
    rows[399_990] = "39999.0,1,oops\n"
    (tmp_path / "rec.csv").write_text(HEAD + "".join(rows))
    with pytest.raises(DataError, match=r"'speed', sample 399991 \(line 399992\): 'oops'"):
        read_record(tmp_path / "rec.csv", ROLES)


def test_missing_files_folders_and_suffixes(tmp_path: Path) -> None:
    (tmp_path / "rec.xyz").write_text("x")
    (tmp_path / "cut.csv.gz").write_bytes(gzip.compress((HEAD + GOOD * 2000).encode())[:-9])
    for name, part in {"no.csv": "no such file", ".": "a folder", "rec.xyz": "suffix", "cut.csv.gz": "gzip"}.items():
        with pytest.raises(DataError, match=part):
            read_record(tmp_path / name, ROLES)


@pytest.mark.parametrize(("written", "unit"), [("(deg)", "deg"), ("deg", "deg"), ("(-)", "-"), ("1/(s)", "1/(s)")])
def test_units_of_outb_lose_nothing_but_their_brackets(tmp_path: Path, written: str, unit: str) -> None:
    as_outb(tmp_path / "a.outb")
    content = (tmp_path / "a.outb").read_bytes().replace(b"(deg)     ", written.ljust(10).encode(), 1)
    (tmp_path / "a.outb").write_bytes(content)
    assert read_table(tmp_path / "a.outb", ["pitch"]).units["pitch"] == unit


def test_announced_size_is_checked_before_memory_is_taken(tmp_path: Path) -> None:
    as_outb(tmp_path / "a.outb", announce=2_000_000_000)
    with pytest.raises(DataError, match="too short"):
        read_record(tmp_path / "a.outb", ROLES)


@pytest.mark.parametrize("bits", [0x7F800001, 0x7FC00000, 0x7F800000, 0], ids=["signalling", "nan", "inf", "zero"])
@pytest.mark.parametrize("place", [0, 2], ids=["scale", "offset"])
def test_a_packed_channel_without_a_usable_scale_is_named(tmp_path: Path, bits: int, place: int) -> None:
    """Of OpenFAST's packed output: pitch has the damaged number, speed can be read. An offset of zero is sound."""
    numbers = [2.0, 100.0, 7.0, -3.0]  # scales, then offsets
    words = [struct.pack("<f", x) for x in numbers]
    words[place] = struct.pack("<I", bits)
    counts = np.arange(40, dtype="<i2").reshape(20, 2)
    texts = b"".join(t.ljust(10).encode() for t in ("Time", "pitch", "speed", "(s)", "(deg)", "(rpm)"))
    head = struct.pack("<hiidd", 2, 2, 20, 0.0, 0.1) + b"".join(words) + struct.pack("<i", 0)
    (tmp_path / "a.outb").write_bytes(head + texts + counts.tobytes())
    np.testing.assert_allclose(read_table(tmp_path / "a.outb", ["speed"]).columns["speed"], (counts[:, 1] + 3) / 100)
    if place and not bits:
        np.testing.assert_allclose(read_table(tmp_path / "a.outb", ["pitch"]).columns["pitch"], counts[:, 0] / 2)
        return
    with pytest.raises(DataError, match=r"channel 'pitch' has the scale .* and the offset .*, which give no values"):
        read_table(tmp_path / "a.outb", ["pitch"])


def test_a_packed_time_without_a_usable_scale_is_named(tmp_path: Path) -> None:
    texts = b"".join(t.ljust(10).encode() for t in ("Time", "pitch", "(s)", "(deg)"))
    head = struct.pack("<hiidd", 1, 1, 20, 0.0, 0.1) + struct.pack("<ffi", 1.0, 0.0, 0)
    (tmp_path / "a.outb").write_bytes(head + texts + np.arange(20, dtype="<i4").tobytes() + b"\0\1" * 20)
    with pytest.raises(DataError, match=r"channel 'Time' has the scale 0 and the offset 0\.1"):
        read_table(tmp_path / "a.outb", ["pitch"])
    as_outb(tmp_path / "b.outb", step=np.inf)
    with pytest.raises(DataError, match=r"its time begins at 0 s in steps of inf s"):
        read_table(tmp_path / "b.outb", ["pitch"])


def test_a_table_beyond_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aeolid.formats.bounds.memory_limit", lambda: 100)
    for name in ("a.csv", "a.parquet", "a.npz"):
        FORMATS[name](tmp_path / name)
        with pytest.raises(DataError, match="split the recording"):
            read_record(tmp_path / name, ROLES)


def test_mdf_clocks_must_agree(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(PITCH, TIME, name="pitch", unit="deg")])
        file.append([Signal(SPEED, TIME + 0.01, name="speed", unit="rpm")])
        file.save(tmp_path / "a.mf4")
    with pytest.raises(DataError, match="different clocks"):
        read_record(tmp_path / "a.mf4", ROLES)


def test_whole_gaps_become_missing_samples(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "rec.csv").write_text(HEAD + "0,1,2\n0.1,1,2\n0.4,1,2\n0.5,3,4\n0.6,5,6\n")
    with caplog.at_level(logging.WARNING):
        record = read_record(tmp_path / "rec.csv", ROLES)
    np.testing.assert_array_equal(record.column("pitch"), [1, 1, np.nan, np.nan, 1, 3, 5])
    np.testing.assert_allclose(record.time_s, 0.1 * np.arange(7))
    assert "2 missing samples in 1 gap(s), the first before sample 3 (line 4)" in caplog.text


def test_jitter_and_rounding_pass_but_a_wrong_sample_time_does_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    time = np.round(0.00125 * np.arange(2000), 4) + rng.uniform(-1e-7, 1e-7, 2000)
    write_table(tmp_path / "rec.csv", {"time_s": time, "pitch": time, "speed": time})
    declared = Roles(ROLES.channels, 0.00125, "time_s", "roles.toml")
    assert read_record(tmp_path / "rec.csv", declared).sample_time_s == 0.00125
    with pytest.raises(DataError, match=r"runs at 0\.00125.* says 0\.00126"):
        read_record(tmp_path / "rec.csv", Roles(ROLES.channels, 0.00126, "time_s", "roles.toml"))


def test_without_a_time_column_the_sample_time_is_needed(tmp_path: Path) -> None:
    write_table(tmp_path / "rec.csv", {"pitch": PITCH, "speed": SPEED})
    given_time = Roles(ROLES.channels, 0.5, None, "roles.toml")
    np.testing.assert_array_equal(read_record(tmp_path / "rec.csv", given_time).time_s, 0.5 * np.arange(7))
    with pytest.raises(DataError, match="no time column and no sample_time_s"):
        read_record(tmp_path / "rec.csv", Roles(ROLES.channels, None, None, "roles.toml"))


@pytest.mark.parametrize(
    "text",
    [
        "time_s;pitch;speed\n0;1,5;2\n0,1;1,5;2\n",
        "# logger 7\ntime_s\tpitch\tspeed\n0\t1.5\t2\n0.1\t1.5\t2\n",
        "\ufefftime_s,pitch (deg),speed [1/min]\r\n0,1.5,2\r\n0.1,1.5,2\r\n",
        '"time_s","pitch_[deg]","speed","note"\n0,"1.5",2,"a, b"\n0.1,1.5,2,\n\n',
    ],
)
def test_the_dialects_of_csv(tmp_path: Path, text: str) -> None:
    (tmp_path / "rec.csv").write_text(text, encoding="utf-8")
    record = read_record(tmp_path / "rec.csv", ROLES)
    np.testing.assert_array_equal(record.values, [[1.5, 2], [1.5, 2]])
    assert record.sample_time_s == 0.1


def test_a_first_row_of_missing_samples_is_no_row_of_units(tmp_path: Path) -> None:
    (tmp_path / "rec.csv").write_text("pitch,speed\nNaN,nan\n1,2\n,\n3,4\n")
    record = read_record(tmp_path / "rec.csv", Roles(ROLES.channels, 0.1, None, "roles.toml"))
    np.testing.assert_array_equal(record.values, [[np.nan, np.nan], [1, 2], [np.nan, np.nan], [3, 4]])


def test_ignored_channels_need_not_exist_or_be_numbers(tmp_path: Path) -> None:
    (tmp_path / "rec.csv").write_text("time_s,pitch,speed,note\n0,1,2,windy\n0.1,1,2,calm\n")
    channels = (*ROLES.channels, Channel("note", "", "ignore"), Channel("absent", "", "ignore"))
    record = read_record(tmp_path / "rec.csv", Roles(channels, None, "time_s", "roles.toml"))
    assert [c.name for c in record.channels] == ["pitch", "speed"]


def test_units_have_many_spellings() -> None:
    for a, b in [
        ("kN·m", "kN m"),
        ("m/s^2", "m/s²"),
        ("°/s", "deg/s"),
        ("1/min", "rpm"),
        ("sec", "s"),
        ("kN-m", "kNm"),
    ]:
        assert same_unit(a, b), (a, b)
    for a, b in [("mW", "MW"), ("rad", "deg"), ("m/s", "m/s^2"), ("kN", "kNm")]:
        assert not same_unit(a, b), (a, b)
    assert split_heading("GenSpeed_[rpm]") == ("GenSpeed", "rpm")
    assert split_heading("[odd") == ("[odd", None)
    assert plain_unit(" - ") == ""


def test_the_positioning_stage_reads_with_its_jitter() -> None:
    folder = SHARED / "cases" / "known" / "emps"
    if not folder.is_dir():
        pytest.skip(f"{folder.name}: the known cases are not beside the repository")
    record = read_record(folder / "estimation.csv.gz", Roles.load(folder / "roles.toml"))
    assert record.values.shape == (24841, 4)
    assert record.sample_time_s == 0.001
