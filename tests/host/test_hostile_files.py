"""Files made to hurt: none is executed, fills the memory, hangs or reaches the terminal; each is one sentence."""

from __future__ import annotations

import gzip
import os
import re
import socket
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.can.logs import open_log
from aeolid.can.raw_mf4 import Mf4Log
from aeolid.can.recorder import read_log
from aeolid.errors import DataError
from aeolid.formats import bounds, read_record, read_table, write_table
from aeolid.formats.conversions import convert
from aeolid.formats.headings import find_heading, split_heading
from aeolid.formats.recording import SUFFIXES
from aeolid.record import Channel, Roles

ROLES = Roles((Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output")), None, "time_s", "roles.toml")
TIME = 0.1 * np.arange(50)


def mf4(path: Path, conversions: dict[str, dict[str, object]]) -> Path:
    """Write channels of one raw ramp, each with a conversion."""
    with MDF(version="4.10") as file:
        raw = np.arange(50, dtype="<i4")
        file.append([Signal(raw, TIME, name=n, conversion=from_dict(c)) for n, c in conversions.items()])
        file.save(path, overwrite=True)
    return path


@pytest.mark.parametrize(
    "formula", ["__import__('os').system('id > {}')", "quotes", "X.__class__", "X if X else open('{}', 'w')", "[X][0]",
                "X and X", "lambda: X", "X := 2", "f'{{X}}'", "Y + 1", "X ^ 2", "X" + "+X" * 600],
)  # fmt: skip
@pytest.mark.usefixtures("forking")
def test_a_formula_of_a_file_is_never_code(formula: str, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    text = f"""("'", (lambda: __import__("os").system("id > {mark}"))(), "'")"""
    text = text if formula == "quotes" else formula.format(mark)
    path = mf4(tmp_path / "a.mf4", {"pitch": {"formula": text}, "speed": {"a": 1.0, "b": 0.0}})
    with pytest.raises(DataError, match=r"a\.mf4: channel 'pitch', formula of its conversion"):
        read_table(path, ["pitch"])
    assert not mark.exists()
    assert len(read_table(path, ["speed"]).columns["speed"]) == 50


def test_formulas_run_nothing_in_the_true_child_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording with a formula on its clock, and a bus log with one on the identifiers."""
    mark = tmp_path / "mark"
    text = f"""("'", (lambda: __import__("os").system("id > {mark}"))(), "'")"""
    path = mf4(tmp_path / "a.mf4", {"pitch": {"formula": text}})
    with pytest.raises(DataError, match="formula of its conversion"):
        read_table(path)
    finish, spoiled = Mf4Log._finish, []

    def spoil(log: Mf4Log) -> None:
        for channel in [c for group in log._mdf.groups for c in group.channels]:
            if channel.name.endswith((".ID", "t", "time", "timestamps")):
                channel.conversion = from_dict({"formula": text})
                spoiled.append(channel.name)
        finish(log)

    monkeypatch.setattr(Mf4Log, "_finish", spoil)
    Mf4Log(tmp_path / "bus.mf4").close()
    assert spoiled
    with pytest.raises(DataError, match="computed by a formula"):
        read_log(tmp_path / "bus.mf4")
    assert not mark.exists()


CONVERSIONS = {
    "none": {}, "line": {"a": -2.5, "b": 7.0}, "line 0": {"a": 0.0, "b": 7.0},
    "quotient": {"P1": 0.5, "P2": 1.0, "P3": 1.0, "P4": 0.25, "P5": 0.5, "P6": 3.0},
    "interpolated": {"raw_0": 0.0, "phys_0": 1.0, "raw_1": 9.5, "phys_1": -3.0, "raw_2": 30.0, "phys_2": 5.0,
                     "interpolation": True},
    "table": {"raw_0": 0.0, "phys_0": 1.0, "raw_1": 9.0, "phys_1": -3.0, "raw_2": 31.0, "phys_2": 5.0,
              "interpolation": False},
}  # fmt: skip
RANGES = {
    "lower_0": 0.0,
    "upper_0": 4.0,
    "phys_0": 1.0,
    "lower_1": 10.0,
    "upper_1": 12.0,
    "phys_1": 2.0,
    "default": -1.0,
}


@pytest.mark.usefixtures("forking")
def test_conversions_are_those_of_the_library(tmp_path: Path) -> None:
    """Raw values and our own arithmetic give what asammdf computes for every kind that holds no code."""
    path = mf4(tmp_path / "a.mf4", {**CONVERSIONS, "ranges": RANGES, "formula": {"formula": "2*X + sin(X1) - X**2"}})
    found = read_table(path).columns
    with MDF(path) as file:
        for name in CONVERSIONS:
            np.testing.assert_allclose(found[name], file.get(name).samples, rtol=1e-15, err_msg=name)
    raw = np.arange(50.0)
    # both ends are within a range of integers; asammdf takes what lies from the upper end on
    inside = np.where(raw <= 4, 1.0, np.where((raw >= 10) & (raw <= 12), 2.0, -1.0))
    np.testing.assert_array_equal(found["ranges"], inside)
    np.testing.assert_allclose(found["formula"], 2 * raw + np.sin(raw) - raw**2, rtol=1e-15)


def test_ranges_of_real_values_end_before_their_upper_bound_and_texts_are_no_numbers() -> None:
    block = {"lower_0": 0.0, "upper_0": 1.0, "phys_0": 5.0, "lower_1": 1.0, "upper_1": 2.0, "phys_1": 6.0}

    class Block(SimpleNamespace):
        def __getitem__(self, key: str) -> float:
            return block[key]

    ranges = Block(conversion_type=6, val_param_nr=7, default=-1.0)
    raw = np.array([-0.1, 0.0, 0.99, 1.0, 1.99, 2.0, np.nan])
    np.testing.assert_array_equal(convert("a", "b", ranges, raw, False), [-1, 5, 5, 6, 6, -1, np.nan])
    for kind, word in {7: "into text", 11: "into text", 99: "unknown kind 99"}.items():
        with pytest.raises(DataError, match=word):
            convert("a.mf4", "b", Block(conversion_type=kind), raw, False)
    with pytest.raises(DataError, match="without entries"):
        convert("a.mf4", "b", Block(conversion_type=4, val_param_nr=0), raw, False)


def blf(path: Path, version: int, size: int) -> Path:
    """Write a BLF whose one container begins with an object that says it is `size` bytes long."""
    message = struct.pack("<4sHHLL", b"LOBJ", 32, version, size, 1) + struct.pack("<LHHQ", 2, 0, 0, 1000)
    message += struct.pack("<HBBL8s", 1, 0, 8, 0x123, b"12345678")
    packed = zlib.compress(message * 3)
    dates = [2024, 1, 1, 1, 0, 0, 0, 0] * 2
    head = struct.pack("<4sLBBBBBBBBQQLL16H72x", b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, 400, 400, 2, 2, *dates)
    body = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(packed), 10) + struct.pack("<H6xL4x", 2, len(message) * 3)
    path.write_bytes(head + body + packed + bytes(len(packed) % 4))
    return path


@pytest.mark.parametrize(("version", "words"), [(7, "4 s of processor time"), (1, "go in a circle")])
def test_a_log_that_goes_in_a_circle_ends_and_is_quiet(
    version: int, words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An object of no length: with a warning each time, or with the same frame for ever."""
    sound = open_log(str(blf(tmp_path / "sound.blf", 1, 48)))
    assert len(sound.read(0.0)) == 3
    sound.close()
    monkeypatch.setattr(bounds, "_FRAMES_S", (3, 10))
    with pytest.raises(DataError, match=words):
        read_log(blf(tmp_path / "round.blf", version, 0))
    assert capfd.readouterr() == ("", "")


def bombs(folder: Path) -> dict[str, Path]:
    """Write small files that unpack into 4 MiB of samples."""
    count = 1 << 19
    zeros = np.zeros(count)
    with zipfile.ZipFile(folder / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        head = np.lib.format.magic(1, 0) + struct.pack("<H", 118)
        text = f"{{'descr': '|u1', 'fortran_order': False, 'shape': ({8 * count},), }}"
        archive.writestr("pitch.npy", head + text.ljust(117).encode() + b"\n" + bytes(8 * count))
    write_table(folder / "a.parquet", {"time_s": zeros, "pitch": zeros})
    with gzip.open(folder / "a.csv.gz", "wb", 1) as packed:
        packed.write(b"time_s,pitch\n" + b"0,1\n" * (2 * count))
    flags = struct.pack("<IIIIIIii", 6, 8, 9, 0, 5, 8, 8 * count, 1) + struct.pack("<II", 1, 5) + b"pitch\0\0\0"
    body = flags + struct.pack("<II", 2, 8 * count) + bytes(8 * count)
    element = zlib.compress(struct.pack("<II", 14, len(body)) + body, 1)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    (folder / "a.mat").write_bytes(head + struct.pack("<II", 15, len(element)) + element)
    with MDF(version="4.10") as file:
        file.append([Signal(zeros, np.arange(count) * 0.1, name="pitch")])
        file.save(folder / "a.mf4", compression=2, overwrite=True)
    return {path.name: path for path in folder.iterdir()}


@pytest.mark.usefixtures("forking")
def test_what_unpacks_beyond_its_bound_is_refused_before_memory_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounds, "FLOOR", 1 << 18)
    monkeypatch.setattr(bounds, "FACTOR", 2)
    files = bombs(tmp_path)
    assert len(files) == 5
    for name, path in files.items():
        assert path.stat().st_size < 1 << 20
        with pytest.raises(DataError, match=rf"{re.escape(name)}: it unpacks into .* MiB"):
            read_table(path, ["pitch"])


def test_the_bounds_are_as_stated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(bytes(1 << 20))
    assert bounds.content_limit(path) == (128 + 32) << 20
    assert bounds.reading_limits(path).memory == (384 + 2 * 160) << 20
    assert (bounds.reading_limits(path).cpu_s, bounds.log_limits(path).cpu_s) == (53, 50)
    monkeypatch.setattr(bounds, "memory_limit", lambda: 5 << 20)
    assert bounds.content_limit(path) == 5 << 20 and bounds.reading_limits(path).memory == (384 + 5) << 20


CLAIMS = {
    "long heading": ("a.csv", b"time_s," + b"_" * 100_000 + b"x\n0,1\n", "100001 characters"),
    "long cell": ("a.csv", b"time_s,pitch\n0,1\n1," + b"z" * 300_000 + b"\n", "limit"),
    "quoted rest": ("a.csv", b'time_s,pitch\n0,"' + b"1\n" * 200_000, r"line 2\): a quotation mark"),
    "many columns": ("a.csv", b"," * 70_000 + b"\n0,1\n", "70001 channels"),
    "long line": ("a.out", b"1" * (3 << 20), "line 1 is longer than 1 MiB"),
    "long row": ("a.out", b"\n" * 6 + b"Time pitch\n(s) (deg)\n" + b"1" * (3 << 20), "line 9 is longer than 1 MiB"),
    "packed": ("a.out", gzip.compress(b"Time"), "packed by gzip"),
    "description": ("a.outb", struct.pack("<hiiddi", 3, 1, 1, 0, 0.1, 2**31 - 1) + bytes(200), "is impossible"),
    "rows": ("a.outb", struct.pack("<hii", 2, 2**31 - 1, 2**31 - 1) + bytes(200), "too short"),
    "name length": ("a.outb", struct.pack("<hhii", 4, -1, 1, 1) + bytes(300), "unknown head"),
    "channels": ("a.outb", struct.pack("<hiidd", 3, 2**31 - 1, 0, 0, 0) + bytes(300), "too short"),
    "version 3": ("a.mf4", b"MDF     3.30    " + bytes(300), "save it as version 4"),
}  # fmt: skip


@pytest.mark.parametrize("case", CLAIMS)
def test_what_a_file_claims_is_no_measure_of_memory(case: str, tmp_path: Path) -> None:
    name, content, words = CLAIMS[case]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=words) as caught:
        read_table(tmp_path / name)
    assert len(str(caught.value)) < 500 and name in str(caught.value)


HEADERS = {
    "more than there is": ("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", "does not hold"),
    "less than none": ("{'descr': '<f8', 'fortran_order': False, 'shape': (-5,), }", "does not hold"),
    "nothing, often": ("{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }", "does not hold"),
    "objects": ("{'descr': '|O', 'fortran_order': False, 'shape': (3,), }", "neither numbers nor text"),
    "no dictionary": ("__import__('os').abort()", "not readable"),
    "depth": ("(" * 5000, "not readable"),
    "columns": ("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 1000000000), }", "1000000000 columns"),
    "axes": ("{'descr': '<f8', 'fortran_order': False, 'shape': (0,)*99, }", "not readable"),
}  # fmt: skip


@pytest.mark.parametrize("case", HEADERS)
def test_an_archive_is_checked_before_memory_is_taken(case: str, tmp_path: Path) -> None:
    text, words = HEADERS[case]
    head = text.encode() + b"\n"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("pitch.npy", np.lib.format.magic(1, 0) + struct.pack("<H", len(head)) + head + bytes(64))
    with pytest.raises(DataError, match=rf"a\.npz: .*{words}"):
        read_table(tmp_path / "a.npz")


def test_an_array_that_stands_in_an_archive_twice_is_refused(tmp_path: Path) -> None:
    """Which of the two was meant cannot be known."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # zipfile says so as well
        for value in (1.0, 2.0):
            with archive.open("pitch.npy", "w") as member:
                np.lib.format.write_array(member, np.full(5, value))
    with pytest.raises(DataError, match=r"a\.npz: pitch\.npy stands in it twice"):
        read_table(tmp_path / "a.npz")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_only_regular_files_are_recordings(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe without a writer would wait for ever, a device never end."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo(f"pipe{suffix}")
    os.mkdir(f"folder{suffix}")
    os.symlink("/dev/zero", f"device{suffix}")
    socket.socket(socket.AF_UNIX).bind(f"socket{suffix}")
    for kind in ("pipe", "folder", "device", "socket"):
        with pytest.raises(DataError, match=f"{kind}{suffix}: a {kind}"):
            read_record(f"{kind}{suffix}", ROLES)
        if suffix in (".blf", ".asc", ".log", ".mf4", ".parquet"):
            with pytest.raises(DataError, match=f"{kind}{suffix}: a {kind}"):
                open_log(f"{kind}{suffix}")


@pytest.mark.usefixtures("forking")
def test_a_damaged_page_of_parquet_is_noticed(tmp_path: Path) -> None:
    """What this tool writes carries checksums; damage that unpacks into other numbers is refused all the same."""
    from pyarrow import parquet

    path = tmp_path / "a.parquet"
    values = np.random.default_rng(1).normal(size=5000)
    write_table(path, {"time_s": 0.1 * np.arange(5000), "pitch": values})
    place = parquet.ParquetFile(path).metadata.row_group(0).column(1)
    content = bytearray(path.read_bytes())
    content[place.dictionary_page_offset + place.total_compressed_size // 2] ^= 1
    path.write_bytes(content)
    assert not np.array_equal(parquet.read_table(path)["pitch"].to_numpy(), values)  # pyarrow alone takes it
    with pytest.raises(DataError, match="page integrity"):
        read_table(path, ["pitch"])


@pytest.mark.usefixtures("forking")
def test_a_text_that_stands_in_many_rows_is_kept_once(tmp_path: Path) -> None:
    """A dictionary of one megabyte of digits, 5,000 times: 5 GB where each row has its own."""
    import pyarrow as pa
    from pyarrow import parquet

    index = pa.array(np.zeros(5000, np.int32))
    for digits, name in ("1" * (1 << 20), "bomb"), ("1.5", "sound"):
        column = pa.DictionaryArray.from_arrays(index, pa.array([digits]))
        parquet.write_table(pa.table({"pitch": column}), tmp_path / f"{name}.parquet")
    assert set(read_table(tmp_path / "sound.parquet").columns["pitch"]) == {1.5}
    assert len(read_table(tmp_path / "bomb.parquet").columns["pitch"]) == 5000


_UNIT = re.compile(r"^(?P<name>.*?)[\s_]*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*$")


@settings(max_examples=400, deadline=None)
@given(st.text(alphabet="ab_ [](){}°/\t", max_size=14))
def test_headings_are_split_as_the_pattern_says(heading: str) -> None:
    """The pattern is the definition; it takes the square of the length, which a heading of 120 kB turns into hours."""
    match = _UNIT.match(heading)
    expected: tuple[str, str | None] = (heading.strip(), None)
    if match is not None and match["name"].strip():
        unit = match["square"] if match["square"] is not None else match["round"]
        expected = match["name"].strip(), unit.strip()
    assert split_heading(heading) == expected


def test_long_headings_take_no_time() -> None:
    for mark in ("_", " ", "(", "[", "[a]_", "_ "):
        text = "a" + mark * 300_000
        assert split_heading(text + "[deg]")[1] == "deg"
        split_heading(text + "x"), split_heading(text)
    names = tuple("a" * 90 + str(i) for i in range(60_000))
    with pytest.raises(DataError, match="no channel"):
        find_heading("a" * 4000, names, "a.csv")
    assert find_heading(names[-1], names, "a.csv") == names[-1]


SENT = {
    "names": {"asks": "wanted", "names": [1], "units": {}, "shapes": {"pitch": [-1]}},
    "units": {"asks": "wanted", "names": ["pitch"], "units": {"pitch": 1}, "shapes": {"pitch": "a"}},
    "nothing": {"asks": "wanted"},
    "lengths": {"asks": "wanted", "names": ["pitch"], "units": {}, "shapes": {"pitch": [3]}},
}


@pytest.mark.parametrize("case", SENT)
@pytest.mark.parametrize("suffix", [".mat", ".parquet", ".mf4", ".blf"])
def test_what_a_reader_that_was_taken_over_sends_is_not_believed(
    suffix: str, case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names that are none, columns that do not fit: a refusal like that of a damaged file."""

    class Running:
        def __enter__(self) -> Running:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def __iter__(self) -> Iterator[tuple[dict[str, object], dict[str, np.ndarray]]]:
            yield SENT[case], {}
            yield {"units": {}}, {"0": np.zeros((2, 2)), "1": np.zeros(3)}

        def answer(self, _: object) -> None:
            pass

        def close(self) -> None:
            pass

    for user in ("matlab", "parquet", "mdf"):
        monkeypatch.setattr(f"aeolid.formats.{user}.start", lambda *_: Running())
    monkeypatch.setattr("aeolid.can.logs.start", lambda *_: Running())
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"MDF     4.10    " + bytes(100))
    with pytest.raises(DataError, match=rf"a\{suffix}: .*nonsense"):
        read_table(path)
