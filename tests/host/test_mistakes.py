"""Each mistake a newcomer makes, and the sentence it ends in: the page docs/howto/mistakes.md is made of them.

python tests/host/test_mistakes.py        writes the page anew; read the difference before it is kept
"""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "mistakes.md"
HEAD = """# Mistakes and what is said of them

Every command ends in one sentence that names the file, the channel and the remedy; the exit code is 2 for wrong
usage and 3 for data. This page is written by a test, which makes each mistake.

| mistake | command | what is said |
|---|---|---|
"""
ROLES = (
    '[recording]\ntime = "{time}"\n{more}[[channel]]\nname = "pitch"\nunit = "{unit}"\nrole = "input"\n'
    '[[channel]]\nname = "speed"\nunit = "rpm"\nrole = "output"\n'
)
IDENTIFY = "aeolid identify a.csv --roles roles.toml --out model.json"
CASE = (
    '[case]\n[recordings]\nfiles = ["a.csv"]\nroles = "roles.toml"\n[baseline]\nkind = "state_space"\n'
    'file = "model.json"\n[context]\n{context}\n'
)


def table(heading: str, cells: Callable[[int], str], rows: int = 30, names: str = "pitch,speed") -> None:
    lines = [f"{heading},{names}"] + [f"{cells(k)},{k % 5},{1000 + k % 7}" for k in range(rows)]
    Path("a.csv").write_text("\n".join(lines) + "\n")


def roles(unit: str = "deg", time: str = "time_s", more: str = "") -> None:
    Path("roles.toml").write_text(ROLES.format(unit=unit, time=time, more=more))


def seconds(k: int) -> str:
    return f"{0.1 * k:.1f}"


def unit_words() -> None:
    table("time_s", seconds)
    roles("degrees")


def unit_differs() -> None:
    table("time_s", seconds, names="pitch [rad],speed")
    roles()


def milliseconds() -> None:
    table("Time", lambda k: str(50 * k))
    roles(time="Time")


def ten_times() -> None:
    table("time_s", seconds)
    roles(more="sample_time_s = 0.01\n")


def american_dates() -> None:
    table("stamp", lambda k: f"03/01/2024 12:00:{k:02d}")
    roles(time="stamp")


def mixed_zones() -> None:
    table("stamp", lambda k: f"2024-03-01T12:00:{k:02d}{'Z' if k < 9 else ''}")
    roles(time="stamp")


def summer_time() -> None:
    table("stamp", lambda k: f"2024-10-27 0{3 - (k >= 15)}:00:{k:02d}")
    roles(time="stamp")


def uneven() -> None:
    table("time_s", lambda k: f"{0.1 * k + 0.03 * (k % 2):.2f}")
    roles()


def two_rates() -> None:
    from asammdf import MDF, Signal

    fast, slow = 0.1 * np.arange(50), 0.5 * np.arange(10)
    with MDF(version="4.10") as file:
        file.append([Signal(np.sin(fast), fast, name="pitch", unit="deg")])
        file.append([Signal(np.cos(slow), slow, name="speed", unit="rpm")])
        file.save("a.mf4", overwrite=True)
    roles()


def unknown_name() -> None:
    table("time_s", seconds, names="Pitch1,speed")
    roles()


def in_rpm() -> None:
    azimuth = '[[channel]]\nname = "azimuth"\nunit = "deg"\nrole = "azimuth"\n'
    lines = ["time_s,pitch,speed,azimuth"] + [f"{seconds(k)},{k % 5},1000,{7.26 * k % 360:.2f}" for k in range(60)]
    Path("a.csv").write_text("\n".join(lines) + "\n")
    roles()
    Path("roles.toml").write_text(Path("roles.toml").read_text() + azimuth)
    Path("case.toml").write_text(CASE.format(context="rated_speed_rad_s = 12.1"))


def context_word() -> None:
    in_rpm()
    Path("case.toml").write_text(CASE.format(context='blades = "three"'))


