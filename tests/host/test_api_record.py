"""Recordings go to pandas, arrays and xarray and back without loss, and bad ones are refused with a remedy."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest
from api_cases import UNITS, shaft, write_folder

import aeolid as ae
from aeolid.record import ROLES

ROWS = shaft(3, 60)
FRAME = pd.DataFrame(ROWS, columns=list(UNITS))
BOTH: dict[str, Any] = {"inputs": ["pitch"], "outputs": ["rotor_speed"], "units": UNITS}


def made(frame: pd.DataFrame = FRAME, **changes: Any) -> ae.Record:
    return ae.Record.from_pandas(frame, **(BOTH | {"sample_time": 0.1} | changes))


def same(a: ae.Record, b: ae.Record) -> bool:
    return bool(
        np.array_equal(a.values, b.values, equal_nan=True) and np.allclose(a.time_s, b.time_s, rtol=0, atol=1e-12)
        and a.channels == b.channels and a.sample_time_s == b.sample_time_s
    )  # fmt: skip


def test_pandas_and_back() -> None:
    rec = made()
    again = ae.Record.from_pandas(rec.to_pandas(), **BOTH)  # its index is the time
    assert same(rec, again) and rec.sha256 == again.sha256
    assert rec.to_pandas().attrs["units"] == UNITS and rec.to_frame().equals(rec.to_pandas())


def test_arrays_are_as_pandas() -> None:
    columns = {name: ROWS[:, i] for i, name in enumerate(UNITS)}
    assert same(made(), ae.Record.from_arrays(columns, sample_time=0.1, **BOTH))
    assert same(made(), ae.Record.from_arrays(columns, time=0.1 * np.arange(60), **BOTH))


@pytest.mark.parametrize("index", ["dates", "spans", "seconds"])
def test_an_index_is_the_clock(index: str) -> None:
    seconds = 0.1 * np.arange(60)
    chosen = {"dates": pd.Timestamp("2026-03-01") + pd.to_timedelta(seconds, "s"),
              "spans": pd.to_timedelta(seconds, "s"), "seconds": pd.Index(seconds)}[index]  # fmt: skip
    rec = made(FRAME.set_index(chosen), sample_time=None)
    assert rec.sample_time_s == 0.1 and len(rec) == 60


def test_samples_that_the_clock_leaves_out_are_missing() -> None:
    rec = made(FRAME.set_index(pd.Index(0.1 * np.arange(60))).drop(index=[0.5]), sample_time=None)
    assert len(rec) == 60 and np.isnan(rec.values[5]).all() and np.isfinite(np.delete(rec.values, 5, axis=0)).all()


def test_files_and_tables_are_the_same(tmp_path: Path) -> None:
    write_folder(tmp_path)
    rec = ae.read(tmp_path / "monday.outb", roles=tmp_path / "roles.toml")
    assert same(rec, ae.read(str(tmp_path / "monday.outb"), roles={n: (rec.channels[i].role, u) for i, (n, u) in
                                                                   enumerate(UNITS.items())}))  # fmt: skip
    assert same(rec, made(rec.to_pandas(), sample_time=None))
    assert isinstance(rec.slice(0, 10), ae.Record)  # what is cut out of a recording prints and plots as well


def test_every_role_can_be_given() -> None:
    for role in set(ROLES) - {"ignore"}:
        assert made(roles={"pitch": role}, inputs=[]).channels[-1].role == role
    assert [c.name for c in made(roles={"pitch": "ignore"}, inputs=[], units={}).channels] == ["rotor_speed"]


BAD: dict[str, tuple[dict[str, Any], type[ae.AeolidError], str]] = {
    "no frame": ({"frame": ROWS}, ae.UsageError, "ndarray; a pandas.DataFrame is needed, Record.from_arrays"),
    "a missing column": ({"inputs": ["yaw"], "units": {}}, ae.DataError, "column 'yaw' is missing; it has pitch"),
    "no clock": ({"sample_time": None}, ae.UsageError, "sample_time is missing: the index counts rows"),
    "no time": ({"sample_time": -1.0}, ae.UsageError, r"sample_time = -1.0 is not a time above 0 s"),
    "an unknown role": ({"roles": {"x": "winner"}}, ae.UsageError, "role 'winner', which is none of input, output"),
    "a name twice": ({"outputs": ["pitch"]}, ae.UsageError, "'pitch' is named twice among inputs and outputs"),
    "a text": ({"inputs": "pitch"}, ae.UsageError, r"inputs is a text; give a list of names: \['pitch'\]"),
    "nothing": ({"inputs": [], "outputs": [], "units": {}}, ae.UsageError, "no channel is named; give inputs"),
    "a stray unit": ({"units": {"yaw": "deg"}}, ae.UsageError, "units names 'yaw', which has no role"),
    "words": ({"frame": FRAME.assign(pitch="off")}, ae.DataError, "'pitch'.*sample 1"),
    "infinite": ({"frame": FRAME.replace(FRAME.pitch[7], np.inf)}, ae.DataError, "'pitch' is infinite at sample 1 "),
    "huge": ({"frame": FRAME.replace(FRAME.pitch[7], 1e200)}, ae.DataError, r"'pitch' reads 1e\+200 at sample 1 .*NaN"),
    "empty": ({"frame": FRAME.assign(pitch=np.nan)}, ae.DataError, "'pitch' holds no value at all; leave it out"),
    "no rows": ({"frame": FRAME.iloc[:0]}, ae.DataError, "no sample; at least one row"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_tables_are_refused_with_a_remedy(case: str) -> None:
    changes, error, words = BAD[case]
    with pytest.raises(error, match=words):
        made(**changes)


def test_numbers_as_large_as_may_be_are_read_and_so_are_missing_ones() -> None:
    column = np.array([1e100, -1e100, 1e30, np.nan] * 15)
    found = ae.Record.from_arrays({"pitch": column, "rotor_speed": ROWS[:60, 1]}, sample_time=0.1, **BOTH)
    np.testing.assert_array_equal(found.values[:, 0], column)


def test_bad_arrays_are_refused_with_a_remedy() -> None:
    good = {name: ROWS[:, i] for i, name in enumerate(UNITS)}
    for columns, more, words in (
        (good | {"pitch": ROWS[:9, 0]}, {}, r"has the shape \(\d+,\); every array is \(N,\), all of one length"),
        (good | {"pitch": ROWS}, {}, r"'pitch' has the shape \(60, 2\)"),
        (ROWS, {}, "columns is a ndarray; a mapping of names"),
        (good, {"sample_time": None}, "sample_time or time is needed"),
    ):
        with pytest.raises(ae.UsageError, match=words):
            ae.Record.from_arrays(columns, **({"sample_time": 0.1} | BOTH | more))  # type: ignore[arg-type]


def test_bad_files_and_roles_are_refused_with_a_remedy(tmp_path: Path) -> None:
    write_folder(tmp_path)
    monday, roles = tmp_path / "monday.outb", tmp_path / "roles.toml"
    with pytest.raises(ae.DataError, match=r"friday.outb: no such file"):
        ae.read(tmp_path / "friday.outb", roles=roles)
    with pytest.raises(ae.DataError, match=r"none.toml: no such file"):
        ae.read(monday, roles=tmp_path / "none.toml")
    with pytest.raises(ae.DataError, match="role 'winner', which is none of input"):
        ae.read(monday, roles={"pitch": "winner"})
    with pytest.raises(ae.DataError, match="is in 'deg' in the file and in 'rad' in the roles file; correct"):
        ae.read(monday, roles={"pitch": ("input", "rad"), "rotor_speed": "output"})
    with pytest.raises(ae.UsageError, match="roles is a int; the name of a roles file or a mapping"):
        ae.read(monday, roles=3)  # type: ignore[arg-type]
    with pytest.raises(ae.UsageError, match=r"path is a list; .* one file a recording"):
        ae.read([monday], roles=roles)  # type: ignore[arg-type]


def test_xarray_is_optional(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it the message names the package; with it (here a stand-in) it gets names, units, roles and time."""
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ae.UsageError, match="xarray is not installed; install it with: pip install xarray"):
        made().to_xarray()
    stand_in = ModuleType("xarray")
    stand_in.Dataset = lambda *told: told  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "xarray", stand_in)
    variables, coordinates, facts = made().to_xarray()  # type: ignore[misc]
    assert variables["pitch"][2] == {"units": "deg", "role": "input"} and facts["sample_time_s"] == 0.1  # type: ignore
    assert np.array_equal(variables["pitch"][1], ROWS[:, 0]) and len(coordinates["time_s"]) == 60  # type: ignore


