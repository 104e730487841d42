"""Time as people have it: dates, counts since 1970, milliseconds; and channels of different rates."""

from __future__ import annotations

import logging
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.formats import read_record
from aeolid.record import Channel, Roles

pytestmark = pytest.mark.usefixtures("forking_throughout")

CHANNELS = (Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"))
COUNT, STEP = 40, 0.05
AT = STEP * np.arange(COUNT)
BEGIN = datetime(2024, 3, 31, 1, 59, 59, 500000, tzinfo=UTC)  # an hour of summer time begins here in Europe


def roles(time: str | None = None, **other: object) -> Roles:
    return Roles(CHANNELS, other.pop("declared", None), time, "roles.toml", **other)  # type: ignore[arg-type]


def write(path: Path, heading: str, stamps: list[str]) -> Path:
    rows = [f"{s},{k % 5},{12 + k % 3}" for k, s in enumerate(stamps)]
    path.write_text("\n".join([f"{heading},pitch,speed", *rows]) + "\n")
    return path


def dates(form: str) -> list[str]:
    def one(t: float) -> str:
        moment = BEGIN + timedelta(seconds=float(t))
        if form == "offset":
            return moment.astimezone(timezone(timedelta(hours=5, minutes=30))).isoformat(timespec="milliseconds")
        if form == "dots":
            return moment.strftime("%d.%m.%Y %H:%M:%S,%f").replace(",", ".")
        if form == "Z":
            return moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        return moment.strftime("%Y/%m/%d %H:%M:%S.%f") if form == "slashes" else moment.strftime("%Y-%m-%d %H:%M:%S.%f")

    return [one(t) for t in AT]


@pytest.mark.parametrize("form", ["plain", "Z", "offset", "dots", "slashes"])
def test_dates_are_a_clock(tmp_path: Path, form: str) -> None:
    record = read_record(write(tmp_path / "a.csv", "Timestamp", dates(form)), roles())
    np.testing.assert_allclose(record.time_s, AT, atol=1e-9)
    assert record.sample_time_s == STEP
    assert record.begins == "2024-03-31T01:59:59.5" + ("Z" if form in ("Z", "offset") else "")
    assert record.column("pitch")[:6].tolist() == [0, 1, 2, 3, 4, 0]


def test_mixed_zones_are_one_clock_and_a_date_is_no_channel(tmp_path: Path) -> None:
    stamps = [a if k % 2 else b for k, (a, b) in enumerate(zip(dates("Z"), dates("offset"), strict=True))]
    np.testing.assert_allclose(read_record(write(tmp_path / "a.csv", "t", stamps), roles("t")).time_s, AT, atol=1e-9)
    (tmp_path / "b.csv").write_text("time_s,pitch,speed\n0,2024-01-01,1\n0.1,2024-01-02,2\n")
    with pytest.raises(DataError, match="'pitch' holds dates"):
        read_record(tmp_path / "b.csv", roles())


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_counts_since_1970_are_told_by_their_size(
    tmp_path: Path, unit: str, scale: float, caplog: pytest.LogCaptureFixture
) -> None:
    first = BEGIN.timestamp()
    stamps = [f"{first + t:.3f}" if unit == "s" else str(round((first + t) * 1e3) * round(scale / 1e3)) for t in AT]
    with caplog.at_level(logging.WARNING):
        record = read_record(write(tmp_path / "a.csv", "time", stamps), roles())
    np.testing.assert_allclose(record.time_s - first, AT, atol=1e-6)
    assert record.begins == "2024-03-31T01:59:59.500000Z"
    assert f"counts {unit} since 1970" in caplog.text


@pytest.mark.parametrize("heading", ["time [ms]", "time_ms", "Time (milliseconds)"])
def test_milliseconds_in_the_heading_are_taken(tmp_path: Path, heading: str, caplog: pytest.LogCaptureFixture) -> None:
    path = write(tmp_path / "a.csv", heading, [f"{1000 * t:.0f}" for t in AT])
    with caplog.at_level(logging.WARNING):
        np.testing.assert_allclose(read_record(path, roles()).time_s, AT, atol=1e-12)
    assert "is in ms; one sample takes 0.05 s" in caplog.text


def test_whole_steps_without_a_unit_are_asked_about(tmp_path: Path) -> None:
    """The same numbers are 20 Hz in milliseconds and one sample in 50 s in seconds: the file cannot say which."""
    path = write(tmp_path / "a.csv", "Time", [f"{1000 * t:.0f}" for t in AT])
    with pytest.raises(DataError, match=r"steps by 50 and does not say its unit: in milliseconds that is 20 samples"):
        read_record(path, roles("Time"))
    assert read_record(path, roles("Time", time_unit="ms")).sample_time_s == STEP
    assert read_record(path, roles("Time", time_unit="s")).sample_time_s == 50.0
    assert read_record(path, roles("Time", declared=0.05)).sample_time_s == STEP


@pytest.mark.parametrize(
    ("first", "step", "told", "unit", "second"),
    [
        (0.0, 12.5, "in milliseconds that is 80 samples", "ms", 1e-3),
        (45352.5, 0.05 / 86400, "in days that is one sample in 0.05 s", "d", 86400.0),
        (738000.5, 0.1 / 86400, "in days that is one sample in 0.1 s", "d", 86400.0),
        (250000000, 10000, "in microseconds that is 100 samples", "us", 1e-6),
        (300000000000, 10000000, "in nanoseconds that is 100 samples", "ns", 1e-9),
        (1500000000, 10000, "as s since 1970 that is one sample every 1e", "us", 1e-6),
        (1500000000000, 10000000, "as ms since 1970 that is one sample every 1e", "ns", 1e-9),
    ],
)
def test_numbers_that_are_plainly_no_seconds_are_asked_about(
    tmp_path: Path, first: float, step: float, told: str, unit: str, second: float
) -> None:
    path = write(tmp_path / "a.csv", "Time", [f"{first + step * k:.12f}" for k in range(COUNT)])
    with pytest.raises(DataError, match=f"{told}.*set time_unit"):
        read_record(path, roles("Time"))
    assert read_record(path, roles("Time", time_unit=unit)).sample_time_s == pytest.approx(step * second, rel=1e-3)
    if first < 1e5 or first > 1e8:  # numbers since the year 0 are rounded to 10 µs
        assert read_record(path, roles("Time", declared=step * second)).sample_time_s == pytest.approx(step * second)


@pytest.mark.parametrize("heading", ["Time [s]", "time_s", "Timestamp (s)"])
def test_a_time_column_is_looked_at_beside_a_sample_time(tmp_path: Path, heading: str) -> None:
    stamps = [f"{0.05 * k + (60 if k >= 20 else 0):.2f}" for k in range(COUNT)]
    path = write(tmp_path / "a.csv", heading, stamps)
    with pytest.raises(DataError, match=r"steps by 0\.05 s, the roles file says sample_time_s = 0\.1"):
        read_record(path, roles(declared=0.1))


def test_a_time_column_that_is_to_be_ignored_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write(tmp_path / "a.csv", "Time [s]", ["noon"] * COUNT)
    ignored = (*CHANNELS, Channel("Time", "s", "ignore"))
    with caplog.at_level(logging.WARNING):
        assert len(read_record(path, Roles(ignored, 0.1, None, "roles.toml"))) == COUNT
    assert "the time column 'Time [s]' is not looked at" in caplog.text


@pytest.mark.parametrize(
    ("kind", "unit", "told"), [(2, "rad", "the angle 'phi'"), (4, "", "the index 'phi'"), (1, "rad", "in 'rad'")]
)
def test_a_master_of_mdf_that_is_no_time_is_refused(tmp_path: Path, kind: int, unit: str, told: str) -> None:
    with pytest.raises(DataError, match=f"channel 'pitch'.*{told}"):
        read_record(over(tmp_path / "a.mf4", AT, kind, unit), roles())


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("", 1.0), ("ms", 1e3), ("min", 1 / 60)])
def test_the_unit_of_a_master_of_mdf_is_looked_at(tmp_path: Path, unit: str, scale: float) -> None:
    record = read_record(over(tmp_path / "a.mf4", scale * AT, 1, unit), roles())
    np.testing.assert_allclose(record.time_s, AT, atol=1e-9)


