"""Resampling mends rates, never a clock that is missing, repeats or goes backwards; `init` asks for it only then."""

from __future__ import annotations

from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from aeolid.begin.make import begin
from aeolid.begin.survey import survey
from aeolid.errors import DataError, OpenUnit
from aeolid.formats import read_record
from aeolid.record import Channel, Roles

CHANNELS = (Channel("pitch", "deg", "input"), Channel("Generator speed", "rpm", "output"))
STEP, COUNT = 0.1, 50
AT = STEP * np.arange(COUNT)
Cell = float | str


def roles(resample: float | str | None = None, **other: object) -> Roles:
    return Roles(CHANNELS, None, "time", "roles.toml", resample=resample, **other)  # type: ignore[arg-type]


def write(path: Path, times: list[Cell], pitch: list[Cell] | None = None, speed: list[Cell] | None = None) -> Path:
    pitch = [k % 5 for k in range(len(times))] if pitch is None else pitch
    speed = [1000 + k % 3 for k in range(len(times))] if speed is None else speed
    rows = [f"{t},{p},{s}" for t, p, s in zip(times, pitch, speed, strict=True)]
    path.write_text("\n".join(["time,pitch,Generator speed", *rows]) + "\n")
    return path


def winter_time() -> list[Cell]:
    """Return local dates every 10 s over 27 October 2024 in Europe, from 01:00 to 04:00: the hour from 02:00 twice."""
    begin = datetime(2024, 10, 27)
    return [str(begin + timedelta(hours=h, seconds=s)) for h in (1, 2, 2, 3) for s in range(0, 3600, 10)]


BROKEN: dict[str, tuple[list[Cell], tuple[str, ...]]] = {
    "winter time": (
        winter_time(),
        ("goes backwards at sample 721 (line 722)", "with their zone where summer time ends"),
    ),
    "joined": ([*AT, *AT], ("goes backwards at sample 51",)),
    "one behind": ([*AT[:20], AT[18] + 0.05, *AT[20:]], ("goes backwards at sample 21",)),
    "one twice": ([*AT[:20], AT[19], *AT[20:]], ("repeats at sample 21",)),
    "whole seconds": ([int(t) for t in AT], ("repeats at sample 2",)),
    "one missing": ([*AT[:20], "", *AT[21:]], ("time is missing at sample 21",)),
}


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.parametrize("resample", ["auto", 0.05, None])
def test_no_resampling_mends_a_clock_that_does_not_run(name: str, resample: float | str | None, tmp_path: Path) -> None:
    times, told = BROKEN[name]
    path = write(tmp_path / "a.csv", times)
    with pytest.raises(DataError) as caught:
        read_record(path, roles(resample))
    assert all(part in str(caught.value) for part in told)


@pytest.mark.parametrize("name", BROKEN)
def test_init_does_not_hide_a_clock_that_does_not_run(name: str, tmp_path: Path) -> None:
    """It says what is wrong, and what it writes is refused with the same words."""
    path = write(tmp_path / "a.csv", BROKEN[name][0])
    found = survey(path)
    assert found.resample is None
    assert any(word in " ".join(found.notes) for word in ("backwards", "repeats", "missing"))
    (tmp_path / "roles.toml").write_text(begin(path, None, tmp_path).files["roles.toml"])
    with pytest.raises(DataError, match=r"backwards|repeats|missing"):
        read_record(path, Roles.load(tmp_path / "roles.toml"))


def split(order: str) -> tuple[list[Cell], list[Cell], list[Cell]]:
    """Return rows that each hold one channel: side by side at the same instant, or one channel after the other."""
    rows: list[tuple[Cell, Cell, Cell]] = []
    pitch: list[tuple[Cell, Cell, Cell]] = [(f"{t:.1f}", f"{np.sin(t):.6f}", "") for t in AT]
    speed: list[tuple[Cell, Cell, Cell]] = [(f"{t:.1f}", "", f"{1000 + np.cos(t):.6f}") for t in AT]
    if order == "side by side":
        rows = [row for pair in zip(pitch, speed, strict=True) for row in pair]
    else:
        rows = [*pitch, *speed]
    return [r[0] for r in rows], [r[1] for r in rows], [r[2] for r in rows]


@pytest.mark.parametrize("order", ["side by side", "one after the other"])
def test_rows_of_several_channels_at_one_instant_are_several_rates(order: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", *split(order))
    found = survey(path)
    assert found.resample == "auto" and "different rates" in " ".join(found.notes)
    record = read_record(path, roles("auto"))
    assert record.sample_time_s == STEP and len(record) == COUNT
    np.testing.assert_allclose(record.values, np.column_stack([np.sin(AT), 1000 + np.cos(AT)]), atol=1e-6)


def test_a_channel_that_goes_back_is_found_among_several_rates(tmp_path: Path) -> None:
    times, pitch, speed = split("side by side")
    path = write(tmp_path / "a.csv", times + times, pitch + pitch, speed + speed)
    with pytest.raises(DataError, match=r"backwards at sample 101 \(line 102\) in channel 'pitch'"):
        read_record(path, roles("auto"))
    assert survey(path).resample is None


def test_an_uneven_clock_is_still_resampled_by_init(tmp_path: Path) -> None:
    times = np.cumsum(np.random.default_rng(3).uniform(0.05, 0.15, 60))
    found = survey(write(tmp_path / "a.csv", [f"{t:.4f}" for t in times]))
    assert found.resample == "auto" and "uneven" in found.notes[0]


def test_an_hour_without_samples_is_no_uneven_clock(tmp_path: Path) -> None:
    found = survey(write(tmp_path / "a.csv", [*AT, *(AT + 3600)]))
    assert found.resample is None and "more samples are missing than recorded" in found.notes[0]


def test_two_columns_of_time_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "time,timestamp,pitch,Generator speed\n" + "".join(f"{t:.1f},{t + 5:.1f},1,{t}\n" for t in AT)
    )
    with pytest.raises(DataError, match=r"2 columns may be the time, time, timestamp; set time = 'time'"):
        read_record(tmp_path / "a.csv", Roles(CHANNELS, None, None, "roles.toml"))
    assert read_record(tmp_path / "a.csv", Roles(CHANNELS, None, "timestamp", "roles.toml")).time_s[0] == 5.0
    ignored = (*CHANNELS, Channel("time", "s", "ignore"))
    assert read_record(tmp_path / "a.csv", Roles(ignored, None, None, "roles.toml")).time_s[0] == 5.0


