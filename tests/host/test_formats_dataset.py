"""Folders of Parquet files and text tables under other suffixes are recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from aeolid.errors import DataError
from aeolid.formats import read_record
from aeolid.record import Channel, Roles

pytestmark = pytest.mark.usefixtures("forking_throughout")

N, STEP = 120, 0.05
AT = STEP * np.arange(N)
ROLES = Roles((Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output")), None, "t", source="roles.toml")


def table(dates: bool) -> pd.DataFrame:
    clock = pd.Timestamp("2024-03-01T12:00:00Z") + pd.to_timedelta(AT, unit="s") if dates else AT
    return pd.DataFrame({"t": clock, "pitch": np.sin(AT), "speed": np.cos(3 * AT)})


@pytest.mark.parametrize("dates", [False, True])
def test_the_parts_of_a_dataset_are_one_recording(tmp_path: Path, dates: bool) -> None:
    """Whatever their names say of the order: part=10 lies after part=9, and here before it in time."""
    whole = table(dates)
    for k, place in enumerate((0, 2, 11, 10, 9, 1)):
        folder = tmp_path / "set" / f"part={place}"
        folder.mkdir(parents=True)
        whole.iloc[20 * k : 20 * (k + 1)].to_parquet(folder / "data.parquet", index=False)
    (tmp_path / "set" / "_metadata.parquet").write_bytes(b"not a table")
    record = read_record(tmp_path / "set", ROLES)
    np.testing.assert_allclose(record.column("pitch"), np.sin(AT), atol=1e-12)
    assert len(record) == N and record.sample_time_s == pytest.approx(STEP)
    assert record.begins == ("2024-03-01T12:00:00Z" if dates else None)
    same = read_record(tmp_path / "set", ROLES)
    (tmp_path / "set" / "part=0" / "data.parquet").write_bytes(
        (tmp_path / "set" / "part=1" / "data.parquet").read_bytes()
    )
    assert same.sha256 == record.sha256 != _hash(tmp_path / "set")


def _hash(folder: Path) -> str:
    from aeolid.formats.recording import recording_sha256

    return recording_sha256(folder)


def test_a_folder_that_is_no_dataset_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,pitch,speed\n0,1,2\n")
    with pytest.raises(DataError, match="a folder without Parquet files; name the file in it"):
        read_record(tmp_path, ROLES)
    table(False).to_parquet(tmp_path / "a.parquet", index=False)
    table(False).drop(columns="speed").to_parquet(tmp_path / "b.parquet", index=False)
    with pytest.raises(DataError, match=r"b\.parquet: no channel 'speed', which the first part has"):
        read_record(tmp_path, ROLES)


@pytest.mark.parametrize("other", ["unit", "time unit", "no date"])
def test_parts_of_other_units_or_clocks_are_refused(tmp_path: Path, other: str) -> None:
    count = 20
    for part in range(2):
        changed = bool(part)
        time = pd.date_range("2024-03-01", periods=count, freq="s") + pd.Timedelta(seconds=count * part)
        stamps = time if other == "no date" and not changed else 1.0 * np.arange(count * part, count * (part + 1))
        units = {"u": "rad" if other == "unit" and changed else "deg"}
        if other != "no date":
            units["time"] = "ms" if other == "time unit" and changed else "s"
        columns = {"time": stamps, "u": np.arange(count) + 1.0, "y": np.arange(count) + 2.0}
        fields = [pa.array(v) for v in columns.values()]
        schema = pa.schema(
            pa.field(n, f.type, metadata={"unit": units[n]} if n in units else None)
            for n, f in zip(columns, fields, strict=True)
        )
        pq.write_table(pa.table(fields, schema=schema), tmp_path / f"part-{part}.parquet")
    roles = Roles((Channel("u", "", "input"), Channel("y", "", "output")), None, None, "roles.toml")
    told = {"unit": "'u' is in 'rad'", "time unit": "'time' is in 'ms'", "no date": "'time' holds dates in"}
    with pytest.raises(DataError, match=rf"part-1\.parquet: channel {told[other]}"):
        read_record(tmp_path, roles)


@pytest.mark.parametrize(("suffix", "separator"), [(".txt", "\t"), (".txt", ";"), (".tsv", "\t")])
def test_text_tables_of_loggers_are_read(tmp_path: Path, suffix: str, separator: str) -> None:
    table(False).to_csv(tmp_path / f"a{suffix}", sep=separator, index=False)
    np.testing.assert_allclose(read_record(tmp_path / f"a{suffix}", ROLES).column("speed"), np.cos(3 * AT))


def test_debug_output_of_rosco_is_read(tmp_path: Path) -> None:
    """A title, names and units in columns of 25 characters, rows."""
    names, units = ("Time", "PC_PitComT", "WE_Vw"), ("(sec)", "(rad)", "(m/s)")
    lines = [" Generated on 11-Oct-2023 at 14:30:37 using ROSCO-v2.8.0"]
    lines += ["".join(f"{c:<25}" for c in row) for row in (names, units)]
    lines += ["".join(f"{v:<25.6E}" for v in (t, 0.1 + 0.01 * t, 12.0)) for t in AT]
    (tmp_path / "a.RO.dbg").write_text("\n".join(lines) + "\n")
    pitch = Channel("pitch", "rad", "input", "PC_PitComT")
    record = read_record(tmp_path / "a.RO.dbg", Roles((pitch,), None, None, source="roles.toml"))
    np.testing.assert_allclose(record.column("pitch"), 0.1 + 0.01 * AT, rtol=1e-6)
