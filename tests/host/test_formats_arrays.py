"""Arrays of MATLAB and HDF5: which is meant by a name, which way a matrix lies, packed values, clocks of groups."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from aeolid.errors import DataError
from aeolid.formats import read_record, read_table
from aeolid.record import Channel, Record, Roles

h5py = pytest.importorskip("h5py")
pytestmark = pytest.mark.usefixtures("forking_throughout")

K = np.arange(40.0)
TIME = 0.1 * K


def read(path: Path, u: str = "u", y: str = "y", **other: Any) -> Record:
    channels = (Channel("u", "", "input", u), Channel("y", "", "output", y))
    return read_record(path, Roles(channels, None, other.pop("time", None), "roles.toml", **other))


def test_fields_of_two_structures_do_not_overwrite_each_other(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"time_s": TIME, "meas": {"u": K, "y": K**2, "w": 1.0}, "sim": {"u": -K, "y": -(K**2)}})
    with pytest.raises(DataError, match=r"no channel 'u'.*meas\.u"):
        read(path)
    np.testing.assert_array_equal(read(path, "meas.u", "sim.y").values, np.column_stack([K, -(K**2)]))
    assert set(read_table(path, ["w"]).names) == {"time_s", "meas.u", "meas.y", "w", "sim.u", "sim.y"}


def test_a_variable_is_not_overwritten_by_a_field(tmp_path: Path) -> None:
    for position in (0, 1):
        variables: list[tuple[str, Any]] = [("u", K), ("sim", {"u": -K})]
        savemat(tmp_path / "a.mat", dict([*variables[:: 1 - 2 * position], ("time_s", TIME), ("y", K)]))
        np.testing.assert_array_equal(read(tmp_path / "a.mat").column("u"), K)
        np.testing.assert_array_equal(read(tmp_path / "a.mat", "sim.u").column("u"), -K)


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
@pytest.mark.parametrize("first", ["y", "y1"])
def test_a_vector_called_as_a_column_of_a_matrix_is_a_doubled_heading(suffix: str, first: str, tmp_path: Path) -> None:
    """Which of the two stands first in the file says nothing about which is meant; others are read all the same."""
    held = {"y": np.column_stack([K, -K]), "y1": 100 + K}
    held = {name: held[name] for name in (first, *held)} | {"time_s": TIME, "u": K}
    path = tmp_path / f"a{suffix}"
    if suffix == ".h5":
        with h5py.File(path, "w", track_order=True) as file:
            for name, values in held.items():
                file[name] = values
    else:
        savemat(path, held) if suffix == ".mat" else np.savez(path, **held)  # type: ignore[arg-type]
    with pytest.raises(DataError, match="the heading 'y1' stands there 2 times; rename all but one"):
        read(path, y="y1")
    np.testing.assert_array_equal(read(path, y="y2").values, np.column_stack([K, -K]))


def as_mat73(path: Path, variables: Mapping[str, Any]) -> Path:
    """Write HDF5 as MATLAB does: column by column, so that HDF5 shows the axes in reverse; a text is numbers, too."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            text = isinstance(value, str)
            array = np.atleast_2d(np.array([[ord(c) for c in value]], "u2") if text else value)
            item = file.create_dataset(name, data=np.array(array.shape, "u8") if array.size == 0 else array.T)
            item.attrs["MATLAB_class"] = np.bytes_("char" if text else "double")
            if array.size == 0:
                item.attrs["MATLAB_empty"] = np.uint8(1)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(116) + b"\0" * 8 + b"\x00\x02IM"
    with open(path, "r+b") as handle:
        handle.write(head)
    return path


@pytest.mark.parametrize("shape", ["tall", "square"])
def test_both_versions_of_matlab_give_the_same_columns(tmp_path: Path, shape: str) -> None:
    rows = 3 if shape == "square" else len(K)
    data = np.column_stack([TIME, K, K**2])[:rows]
    held = {"data": data, "note": "text", "nothing": np.zeros((0, 3)), "row": data[:, 0]}
    savemat(tmp_path / "a.mat", {k: v for k, v in held.items() if k not in ("note", "nothing")})
    old, new = read_table(tmp_path / "a.mat"), read_table(as_mat73(tmp_path / "b.mat", held))
    assert set(old.names) == set(new.names) == {"data1", "data2", "data3", "row"}
    for name in old.names:
        np.testing.assert_array_equal(old.columns[name], new.columns[name])


def test_packed_values_are_unpacked(tmp_path: Path) -> None:
    """netCDF-4 and CF: physical = raw x scale_factor + add_offset; _FillValue and missing_value are no samples."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_s"] = TIME
        packed = file.create_dataset("u", data=(10 * K).astype("i2"))
        packed.attrs.update({"scale_factor": 0.1, "add_offset": 5.0, "_FillValue": np.int16(50)})
        file.create_dataset("y", data=np.where(K == 7, 1e20, K).astype("f4")).attrs["missing_value"] = 1e20
    record = read(tmp_path / "a.h5")
    np.testing.assert_allclose(record.column("u"), np.where(K == 5, np.nan, K + 5.0), rtol=1e-12)
    np.testing.assert_array_equal(record.column("y"), np.where(K == 7, np.nan, K))


@pytest.mark.parametrize("late", [0.0, 5.0])
def test_groups_with_clocks_of_their_own_are_compared(tmp_path: Path, late: float) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a/time_s"], file["a/u"] = TIME, K
        file["b/Time"], file["b/y"] = TIME + late, K**2
    if late:
        with pytest.raises(DataError, match=r"channel 'b/y' has a time of its own, 'b/Time', which differs from"):
            read(tmp_path / "a.h5")
    else:
        np.testing.assert_array_equal(read(tmp_path / "a.h5").values, np.column_stack([K, K**2]))
