"""Text tables as loggers and spreadsheets write them: line ends, decimal signs, bad cells."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pyarrow import csv

from aeolid.errors import DataError
from aeolid.formats import read_record
from aeolid.formats.spool import PART_SUFFIX, read_spool
from aeolid.formats.text import _arrow_reads, read_csv
from aeolid.record import Channel, Record, Roles

CHANNELS = (Channel("u", "", "input"), Channel("y", "", "output"))
COUNT = 20


def roles(**other: object) -> Roles:
    return Roles(CHANNELS, None, None, "roles.toml", **other)  # type: ignore[arg-type]


def read(folder: Path, text: str, **other: object) -> Record:
    (folder / "a.csv").write_bytes(text.encode())
    return read_record(folder / "a.csv", roles(**other))


def table(separator: str = ",", decimal: str = ".", note: str = "", step: float = 0.1) -> str:
    extra = [note] if note else []
    lines = [["time_s", "u", "y", *(["note"] if note else [])]]
    lines += [[f"{step * k:.10g}".replace(".", decimal), str(k), str(k * k), *extra] for k in range(COUNT)]
    return "\n".join(separator.join(cells) for cells in lines) + "\n"


@pytest.mark.parametrize("mark", ["\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029", "\r", "\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_no_sample_is_lost_below_a_comment(tmp_path: Path, mark: str, end: str) -> None:
    text = f"# made by logger{mark}# page 1{mark}\n{table()}".replace("\n", end)
    record = read(tmp_path, text)
    assert record.column("u").tolist() == list(range(COUNT))


@pytest.mark.parametrize("mark", ["\x0c", "\r"])
def test_a_bad_cell_below_a_comment_is_named(tmp_path: Path, mark: str) -> None:
    with pytest.raises(DataError, match=r"channel 'u', sample 4 .*'abc' is not a number"):
        read(tmp_path, f"# made by logger{mark}# page 1\n" + table().replace(",3,9", ",abc,9"))


@pytest.mark.parametrize(
    "text",
    [
        table(";", note="ok, fine"),
        table(";", note="12,5"),  # of a channel that is not wanted
        table(";", ","),
        table(";", ",", note="1.5"),
        table("\t", ","),
        "time_s;u;y\n" + "".join(f"2024-03-01 12:00:{k // 10:02d},{k % 10}00;{k}.0;{k * k}.0\n" for k in range(COUNT)),
        "sep=;\n" + table(";", ","),
        "SEP=,\r\n" + table(),
        "# logger\nsep=|\n" + table("|"),
    ],
)
def test_the_decimal_sign_is_that_of_the_wanted_numbers(tmp_path: Path, text: str) -> None:
    record = read(tmp_path, text)
    assert record.sample_time_s == 0.1
    np.testing.assert_array_equal(record.column("y"), np.arange(COUNT) ** 2.0)


def test_numbers_with_a_point_beside_some_with_a_comma_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="'1,234' is not a number"):
        read(tmp_path, table(";").replace(";3;9", ";1,234;9"))


def test_a_cell_of_blanks_is_a_missing_sample(tmp_path: Path) -> None:
    record = read(tmp_path, table().replace(",3,9", ",   ,9"))
    assert np.flatnonzero(np.isnan(record.column("u"))).tolist() == [3]


@pytest.mark.parametrize("cell", ["1_0", "\u0661", "0x1", "\u00a01", "1 000", "1e"])
def test_what_python_alone_takes_for_a_number_is_named(tmp_path: Path, cell: str) -> None:
    with pytest.raises(DataError, match=r"channel 'u', sample 4 .*is not a number"):
        read(tmp_path, table().replace(",3,9", f",{cell},9"))


def test_a_point_far_down_a_table_of_commas_is_named(tmp_path: Path) -> None:
    body = "".join(f"{k // 10},{k % 10};{'1.234' if k == 150 else k};{k}\n" for k in range(200))
    with pytest.raises(DataError, match=r"channel 'u', sample 151 \(line 152\): '1.234' is not a number"):
        read(tmp_path, "time_s;u;y\n" + body)


@given(st.text("0123456789.,+-eEinfNa_x() \u0661", min_size=1, max_size=6), st.sampled_from(".,"))
@example("Infinity", ".")
@example("nan(x)", ",")
def test_the_grammar_of_numbers_is_that_of_the_fast_reader(cell: str, decimal: str) -> None:
    text = f"a;b\n{cell};1\n".encode()
    convert = csv.ConvertOptions(column_types={"a": pa.float64()}, decimal_point=decimal, null_values=[])
    try:
        csv.read_csv(io.BytesIO(text), parse_options=csv.ParseOptions(delimiter=";"), convert_options=convert)
        read = True
    except pa.ArrowInvalid:
        read = False
    assert _arrow_reads(cell.strip(" \t"), decimal) == read


def packed(content: bytes) -> bytes:
    """Pack in two members, as tools that append do."""
    return gzip.compress(content[:20]) + gzip.compress(content[20:])


def given_to_arrow(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Return the list in which every stream is noted that Arrow is to read."""
    seen: list[object] = []

    def remember(source: object, *options: object) -> object:
        seen.append(source)
        return opened(source, *options)

    opened = csv.open_csv
    monkeypatch.setattr(csv, "open_csv", remember)
    return seen


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", f"a{PART_SUFFIX}"])
def test_arrow_reads_a_file_without_calling_python(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its thread reads ahead when a bad cell has ended the work already; a call into Python then aborts the process."""
    seen = given_to_arrow(monkeypatch)
    content = b"time_s,u,y\n0,1,2\n0.1,x,2\n0.2,1,2\n"
    (tmp_path / name).write_bytes(packed(content) if name.endswith(".gz") else content + b"0.3,1")
    with pytest.raises(DataError, match="sample 2"):
        read_csv(tmp_path / name, lambda names, _: names)
    assert isinstance(seen[0], pa.NativeFile)
    assert not isinstance(seen[0], pa.PythonFile)


def test_a_spool_is_read_without_calling_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = given_to_arrow(monkeypatch)
    (tmp_path / "spool").write_bytes(b"a,b\n1,2\n3,4\n")
    assert np.concatenate(list(read_spool(tmp_path / "spool", ["a", "b"]))).tolist() == [[1, 2], [3, 4]]
    assert not isinstance(seen[0], pa.PythonFile) and isinstance(seen[0], pa.NativeFile)


@pytest.mark.parametrize("behind", [b"", bytes(3), bytes(512)])
def test_zeros_behind_packed_data_are_passed_over(behind: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.csv.gz").write_bytes(packed(b"time_s,u\n0,1\n0.1,2\n0.2,3\n") + behind)
    assert read_csv(tmp_path / "a.csv.gz", lambda names, _: names).columns["u"].tolist() == [1, 2, 3]


DAMAGES: tuple[Callable[[bytes], bytes], ...] = (
    lambda raw: raw[:-3], lambda raw: raw + b"more", lambda raw: raw[:-8] + b"abcd" + raw[-4:],
)  # fmt: skip


@pytest.mark.parametrize("spoil", DAMAGES)
def test_damaged_packed_data_are_said_to_be_so(spoil: Callable[[bytes], bytes], tmp_path: Path) -> None:
    (tmp_path / "a.csv.gz").write_bytes(spoil(packed(b"time_s,u\n0,1\n0.1,2\n0.2,3\n")))
    with pytest.raises(DataError, match="gzip data are cut off or damaged"):
        read_csv(tmp_path / "a.csv.gz", lambda names, _: names)
