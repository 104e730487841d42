"""What others named acts on nothing: neither on a terminal, nor in a page, nor in a spreadsheet, nor on our reader."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.table import Table
from rich.text import Text

from aeolid.can.description import _names
from aeolid.cli.common import SafeConsole
from aeolid.cli.main import main
from aeolid.display import is_unseen, sentence, token, visible, visible_lines, without_quotes
from aeolid.errors import DataError
from aeolid.formats import read_record, read_table, write_table
from aeolid.formats.headings import bare_heading, fault_of_name, harmless_name, heading_line
from aeolid.models.model_file import read_signals
from aeolid.record import Channel, Roles
from aeolid.report.charts import sketch
from aeolid.report.markup import table, tag, write_page

EVIL = ["\x1b[2J", "\x1b]0;owned\x07", "\x9b31m", "\u202egpj.exe", "\u2066x\u2069", "a\u200bb", "\ufeffx", "\r", "\x08",
        "\x00", "\x7f", "\u2028", "\u061c", "\U000e0041", "\udcff"]  # fmt: skip


@pytest.mark.parametrize("evil", EVIL, ids=ascii)
def test_unseen_characters_are_written_out(evil: str) -> None:
    for shown in (visible(f"a{evil}b"), visible_lines(f"a{evil}b\n"), sentence(evil), token(evil * 100)):
        assert not any(is_unseen(c) for c in shown.replace("\n", ""))
        shown.encode("utf-8")
    assert visible("Größe ω₁ 風速 m/s²") == "Größe ω₁ 風速 m/s²"


@pytest.mark.parametrize("evil", EVIL, ids=ascii)
def test_the_terminal_gets_only_styles_of_ours(evil: str) -> None:
    """Whatever is printed: text, markup, tables; the styles of our own stay."""
    screen = io.StringIO()
    console = SafeConsole(file=screen, force_terminal=True, color_system="standard", width=200, highlight=False)
    rows = Table(evil)
    rows.add_row(Text(evil))
    for thing in (f"x{evil}x", Text(evil), rows):
        console.print(thing, markup=False)
    console.print(f"[bold]name[/bold] {evil}", soft_wrap=True)
    ours = screen.getvalue().replace("\x1b[1mname\x1b[0m", "").replace("\x1b[1m", "").replace("\x1b[0m", "")
    assert not any(is_unseen(c) for c in ours.replace("\n", ""))
    assert "\x1b[1mname" in screen.getvalue()


def test_pages_hold_nothing_unseen(tmp_path: Path) -> None:
    with sketch((4, 3)) as drawing:
        axes = drawing.axes[0, 0]
        for evil in EVIL:
            axes.plot([0, 1], [0, 1], label=f"$\\frac{evil}$")  # no formula either: Matplotlib would fail on this one
        axes.legend()
        axes.set_title("\x1b[31m$^$")
    write_page(
        tmp_path / "p.html", "".join(EVIL), tag("p", *EVIL, title="\u202e"), table(["\x1b"], [EVIL[:1]]), drawing.svg
    )
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert not any(is_unseen(c) for c in page.replace("\n", "").replace("\t", ""))
    assert r"\x1b[2J" in page and r"\u202egpj.exe" in page


FORMULAS = ["=1+1", "+a", "-b", "@SUM", "＝x", "'=1", "''@x", "'plain", "a=b", 'say "x"', "a,b", "x;y;z", "a\\b"]


def test_headings_are_no_formulas_and_read_back(tmp_path: Path) -> None:
    """As written by every writer of tables, and by the reader of recordings again, bit for bit."""
    columns = {"time_s": np.arange(4.0)} | {name: np.arange(4.0) + k for k, name in enumerate(FORMULAS)}
    for suffix in (".csv", ".csv.gz", ".parquet"):
        write_table(tmp_path / f"t{suffix}", columns)
        found = read_table(tmp_path / f"t{suffix}")
        assert found.names == tuple(columns)
        assert all((found.columns[name] == values).all() for name, values in columns.items())
    cells = heading_line(FORMULAS).split(",")
    assert not any(c.strip('"')[:1] in "=+-@＝" for c in cells)
    assert [bare_heading(c) for c in ("'=1", "''=1", "'plain", "=x")] == ["=1", "'=1", "'plain", "=x"]
    channels = tuple(Channel(name, "m", "input") for name in FORMULAS)
    record = read_record(tmp_path / "t.csv", Roles(channels, None, "time_s", "roles"))
    assert record.names("input") == tuple(FORMULAS)


@pytest.mark.parametrize("name", ["speed [x]", "speed (rpm)", " a", "b ", "", "a\nb", "a\x1b[2J", "a\u202eb"])
def test_names_that_are_not_found_again_are_not_written(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="not written"):
        write_table(tmp_path / "t.csv", {"time_s": np.zeros(2), name: np.zeros(2)}, {name: "m"})
    assert list(tmp_path.iterdir()) == []
    write_table(tmp_path / "ok.csv", {"time_s": np.zeros(2), "a (rpm)": np.zeros(2)}, {"a (rpm)": "rpm"})


@pytest.mark.parametrize("name", ["speed [x]", "a\x1b[2J", "a\u202eb", " a"])
def test_roles_refuse_such_names(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a sentence in which they do nothing."""
    (tmp_path / "r.csv").write_text("time_s,u,y\n" + "".join(f"{k},0,1\n" for k in range(40)))
    roles = "".join(
        f'[[channel]]\nname = {json.dumps(n)}\ncolumn = "{c}"\nunit = "m"\nrole = "{r}"\n'
        for n, c, r in (("u", "u", "input"), (name, "y", "output"))
    )
    (tmp_path / "roles.toml").write_text(roles)
    words = ["identify", str(tmp_path / "r.csv"), "--roles", str(tmp_path / "roles.toml"), "--past", "3"]
    assert main([*words, "--out", str(tmp_path / "m.json")]) == 3
    said = capsys.readouterr().err
    assert "roles.toml" in said and "the name" in said and not any(is_unseen(c) for c in said.replace("\n", ""))