def test_an_index_whose_rows_were_counted_is_no_clock() -> None:
    """Rows dropped before: pandas keeps whole numbers, which were taken for seconds."""
    frame = FRAME.copy()
    frame.iloc[7, 0] = np.nan
    for one in (frame.dropna(), frame.drop(index=5), frame[frame.pitch > frame.pitch.min()]):
        with pytest.raises(ae.UsageError, match="sample_time is missing: the index counts rows"):
            made(one, sample_time=None)


@pytest.mark.parametrize(
    ("name", "unit_s", "step_s"),
    [("time [ms]", 1e-3, 0.1), ("time_ms", 1e-3, 0.1), ("time_s", 1.0, 0.1), ("time [h]", 3600.0, 36.0)],
)
def test_the_unit_of_an_index_stands_behind_its_name(name: str, unit_s: float, step_s: float) -> None:
    """As in the heading of a file: `time [ms]` in steps of 100 was a sample every 100 s."""
    frame = FRAME.set_index(pd.Index(step_s / unit_s * np.arange(len(FRAME)), name=name))
    assert made(frame, sample_time=None).sample_time_s == pytest.approx(step_s, rel=1e-9)


def test_an_index_whose_unit_is_open_is_asked_for() -> None:
    frame = FRAME.set_index(pd.Index(100.0 * np.arange(len(FRAME)), name="time"))
    with pytest.raises(ae.UsageError, match=r"'time' does not say its unit; name it with one, .*'time \[ms\]'"):
        made(frame, sample_time=None)


