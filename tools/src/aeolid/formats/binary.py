"""Read binary tables: Parquet, NumPy archives, OpenFAST binary output."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.display import token, without_quotes
from aeolid.errors import DataError
from aeolid.formats.headings import split_heading
from aeolid.formats.table import Array, Choose, Table, guard_size, require_one_length, to_numbers

FRAMES_COLUMNS = ("timestamp", "id", "flags", "data")  # of a raw CAN log kept as Parquet
FRAMES_MARK = b"aeolid_can_frames"  # its metadata entry: the version of the layout, as JSON


def holds_frames(path: Path) -> bool:
    """Tell whether a Parquet file is a raw CAN log instead of a table of channels."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        return FRAMES_MARK in (parquet.read_schema(path).metadata or {})
    except (pa.ArrowException, OSError):
        return False  # read_parquet says what is wrong


def read_parquet(path: Path, choose: Choose) -> Table:
    """Read the chosen columns of a Parquet file; a field's metadata entry `unit` is its unit."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            names = tuple(schema.names)
            wanted = choose(names, None)
            guard_size(path, 2 * file.metadata.num_rows * len(wanted) * 8)
            data = file.read(columns=list(dict.fromkeys(wanted)))
    except (pa.ArrowException, OSError) as error:
        raise unreadable(path, "Parquet", error) from None
    columns = {name: _arrow_column(path, name, data.column(name)) for name in wanted}
    units = {f.name: f.metadata[b"unit"].decode() for f in schema if f.metadata and b"unit" in f.metadata}
    return Table(str(path), names, columns, units)


def _arrow_column(path: Path, name: str, column: Any) -> Array:
    import pyarrow as pa

    if pa.types.is_timestamp(column.type) or pa.types.is_date(column.type):
        raise DataError(f"{path}: channel {name!r} holds dates; give the time in seconds as a number")
    if pa.types.is_floating(column.type) or pa.types.is_integer(column.type) or pa.types.is_boolean(column.type):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=float)
    return to_numbers(path, name, np.array(column.to_pylist(), dtype=object))


def read_npz(path: Path, choose: Choose) -> Table:
    """Read a NumPy archive: one array a channel; the columns of a matrix `y` are called y1, y2, …"""
    try:
        with zipfile.ZipFile(path) as archive:
            guard_size(path, sum(info.file_size for info in archive.infolist()))
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise unreadable(path, "NumPy archive", error) from None
    return from_arrays(path, arrays, choose)


def from_arrays(path: Path, arrays: dict[str, Any], choose: Choose) -> Table:
    """Take vectors (N,), (N, 1), (1, N) and the columns of matrices (N, k) as channels."""
    channels: dict[str, Any] = {}
    for name, value in arrays.items():
        if value.ndim == 1 or (value.ndim == 2 and 1 in value.shape):
            channels[name] = value.reshape(-1)
        elif value.ndim == 2:
            channels |= {f"{name}{i + 1}": value[:, i] for i in range(value.shape[1])}
    names = tuple(channels)
    columns = {name: to_numbers(path, name, channels[name]) for name in choose(names, None)}
    require_one_length(path, columns)
    units = {name: unit for name in names if (unit := split_heading(name)[1]) is not None}
    return Table(str(path), names, columns, units)


def read_outb(path: Path, choose: Choose) -> Table:
    """Read OpenFAST binary output; names and units stand in the file."""
    from openfast_io.FAST_output_reader import load_binary_output

    _require_outb_size(path)
    try:
        data, info, _ = load_binary_output(str(path))
    except Exception as error:  # the reader raises bare Exception on a short file
        raise unreadable(path, "OpenFAST binary output", error) from None
    names = tuple(info["attribute_names"])
    wanted = choose(names, names[0])
    columns = {name: np.ascontiguousarray(data[:, names.index(name)], dtype=float) for name in wanted}
    return Table(str(path), names, columns, dict(zip(names, info["attribute_units"], strict=True)), names[0])


def _require_outb_size(path: Path) -> None:
    """Compare the size the head announces with the file's own, before anything is allocated for it."""
    size = path.stat().st_size
    with open(path, "rb") as handle:
        head = handle.read(12)
    try:
        (kind,) = struct.unpack_from("<h", head)
        channels, rows = struct.unpack_from("<ii", head, 4 if kind == 4 else 2)
    except struct.error:
        raise unreadable(path, "OpenFAST binary output", ValueError("shorter than its head")) from None
    if kind not in (1, 2, 3, 4) or channels < 1 or rows < 0:
        raise unreadable(path, "OpenFAST binary output", ValueError("unknown head"))
    needed = rows * channels * (8 if kind == 3 else 2)
    if needed > size:
        raise DataError(
            f"{path}: {rows} samples of {channels} channels are announced, the file is too short for them;"
            f" the simulation was cut off or the file copied in part"
        )
    guard_size(path, 16 * rows * channels)


def unreadable(path: Path, kind: str, error: Exception) -> DataError:
    """Build the refusal of a file its own reader cannot take."""
    cause = token(without_quotes(" ".join(str(error).split())), 160) or type(error).__name__
    return DataError(f"{path}: not readable as {kind} ({cause}); check that the copy is complete and the suffix right")