def over(path: Path, stamps: NDArray[np.float64], kind: int, unit: str) -> Path:
    """Write two channels over a master of some kind (1 time, 2 angle, 3 distance, 4 index) and unit."""
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append(
            [Signal(np.sin(AT), stamps, name="pitch"), Signal(np.cos(AT), stamps, name="speed")], common_timebase=True
        )
        master = file.groups[0].channels[file.masters_db[0]]
        master.sync_type, master.unit, master.name = kind, unit, "phi"
        file.save(path)
    return path


def test_a_sample_time_ten_times_off_is_said_so(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "time_s", [f"{t:.2f}" for t in AT])
    with pytest.raises(DataError, match="10 times too small"):
        read_record(path, roles("time_s", declared=0.005))
    with pytest.raises(DataError, match="10 times too large"):
        read_record(path, roles("time_s", declared=0.5))


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_an_index_of_dates_of_pandas_is_the_clock(tmp_path: Path, zone: str | None) -> None:
    index = pd.DatetimeIndex(pd.Timestamp(BEGIN).tz_localize(None) + pd.to_timedelta(AT, unit="s"))
    index = index if zone is None else index.tz_localize("UTC").tz_convert(zone)
    table = pd.DataFrame({"pitch": np.arange(COUNT) % 5, "speed": 12.0}, index=index)
    table.to_parquet(tmp_path / "a.parquet")
    record = read_record(tmp_path / "a.parquet", roles())
    np.testing.assert_allclose(record.time_s, AT, atol=1e-9)
    assert record.begins == "2024-03-31T01:59:59.5" + ("Z" if zone else "")


