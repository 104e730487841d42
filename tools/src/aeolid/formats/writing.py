"""Write tables: CSV, gzipped CSV, Parquet."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from aeolid import output
from aeolid.errors import UsageError
from aeolid.formats.headings import heading_line, require_readable
from aeolid.formats.parquet import WRITTEN
from aeolid.formats.table import Array, require_one_length


def write_table(path: str | Path, columns: Mapping[str, Array], units: Mapping[str, str] | None = None) -> None:
    """Write columns (N,) each under their names; NaN becomes an empty cell, every number reads back bit for bit.

    CSV carries the bare names, which every other reader finds again (one that a spreadsheet would take for a formula
    has an apostrophe before it); Parquet also carries the units. The file appears whole or not at all. Raises
    UsageError on an unknown suffix or a place that cannot be written to, DataError on a name that would not be found
    again.
    """
    import pyarrow as pa

    target = Path(path)
    if not target.name.lower().endswith((".csv", ".csv.gz", ".parquet")):
        raise UsageError(f"{target}: the suffix is none of .csv, .csv.gz, .parquet")
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items()}
    require_one_length(target, arrays)
    require_readable(str(target), list(arrays), units or {})
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": units[name]} if units and units.get(name) else None)
        for name in arrays
    ]
    empty_cells = len(arrays) > 1  # alone in its row an empty cell would be an empty line, which readers skip
    table = pa.Table.from_arrays(
        [pa.array(a, from_pandas=empty_cells) for a in arrays.values()], schema=pa.schema(fields)
    )
    with output.replacing(target) as handle:
        _write(handle, target.name.lower(), table, list(arrays))


def _write(handle: BinaryIO, name: str, table: Any, names: list[str]) -> None:
    if name.endswith(".parquet"):
        from pyarrow import parquet

        parquet.write_table(table, handle, **WRITTEN)
    elif name.endswith(".gz"):
        with gzip.GzipFile(filename="", mode="wb", fileobj=handle, compresslevel=6) as packed:
            _write_csv(packed, table, names)
    else:
        _write_csv(handle, table, names)


def _write_csv(handle: Any, table: Any, names: list[str]) -> None:
    from pyarrow import csv

    handle.write(heading_line(names).encode())
    csv.write_csv(table, handle, csv.WriteOptions(include_header=False, quoting_style="needed"))
