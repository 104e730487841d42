"""Write tables: CSV, gzipped CSV, Parquet."""

from __future__ import annotations

import gzip
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.errors import UsageError
from aeolid.formats.table import Array, require_one_length


def write_table(path: str | Path, columns: Mapping[str, Array], units: Mapping[str, str] | None = None) -> None:
    """Write columns (N,) each under their names; NaN becomes an empty cell, every number reads back bit for bit.

    CSV carries the bare names, which every other reader finds again; Parquet also carries the units. The file
    appears whole or not at all. Raises UsageError on an unknown suffix or a folder that cannot be written to.
    """
    import pyarrow as pa

    target = Path(path)
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items()}
    require_one_length(target, arrays)
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": units[name]} if units and units.get(name) else None)
        for name in arrays
    ]
    empty_cells = len(arrays) > 1  # alone in its row an empty cell would be an empty line, which readers skip
    table = pa.Table.from_arrays(
        [pa.array(a, from_pandas=empty_cells) for a in arrays.values()], schema=pa.schema(fields)
    )
    partial = target.with_name(target.name + ".part")
    try:
        _write(partial, target.name.lower(), table, list(arrays))
        os.replace(partial, target)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UsageError(f"{target}: cannot be written ({error.strerror or error})") from None


def _write(partial: Path, name: str, table: Any, names: list[str]) -> None:
    if name.endswith(".parquet"):
        from pyarrow import parquet

        parquet.write_table(table, partial)
    elif name.endswith((".csv", ".csv.gz")):
        from pyarrow import csv

        heading = ",".join('"' + n.replace('"', '""') + '"' if any(c in n for c in ',"\n\r') else n for n in names)
        with gzip.open(partial, "wb", compresslevel=6) if name.endswith(".gz") else open(partial, "wb") as handle:
            handle.write((heading + "\n").encode())
            csv.write_csv(table, handle, csv.WriteOptions(include_header=False, quoting_style="needed"))
    else:
        raise UsageError(f"{partial.with_suffix('')}: the suffix is none of .csv, .csv.gz, .parquet")