DAY = 86400.0
ASKED = {  # first number, step, the step in seconds, its unit, what init makes of it
    "Excel, 10 minutes": (45000.5, 600 / DAY, 600.0, "d", None),
    "MATLAB, 10 minutes": (738000.5, 600 / DAY, 600.0, "d", None),
    "Excel, 1 minute": (45000.5, 60 / DAY, 60.0, "d", "d"),
    "Excel, 1 hour": (45000.5, 3600 / DAY, 3600.0, "d", None),
    "Excel, 10 Hz": (45000.5, 0.1 / DAY, 0.1, "d", "d"),
    "milliseconds after 27.8 h": (1e8, 100.0, 0.1, "ms", "ms"),
    "milliseconds after 12 days": (1.04e9, 100.0, 0.1, "ms", None),
    "microseconds at 1 kHz": (1e9, 1000.0, 1e-3, "us", None),
    "microseconds at 20 Hz": (1e9, 50000.0, 0.05, "us", None),
    "nanoseconds at 10 Hz": (1.1e15, 1e8, 0.1, "ns", None),
    "every 10 s since 1970": (1.7e9, 10.0, 10.0, "s", None),
}


@pytest.mark.parametrize("name", ASKED)
def test_a_unit_that_numbers_do_not_tell_is_asked_for(name: str, tmp_path: Path) -> None:
    first, step, seconds, unit, guessed = ASKED[name]
    path = write(tmp_path / "a.csv", [f"{first + step * k:.12f}" for k in range(COUNT)])
    with pytest.raises(OpenUnit, match="set time_unit"):
        read_record(path, roles())
    assert read_record(path, roles(time_unit=unit)).sample_time_s == pytest.approx(seconds, rel=1e-3)
    found = survey(path)
    assert found.time_unit == guessed and found.resample is None
    assert ("taken for" if guessed else "set time_unit") in found.notes[0]


@pytest.mark.parametrize("step", [0.1, 0.05, 0.04, 0.02, 0.01, 0.005, 0.5, 0.25])
def test_seconds_since_midnight_are_not_asked_about(step: float, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", [f"{43210.5 + step * k:.4f}" for k in range(COUNT)])
    record = read_record(path, roles())
    assert record.sample_time_s == step and record.begins is None


INSTANT = datetime(2024, 10, 27, 12, 30, 0)
COUNTED = {  # of one instant: since when, the seconds of a count, whether in UTC, a unit where it must be stated
    "FILETIME": (datetime(1601, 1, 1), 1e-7, "Z", None),
    ".NET": (datetime(1, 1, 1), 1e-7, "", None),
    "stated": (datetime(1601, 1, 1), 1e-7, "Z", "100ns"),
    "Excel": (datetime(1899, 12, 30), DAY, "", "d"),
    "1970": (datetime(1970, 1, 1), 1e-9, "Z", None),
}


@pytest.mark.parametrize("name", COUNTED)
def test_instants_that_numbers_count_from_are_those_of_the_calendar(name: str, tmp_path: Path) -> None:
    """The independent reference is Python's calendar."""
    since, second, zone, unit = COUNTED[name]
    whole = (INSTANT - since) / timedelta(microseconds=1) / 1e6
    exact = [f"{(INSTANT - since).days + (0.5 + 1800 / DAY) + t / DAY:.12f}" for t in AT] if second == DAY else [
        str((int(whole) * 10 + k) * round(STEP / second)) for k in range(COUNT)]  # fmt: skip
    record = read_record(write(tmp_path / "a.csv", exact), roles(time_unit=unit))
    assert record.sample_time_s == pytest.approx(STEP, rel=1e-4)
    assert record.begins is not None and record.begins.endswith("Z") == bool(zone)
    begins = datetime.fromisoformat(record.begins.removesuffix("Z"))
    assert abs((begins - INSTANT).total_seconds()) < 1e-4
    assert record.time_s[0] == pytest.approx((INSTANT - datetime(1970, 1, 1)).total_seconds(), abs=1e-4)


def test_labview_counts_are_no_dates_of_2090(tmp_path: Path) -> None:
    """Seconds since 1904, as LabVIEW writes them: a clock, no instant since 1970."""
    first = (INSTANT - datetime(1904, 1, 1)).total_seconds()
    record = read_record(write(tmp_path / "a.csv", [f"{first + t:.1f}" for t in AT]), roles())
    assert record.begins is None and record.sample_time_s == pytest.approx(STEP)
    assert all(b > a for a, b in pairwise(record.time_s))
