"""Rows and lines of a text table: a quotation mark left open, empty lines, commas between tabs, a missing date."""

from __future__ import annotations

import csv
import gzip
import logging
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from aeolid.errors import DataError
from aeolid.formats import lines, read_record, read_table, text
from aeolid.record import Channel, Record, Roles

CHANNELS = (Channel("u", "", "input"), Channel("y", "", "output"))
ENDS = re.compile("\r\n|\r|\n")
COUNT = 40


def read(path: Path, content: str, step: float | None = None, time: str | None = None, **how: object) -> Record:
    data = content.encode(str(how.get("encoding", "utf-8")))
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return read_record(path, Roles(CHANNELS, step, time, "roles.toml"))


def noted(notes: dict[int, str], time: bool = True, rows: int = COUNT) -> str:
    """Return a table with an unused column of texts, some of which are given by sample."""
    heads = ["time_s"] * time + ["alarm", "u", "y"]
    body = [[*([f"{k / 10:g}"] if time else []), notes.get(k + 1, "none"), str(k), str(k * k)] for k in range(rows)]
    return "".join(",".join(row) + "\n" for row in [heads, *body])


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@pytest.mark.parametrize("time", [True, False], ids=["clock", "no clock"])
@pytest.mark.parametrize(
    ("notes", "line"),
    [({11: '"hose 5 in'}, 12), ({11: '"hose 5 in', 31: '"hose 6 in'}, 12), ({11: '"a ""b""', 12: 'c"'}, 12)],
    ids=["to the end", "to another", "of two lines"],
)
def test_a_cell_that_goes_over_its_line_is_refused(
    notes: dict[int, str], line: int, time: bool, name: str, tmp_path: Path
) -> None:
    """Read to the next mark, it would take the samples between with it, and those after it would come too early."""
    with pytest.raises(DataError, match=rf"sample {line - 1} \(line {line}\): a quotation mark begins a cell"):
        read(tmp_path / name, noted(notes, time), None if time else 0.1)


@pytest.mark.parametrize("note", ['5" hose', '"a, b"', '"say ""stop"""', 'a"b"c', '"a"b', '""', '"', ' "a b'])
def test_marks_within_one_line_do_no_harm(note: str, tmp_path: Path) -> None:
    """In the last row a mark left open has no row to take along."""
    where = COUNT if note == '"' else 11
    content = noted({where: note})
    if note == '"':
        content = "\n".join(",".join([c[0], c[2], c[3], c[1]]) for c in (r.split(",") for r in content.split()))
    record = read(tmp_path / "a.csv", content)
    assert record.column("u").tolist() == list(range(COUNT))


NOTES = st.lists(st.text('a",; ', max_size=6), min_size=1, max_size=25)


