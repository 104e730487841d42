"""Read Parquet in a confined process: a page may announce two GiB, and a dictionary repeat a long text without end."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.confined import Failure, Reply, start
from aeolid.errors import DataError
from aeolid.formats.bounds import content_limit, guard_names, guard_size, reading_limits
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
    try:
        with start("aeolid.formats.parquet:send_columns", asked, reading_limits(path)) as running:
            for facts, arrays in running:
                if "asks" not in facts:
                    columns = columns_of(arrays, wanted)
                    break
                if facts.get("frames") is True:
                    raise HoldsFrames
                names, units = guard_names(path, names_of(facts)), units_of(facts)
                wanted = list(dict.fromkeys(choose(names, None)))
                running.answer({"wanted": wanted})
    except Failure as error:
        raise unreadable(path, "Parquet", error) from None
    return Table(str(path), names, columns, units)


def send_columns(path: str, source: str, most: int) -> Generator[Reply, dict[str, Any], None]:
    """Say what columns there are, then send those that are wanted; runs confined."""
    from pyarrow import parquet

    with parquet.ParquetFile(path, page_checksum_verification=True) as file:
        schema = file.schema_arrow
        units = {f.name: _text(f.metadata[b"unit"]) for f in schema if f.metadata and b"unit" in f.metadata}
        facts = {"names": schema.names, "units": units, "frames": FRAMES_MARK in (schema.metadata or {})}
        wanted = (yield {"asks": "wanted"} | facts, {})["wanted"]
        double = next((name for name in wanted if schema.names.count(name) > 1), None)
        if double is not None:
            raise DataError(f"{source}: several columns are called {double!r}; rename all but one")
        guard_size(source, 2 * file.metadata.num_rows * len(wanted) * 8, most)
        # a text that stands in many rows is kept once
        texts = [name for name in wanted if _is_text(schema.field(name).type)]
    with parquet.ParquetFile(path, page_checksum_verification=True, read_dictionary=texts) as file:
        data = {name: file.read(columns=[name]).column(name) for name in wanted}
        yield {}, {str(i): _numbers(source, name, data.pop(name)) for i, name in enumerate(wanted)}


def _numbers(source: str, name: str, column: Any) -> Array:
    import pyarrow as pa

    if pa.types.is_timestamp(column.type) or pa.types.is_date(column.type):
        raise DataError(f"{source}: channel {name!r} holds dates; give the time in seconds as a number")
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
