"""Lengths of time are read alike by every option that takes one."""

import math

import pytest

from aeolid.cli import reference
from aeolid.cli.common import read_resample
from aeolid.cli.main import main
from aeolid.durations import UNITS, read_duration
from aeolid.errors import UsageError
from aeolid.fleet.plan import parse_window
from aeolid.identify.choose_past import read_past

TAKE_TIMES = {
    ("design", "--duration"), ("design", "--clock"), ("design", "--sample-time"), ("design", "--start"),
    ("listen", "--for"), ("monitor", "--for"), ("listen", "--publish-every"), ("monitor", "--publish-every"),
    ("listen", "--poles-every"), ("monitor", "--poles-every"), ("node", "--snapshot-every"),
    ("challenge", "--timeout"), ("diagnose", "--time-limit"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("600", 600), ("600s", 600), ("10min", 600), ("1h", 3600), ("1.5 h", 5400), ("1d", 86400), ("50ms", 0.05),
     (".5", 0.5), ("1e3", 1000), (" 2 s ", 2), ("0", 0), ("1w", 604800), ("20us", 2e-5)],
)  # fmt: skip
def test_lengths_of_time(text, seconds):
    assert read_duration(text) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["", "s", "-5", "-5s", "10 m", "10m", "5M", "1h30", "nan", "inf", "1e400", "1e13", "ten", "1,5h", "٣s", "9" * 50],
)
def test_what_is_none(text):
    assert read_duration(text) is None


def test_a_unit_may_be_needed():
    assert read_duration("600", bare=False) is None and read_duration("600s", bare=False) == 600


@pytest.mark.parametrize("unit", UNITS)
def test_other_options_read_the_same(unit):
    text = f"3{unit}"
    assert read_past(text, 1.0) == max(round(3 * UNITS[unit]), 1)
    if UNITS[unit] >= 1:
        assert parse_window(text) == 3 * UNITS[unit]
    if 3 * UNITS[unit] < 1e6:
        assert math.isclose(read_resample(text), 3 * UNITS[unit])
    with pytest.raises(UsageError):
        read_resample("0s")


def test_every_option_of_a_time_says_so_and_takes_units(capsys):
    told = {c.name: c for c in reference.commands()}
    for command, option in TAKE_TIMES:
        assert main([command, option, "10x"]) == 2
        assert "length of time" in " ".join(capsys.readouterr().err.split()), (command, option)
        assert command in told


def test_an_excitation_of_ten_minutes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["example", "."]) == 0
    assert main(["identify", "monday.csv", "--roles", "roles.toml", "--past", "30", "--out", "model.json"]) == 0
    call = ["design", "model.json", "--bound", "pitch=1deg", "--signal", "prbs", "--clock", "500ms", "--out"]
    assert main([*call, "a.csv", "--duration", "60"]) == main([*call, "b.csv", "--duration", "1min"]) == 0
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