@pytest.mark.parametrize("block", [200, 1 << 22])
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=150)
@given(notes=NOTES, end=st.sampled_from(["\n", "\r\n", "\r"]))
@example(notes=['"a'] * 25, end="\n")
def test_every_sample_is_read_or_a_line_is_named(
    block: int, notes: list[str], end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The grammar of the cells is Python's here, one line at a time; every second row is written as Python writes it.

    A mark left open in the last row of a block takes none along, so with small blocks it may be read.
    """
    monkeypatch.setattr(text, "_BLOCK", block)
    monkeypatch.setattr(lines, "_BLOCK", block)
    rows = [f"{k},{n}" if k % 2 else f'{k},"{n.replace(chr(34), chr(34) * 2)}"' for k, n in enumerate(notes)]
    bad = []
    for k, row in enumerate(rows):
        reader = csv.reader([row, ""])
        if len(next(reader)) != 2 or (reader.line_num > 1 and k + 1 < len(rows)):
            bad.append(f"(line {k + 2})")
    (tmp_path / "a.csv").write_bytes(end.join(["u,note", *rows]).encode())
    try:
        assert read_table(tmp_path / "a.csv", ["u"]).columns["u"].tolist() == list(range(len(rows)))
        assert not bad or block == 200
    except DataError as error:
        assert bad and bad[0] in str(error)


PARTS = st.lists(st.sampled_from(["row", "empty"]), min_size=1, max_size=30)


@pytest.mark.parametrize("kind", ["csv", "units", "out"])
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(parts=PARTS, ends=st.lists(st.sampled_from(["\n", "\r\n", "\r"]), min_size=40, max_size=40))
def test_the_line_of_a_cell_is_the_one_an_editor_shows(
    kind: str, parts: list[str], ends: list[str], tmp_path: Path
) -> None:
    """Empty lines hold no sample, and they count as lines: above a cell, a step of time, between headings and units."""
    path = tmp_path / ("a.out" if kind == "out" else "a.csv")
    gap = "\t" if kind == "out" else ","
    head = {"csv": ["# logger", "Time,u"], "units": ["Time,u", "", "s,V"], "out": ["a", "b", "Time u", "(s) (V)"]}[kind]
    count = 0
    body = []
    for part in [*parts, "row"]:
        body.append(f"{0.1 * count:.1f}{gap}{count}" if part == "row" else "")
        count += part == "row"
    body += ["", f"{0.1 * count:.1f}{gap}bad"]
    ends = ["\n"] * 40 if kind == "out" else ends
    content = "".join(a + b for a, b in zip([*head, *body], ends, strict=False))
    path.write_bytes(content.encode())
    line = next(k for k, row in enumerate(ENDS.split(content), 1) if row.endswith("bad"))
    with pytest.raises(DataError, match=rf"sample {count + 1} \(line {line}\)"):
        read_table(path, ["u"])
    back = content.replace(f"{gap}bad", f"{gap}7").replace(f"{0.1 * count:.1f}{gap}7", f"-1{gap}7")
    path.write_bytes(back.encode())
    with pytest.raises(DataError, match=rf"time goes backwards at sample {count + 1} \(line {line}\)"):
        read_record(path, Roles(CHANNELS[:1], 0.1, "Time", "roles.toml"))


def test_the_line_of_a_date_and_of_a_gap_counts_empty_lines(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stamps = [f"2024-03-01 12:00:{k:02d}" for k in range(COUNT)]
    rows = [f"{s},{k},{k}" for k, s in enumerate(stamps)]
    broken = "\n\n".join(["time,u,y", *rows[:4], "2024-13-01 12:00:04,4,4", *rows[5:]])
    with pytest.raises(DataError, match=r"sample 5 \(line 11\): '2024-13-01 12:00:04' is no date"):
        read(tmp_path / "a.csv", broken)
    with caplog.at_level(logging.WARNING):
        read(tmp_path / "a.csv", "\n\n".join(["time,u,y", *rows[:4], *rows[6:]]))
    assert "the first before sample 5 (line 11)" in caplog.text


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [1, 2, 3, 7, 1 << 22])
def test_lines_are_counted_as_they_are_split(
    block: int, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "_BLOCK", block)
    monkeypatch.setattr(lines, "_PIECE", block)
    for content in ("", "a", "a#", "#", "##", "a##b#", "a##", "#a#\r\n\rb\n\n\r"):
        written = content.replace("#", end)
        (tmp_path / "a.csv").write_bytes(written.encode())
        split = ENDS.split(written)
        split = split[:-1] if split[-1] == "" else split
        assert lines.count_lines(tmp_path / "a.csv") == len(split)
        if max(map(len, split), default=0) + len(end) > block:
            continue
        filled, empty = lines.below(tmp_path / "a.csv", 0)
        assert filled == sum(map(bool, split))
        assert (int(empty[-1, 1]) if len(empty) else 0) == split.count("")
        assert [n for n, line in lines.numbered(tmp_path / "a.csv", 0) if line] == [
            k for k, line in enumerate(split, 1) if line
        ]


def tabs(cells: list[str], times: list[str] | None = None, separator: str = "\t") -> str:
    first = times or [str(k) for k in range(len(cells))]
    return (
        "\n".join(["time", *first])
        if not cells
        else "\n".join(
            [separator.join(["t", "u", "y"]), *(separator.join([t, c, "1"]) for t, c in zip(first, cells, strict=True))]
        )
    )


@pytest.mark.parametrize("separator", ["\t", "|"])
@pytest.mark.parametrize("cells", [["1,100", "1,101", "1,170"], ["900", "1,000", "1,100"], ["-12,345", "+1,000", ""]])
def test_a_comma_that_may_stand_between_thousands_is_refused(cells: list[str], separator: str, tmp_path: Path) -> None:
    stated = "sep=|\n" if separator == "|" else ""
    first = next(c for c in cells if "," in c)
    place = rf"sample {cells.index(first) + 1} \(line {cells.index(first) + 2 + bool(stated)}\)"
    either = re.escape(f"'{first}' may be {first.replace(',', '.')} or {first.replace(',', '')}; ")
    with pytest.raises(DataError, match=f"channel 'u', {place}: {either}"):
        read(tmp_path / "a.tsv", stated + tabs(cells, separator=separator), 1.0, "t")


@pytest.mark.parametrize(
    ("cells", "times"),
    [
        (["1,1", "1,101", "1,170"], None),  # not three digits
        (["0,100", "1,101", "1,170"], None),  # no number of thousands begins with 0
        (["1,100", "1,101", "1,170"], ["0,0", "0,1", "0,2"]),  # of another channel
        (["1100,500", "1,101", "1,170"], None),  # four digits before it
        (["1,100e0", "1,101", "1,170"], None),
    ],
)
def test_a_comma_that_cannot_stand_between_thousands_is_decimal(
    cells: list[str], times: list[str] | None, tmp_path: Path
) -> None:
    record = read(tmp_path / "a.tsv", tabs(cells, times), None if times else 1.0, "t")
    assert record.column("u").tolist() == [float(c.replace(",", ".")) for c in cells]


def test_between_semicolons_the_comma_is_the_decimal_sign(tmp_path: Path) -> None:
    record = read(tmp_path / "a.csv", tabs(["1,100", "1,101", "1,170"], separator=";"), 1.0, "t")
    assert record.column("u").tolist() == [1.1, 1.101, 1.17]
    with pytest.raises(DataError, match="'1,100,000' is not a number"):
        read(tmp_path / "a.csv", tabs(["1,100,000", "1,101", "1,170"], separator=";"), 1.0, "t")


@pytest.mark.parametrize("missing", [1, 3, 98])
def test_a_date_that_is_missing_at_first_is_a_missing_time(missing: int, tmp_path: Path) -> None:
    stamps = [f"2024-03-01 12:{k // 60:02d}:{k % 60:02d}" if k >= missing else "" for k in range(200)]
    content = "\n".join(["time,u,y", *(f"{s},{k},{k}" for k, s in enumerate(stamps))])
    with pytest.raises(DataError, match=rf"time is missing at sample 1 \(line 2\) \({missing} in all\)"):
        read(tmp_path / "a.csv", content)


def test_a_date_far_below_empty_cells_is_named(tmp_path: Path) -> None:
    stamps = ["" if k < 150 else f"2024-03-01 12:00:{k - 150:02d}" for k in range(200)]
    content = "\n".join(["time,u,y", *(f"{s},{k},{k}" for k, s in enumerate(stamps))])
    with pytest.raises(DataError, match=r"sample 151 \(line 152\): .* is a date, and every cell above is empty"):
        read(tmp_path / "a.csv", content)
    np.testing.assert_array_equal(read_table(tmp_path / "a.csv", ["u"]).columns["u"], np.arange(200))