def two_rates(path: Path) -> Path:
    """Write pitch every 0.05 s and speed every 0.1 s, empty cells between."""
    rows = [f"{t:.2f},{np.sin(t):.6f},{(f'{np.cos(t):.6f}' if k % 2 == 0 else '')}" for k, t in enumerate(AT)]
    path.write_text("\n".join(["time_s,pitch,speed", *rows]) + "\n")
    return path


def test_channels_of_two_rates_are_brought_to_the_slower_one(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = two_rates(tmp_path / "a.csv")
    with caplog.at_level(logging.WARNING):
        record = read_record(path, roles(resample="auto"))
    assert record.sample_time_s == 0.1 and len(record) == 20
    np.testing.assert_allclose(record.values, np.column_stack([np.sin(AT[::2]), np.cos(AT[::2])]), atol=1e-6)
    assert "resampled to 0.1 s" in caplog.text and "every 0.05 s pitch; every 0.1 s speed" in caplog.text
    fine = read_record(path, roles(resample=0.025))
    np.testing.assert_allclose(fine.column("speed"), np.cos(fine.time_s), atol=0.0013)  # h²/8 · max|cos''| at h = 0.1 s


def test_an_uneven_clock_is_resampled_angles_the_short_way_and_gaps_stay_open(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    time = np.sort(rng.uniform(0, 20, 400))
    time = time[(time < 8) | (time > 12)]
    rows = [f"{t:.6f},{np.sin(t)},{(90 * t) % 360}" for t in time]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,pitch,turn", *rows]) + "\n")
    channels = (Channel("pitch", "deg", "input"), Channel("turn", "deg", "azimuth"))
    with pytest.raises(DataError, match="--resample"):
        read_record(tmp_path / "a.csv", Roles(channels, None, "time_s", "r"))
    record = read_record(tmp_path / "a.csv", Roles(channels, None, "time_s", "r", resample=0.05))
    inside = (record.time_s > 8.1) & (record.time_s < 11.9)
    assert np.isnan(record.values[inside]).all()
    there = np.isfinite(record.column("turn"))
    apart = (record.column("turn") - 90 * record.time_s + 180)[there] % 360 - 180
    assert np.max(np.abs(apart)) < 1e-3


def test_groups_of_mdf_with_clocks_of_their_own(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    slow = 0.2 * np.arange(11) + 0.013
    with MDF(version="4.10") as file:
        file.append([Signal(np.sin(AT), AT, name="pitch", unit="deg")])
        file.append([Signal(np.cos(slow), slow, name="speed", unit="rpm")])
        file.save(tmp_path / "a.mf4")
    with pytest.raises(DataError, match="different clocks; let --resample"):
        read_record(tmp_path / "a.mf4", roles())
    record = read_record(tmp_path / "a.mf4", roles(resample="auto"))
    assert record.sample_time_s == 0.2 and record.time_s[0] == pytest.approx(0.013)
    np.testing.assert_allclose(record.column("speed"), np.cos(record.time_s), atol=1e-9)
    np.testing.assert_allclose(record.column("pitch"), np.sin(record.time_s), atol=STEP**2 / 8)


@pytest.mark.parametrize("text", ["0", "-1", "nan", '"fast"', "true", "[1]"])
def test_a_resampling_that_is_no_time_is_refused(tmp_path: Path, text: str) -> None:
    head = f'[recording]\nresample = {text}\n[[channel]]\nname = "a"\nunit = ""\nrole = "input"\n'
    (tmp_path / "roles.toml").write_text(head)
    with pytest.raises(DataError, match="resample"):
        Roles.load(tmp_path / "roles.toml")


@pytest.mark.parametrize(("unit", "right"), [("degrees", "deg"), ("RPM", "rpm"), ("m/sec", "m/s"), ("radians", "rad")])
def test_a_unit_spelt_another_way_is_refused_by_name(tmp_path: Path, unit: str, right: str) -> None:
    (tmp_path / "roles.toml").write_text(f'[[channel]]\nname = "pitch"\nunit = "{unit}"\nrole = "input"\n')
    with pytest.raises(DataError, match=f"the unit '{unit}' of 'pitch' is written '{right}' here"):
        Roles.load(tmp_path / "roles.toml")
