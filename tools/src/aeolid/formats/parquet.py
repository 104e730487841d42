"""Read Parquet in a confined process: a page may announce two GiB, and a dictionary repeat a long text without end."""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.confined import Failure, Reply, start
from aeolid.errors import DataError
from aeolid.formats.bounds import content_limit, guard_names, guard_size, reading_limits
from aeolid.formats.clock import relative
from aeolid.formats.sent import columns_of, names_of, units_of
from aeolid.formats.table import Array, Choose, Table, to_numbers, unreadable

FRAMES_COLUMNS = ("timestamp", "id", "flags", "data")  # of a raw CAN log kept as Parquet
FRAMES_MARK = b"aeolid_can_frames"  # its metadata entry: the version of the layout, as JSON
WRITTEN = {"write_page_checksum": True}  # how this package writes: its readers compare the sums


class HoldsFrames(Exception):
    """The file is a raw CAN log instead of a table of channels."""


def read_parquet(path: Path, choose: Choose) -> Table:
    """Read the chosen columns of a Parquet file; a field's metadata entry `unit` is its unit.

    Raises HoldsFrames where it is a raw CAN log.
    """
    asked = {"path": str(path.absolute()), "source": str(path), "most": content_limit(path)}
    names: tuple[str, ...] = ()
    wanted: list[str] = []
    units: dict[str, str] = {}
    columns: dict[str, Array] = {}
    begins: dict[str, str] = {}
    clock: str | None = None
    try:
        with start("aeolid.formats.parquet:send_columns", asked, reading_limits(path)) as running:
            for facts, arrays in running:
                if "asks" not in facts:
                    columns, begins = columns_of(arrays, wanted), units_of(facts, "begins")
                    break
                if facts.get("frames") is True:
                    raise HoldsFrames
                names, units = guard_names(path, names_of(facts)), units_of(facts)
                clock = facts.get("clock") if facts.get("clock") in names else None
                wanted = list(dict.fromkeys(choose(names, clock)))
                running.answer({"wanted": wanted})
    except Failure as error:
        raise unreadable(path, "Parquet", error) from None
    return Table(str(path), names, columns, units, clock, begins=begins)


def send_columns(path: str, source: str, most: int) -> Generator[Reply, dict[str, Any], None]:
    """Say what columns there are, then send those that are wanted; runs confined."""
    from pyarrow import parquet

    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        schema = file.schema_arrow
        units = {f.name: _text(f.metadata[b"unit"]) for f in schema if f.metadata and b"unit" in f.metadata}
        facts = {"names": schema.names, "units": units, "frames": FRAMES_MARK in (schema.metadata or {})}
        facts["clock"] = _index_of_dates(schema)
        wanted = (yield {"asks": "wanted"} | facts, {})["wanted"]
        double = next((name for name in wanted if schema.names.count(name) > 1), None)
        if double is not None:
            raise DataError(f"{source}: several columns are called {double!r}; rename all but one")
        guard_size(source, 2 * file.metadata.num_rows * len(wanted) * 8, most)
        # a text that stands in many rows is kept once
        texts = [name for name in wanted if _is_text(schema.field(name).type)]
    with parquet.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts) as file:
        data = {name: file.read(columns=[name]).column(name) for name in wanted}
        begins: dict[str, str] = {}
        columns = [_numbers(source, name, data.pop(name), begins) for name in wanted]
        yield {"begins": begins}, {str(i): values for i, values in enumerate(columns)}


def _index_of_dates(schema: Any) -> str | None:
    """Return the column that pandas kept a DatetimeIndex in; None where there is none."""
    try:
        index = json.loads((schema.metadata or {}).get(b"pandas", b"{}"))["index_columns"]
        dates = [n for n in index if isinstance(n, str) and str(schema.field(n).type).startswith("timestamp")]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return dates[0] if len(dates) == 1 else None


def _numbers(source: str, name: str, column: Any, begins: dict[str, str]) -> Array:
    """Return a column as numbers; dates as seconds since the first of them, which `begins` then says."""
    import pyarrow as pa

    if pa.types.is_timestamp(column.type):
        try:
            stamps = column.cast(pa.timestamp("ns", column.type.tz)).combine_chunks()
        except pa.ArrowInvalid:
            raise DataError(f"{source}: channel {name!r} holds dates before 1678 or after 2262") from None
        seconds, begins[name] = relative(stamps, column.type.tz)
        return seconds
    if pa.types.is_date(column.type) or pa.types.is_time(column.type):
        raise DataError(f"{source}: channel {name!r} holds days or times of day; give date and time in one column")
    if pa.types.is_floating(column.type) or pa.types.is_integer(column.type) or pa.types.is_boolean(column.type):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=float)
    if not pa.types.is_dictionary(column.type):
        return to_numbers(source, name, np.array(column.to_pylist(), dtype=object))
    parts: list[Array] = [np.empty(0)]
    for chunk in column.chunks:
        index = chunk.indices.to_numpy(zero_copy_only=False).astype(float)
        parts.append(_looked_up(source, name, chunk.dictionary, index, sum(map(len, parts))))
    return np.concatenate(parts)


def _looked_up(source: str, name: str, dictionary: Any, index: Array, before: int) -> Array:
    """Read each text of a dictionary once; a bad one is named by the first sample that has it."""
    values = np.full(len(dictionary) + 1, np.nan)  # the last one: for missing samples
    place = np.where(np.isnan(index), len(dictionary), index).astype(int)
    used, first = np.unique(place, return_index=True)
    for entry, sample in sorted(zip(used.tolist(), first.tolist(), strict=True), key=lambda pair: pair[1]):
        if entry < len(dictionary):
            text = np.array([dictionary[entry].as_py()], dtype=object)
            values[entry] = to_numbers(source, name, text, before + sample)[0]
    found: Array = values[place]
    return found


def _is_text(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_binary(kind))


def _text(mark: bytes) -> str:
    return mark.decode("utf-8", "replace")