def test_models_refuse_such_names() -> None:
    for entry in ("a\nb", {"name": "a", "unit": "\u202em"}, {"name": "\x1b[2J"}):
        with pytest.raises(DataError, match="control character"):
            read_signals([entry], "outputs", "m.json")
    assert read_signals(["ω [rad/s]"], "outputs", "m.json")[0].name == "ω [rad/s]"


def test_names_from_the_bus_fit_every_file(tmp_path: Path) -> None:
    """A device may call its channels anything; what is written is found again by the reader."""
    given = ["=cmd", "name [x]", "name [x]", "tower (fa) ", "", "time_s", "3.5", "a,b", 'q"', "ok", "[m]", "x [m]"]
    names = _names(given, ["m"] * len(given), 3, 4)
    assert names[0] == "=cmd" and names[1] == r"name \x5bx\x5d" and names[9] == "ok" and names[11] == "x [m]"
    assert len(set(names)) == len(names) and not any(fault_of_name(n, "m") for n in names)
    columns = {"time_s": np.arange(3.0)} | {n: np.arange(3.0) for n in names}
    write_table(tmp_path / "t.csv", columns, dict.fromkeys(names, "m"))
    roles = Roles(tuple(Channel(n, "m", "output") for n in names), None, "time_s", "roles")
    assert read_record(tmp_path / "t.csv", roles).names("output") == names
    assert harmless_name("\x1b[1m", "") == r"\x1b[1m"


def test_messages_are_one_bounded_line() -> None:
    long = sentence("a\nb" * 10_000)
    assert len(long) < 2100 and "\n" not in long and "…" in long
    told = "magic b'root:x:0:0' is \"secret\", it's not 'shadow"
    assert all(word not in without_quotes(told) for word in ("root", "secret", "shadow")) and "it's" in without_quotes(
        told
    )


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("r.csv", b"root:$6$secretsalt:19000:0\nmore:secretline:1\n"),
        ("r.csv", b"time_s,u,y\n0,1,2\nsecretrow\n"),
        ("r.csv", b"time_s,u,y\n" + b"0,1,2\n" * 5 + b'0,"secretrow\n'),
        ("r.npz", b"secretcontent"),
        ("r.parquet", b"secretcontent" * 9),
        ("r.out", b"secretcontent\n" * 9),
        ("r.log", b"(1.0) can0 secretcontent\n" * 9),
        ("r.asc", b"secretcontent\n" * 9),
        ("r.outb", b"secretcontent" * 9),
    ],
)
def test_content_is_not_shown(file: str, content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sentence about a file that is no recording says nothing of what stands in it."""
    (tmp_path / file).write_bytes(content)
    (tmp_path / "roles.toml").write_text(
        '[[channel]]\nname = "u"\nunit = ""\nrole = "input"\n[[channel]]\nname = "y"\nunit = ""\nrole = "output"\n'
    )
    words = ["identify", str(tmp_path / file), "--roles", str(tmp_path / "roles.toml"), "--past", "3"]
    assert main([*words, "--out", str(tmp_path / "m.json")]) == 3
    said = capsys.readouterr().err
    assert file in said and "secret" not in said
    assert main(["identify", *words[1:3], str(tmp_path / file), *words[4:], "--out", str(tmp_path / "m.json")]) == 3
    assert "secret" not in capsys.readouterr().err