def test_a_clock_and_a_sample_time_must_agree() -> None:
    """As of arrays with a time: the one given beside dates overrode them, ten times too slow."""
    frame = FRAME.set_index(pd.Timestamp("2026-03-01") + pd.to_timedelta(0.1 * np.arange(len(FRAME)), "s"))
    assert made(frame, sample_time=0.1).sample_time_s == 0.1
    with pytest.raises(ae.DataError, match=r"steps by 0.1 s, the roles file says sample_time_s = 1\b.*too large"):
        made(frame, sample_time=1.0)


def test_units_are_spelt_as_in_a_roles_file(tmp_path: Path) -> None:
    """`RPM` from Python was another unit than `rpm`: a harmonic of the rotor was listed as a mode of the tower."""
    text = "unit 'degrees' of 'pitch' is written 'deg' here"
    with pytest.raises(ae.DataError, match=text):
        made(units=UNITS | {"pitch": "degrees"})
    write_folder(tmp_path)
    with pytest.raises(ae.DataError, match=text):
        ae.read(tmp_path / "monday.outb", roles={"pitch": ("input", "degrees"), "rotor_speed": "output"})


@pytest.mark.parametrize("entry", [5, None, (), ("input", 3), ("input", "deg", "more")])
def test_a_role_of_another_type_is_refused(entry: object, tmp_path: Path) -> None:
    with pytest.raises(ae.UsageError, match=r"roles: 'pitch' has .*; a role, or role and unit, is needed"):
        ae.read(tmp_path / "monday.outb", roles={"pitch": entry})


def test_numbers_of_numpy_are_numbers() -> None:
    for step in (np.float32(0.5), np.float64(0.5), np.array(0.5)[()]):
        assert made(sample_time=step).sample_time_s == 0.5
    assert made(sample_time=np.int64(1)).sample_time_s == 1.0


@pytest.mark.parametrize(
    ("what", "text"),
    [
        ("text", "sample_time = '0.1' is not a number"), ("truth", "sample_time = True is not a number"),
        ("unknown", "unexpected keyword argument 'sample_times'"), ("empty", "channels is empty; name at least one"),
    ],
)  # fmt: skip
def test_arguments_of_another_type_are_refused_in_words(what: str, text: str) -> None:
    """Every public function, by its annotations: bare errors of Python told of the inside, not of the parameter."""
    wrong: dict[str, dict[str, Any]] = {
        "text": {"sample_time": "0.1"},
        "truth": {"sample_time": True},
        "unknown": {"sample_times": 0.1},
    }
    with pytest.raises(ae.UsageError, match=text):
        made().plot(channels=[]) if what == "empty" else made(**wrong[what])