def thirty_blades() -> None:
    in_rpm()
    Path("case.toml").write_text(CASE.format(context="blades = 30"))


def cut() -> None:
    again()
    Path("a.csv").write_text(Path("a.csv").read_text()[:-6])


def no_model() -> None:
    in_rpm()
    Path("case.toml").write_text(CASE.format(context=""))


def again() -> None:
    table("time_s", seconds)
    roles()


def workbook() -> None:
    Path("a.doc").write_text("x")
    roles()


def nothing() -> None:
    """Leave the folder empty."""


MISTAKES: tuple[tuple[str, Callable[[], None], str], ...] = (
    ("a unit spelt out", unit_words, IDENTIFY),
    ("another unit in the file than in the roles", unit_differs, IDENTIFY),
    ("time in milliseconds under a heading that does not say so", milliseconds, IDENTIFY),
    ("`sample_time_s` ten times too small", ten_times, IDENTIFY),
    ("dates in a form that can mean two days", american_dates, IDENTIFY),
    ("a time zone in some dates only", mixed_zones, IDENTIFY),
    ("the hour that winter time repeats", summer_time, IDENTIFY),
    ("an uneven clock", uneven, IDENTIFY),
    ("channels of two rates", two_rates, "aeolid identify a.mf4 --roles roles.toml --out model.json"),
    ("a heading with another name", unknown_name, IDENTIFY),
    ("no roles file named", again, "aeolid identify a.csv --out model.json"),
    ("a row that is cut off", cut, IDENTIFY),
    ("a window that is no time", again, f"{IDENTIFY} --past 3x"),
    ("a resampling that is no time", again, f"{IDENTIFY} --resample fast"),
    ("a rated speed in rpm", in_rpm, "aeolid check ."),
    ("a number of blades in words", context_word, "aeolid check ."),
    ("a rotor of 30 blades", thirty_blades, "aeolid check ."),
    ("a case whose model is not there yet", no_model, "aeolid check ."),
    ("no case at all", nothing, "aeolid diagnose . --out diagnosis"),
    ("`init` where roles exist already", again, "aeolid init a.csv"),
    ("a file of no known format", workbook, "aeolid identify a.doc --roles roles.toml --out model.json"),
    ("a recording given as a bus", nothing, "aeolid listen --bus a.csv"),
    ("a log in a folder that does not exist", nothing, "aeolid listen --bus virtual:x --record no/bus.csv"),
    ("an address that is none", nothing, "aeolid monitor --bus virtual:x --publish mqtt:/x"),
    (
        "an output in a folder that does not exist",
        again,
        "aeolid identify a.csv --roles roles.toml --out no/model.json",
    ),
)


def said(make: Callable[[], None], command: str) -> tuple[int, str]:
    """Make a mistake in the current folder; returns the exit code and the sentence."""
    make()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as told:
        code = main(shlex.split(command)[1:])
    lines = [line.removeprefix("aeolid: ") for line in told.getvalue().splitlines() if line.startswith("aeolid: ")]
    return code, " ".join(lines)


def page(folder: Path) -> str:
    """Make every mistake, each in a folder of its own; returns the page."""
    rows = []
    for number, (words, make, command) in enumerate(MISTAKES):
        place = folder / str(number)
        place.mkdir()
        with contextlib.chdir(place):
            code, sentence = said(make, command)
        assert code in (2, 3), (command, code, sentence)
        rows.append(f"| {words} | `{command}` | {sentence.replace('|', chr(92) + '|')} |\n")
    return HEAD + "".join(rows)


def test_every_mistake_ends_in_the_sentence_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert page(tmp_path) == PAGE.read_text(encoding="utf-8")


if __name__ == "__main__":
    os.environ["COLUMNS"] = "200"
    with tempfile.TemporaryDirectory() as made:
        PAGE.write_text(page(Path(made)), encoding="utf-8")
