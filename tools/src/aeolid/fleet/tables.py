"""Write the modes of a fleet as a Parquet table, one row a mode and period."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aeolid import __version__, output

SCHEMA: Mapping[str, tuple[str, str]] = {
    "turbine": ("string", "name from --group, or the folder of the recording"),
    "period": ("string", "first second of the period as a UTC date or in seconds, the label from --group, or all"),
    "start_s": ("float64", "first sample of the period's earliest recording, s (since 1970 where the clock says so)"),
    "track": ("int32", "number of the mode within the turbine, the same in every period it is found in"),
    "frequency_hz": ("float64", "undamped natural frequency, Hz"),
    "frequency_std_hz": ("float64", "its standard deviation, Hz; empty where unknown"),
    "damping": ("float64", "damping ratio; 1 for a decaying real pole"),
    "damping_std": ("float64", "its standard deviation; empty where unknown"),
    "pole_real": ("float64", "real part of the pole in the z-plane"),
    "pole_imag": ("float64", "imaginary part of the pole in the z-plane, at least 0"),
    "rotor_order": ("int32", "k where the mode is more likely the k-th harmonic of the rotor speed; empty elsewhere"),
    "name": ("string", "what the mode is called by the outputs it moves: tower fore-aft, drive train; empty elsewhere"),
    "mostly_in": ("string", "output with the largest part of the motion, outputs in units of their deviations"),
    "share": ("float64", "that part, 0 to 1"),
    "order": ("int32", "number of states of the period's model"),
    "recordings": ("int32", "recordings merged into the period"),
    "windows": ("int64", "windows of p + 1 samples in the fit"),
    "vaf_percent": ("float64", "least one-step variance accounted for of all outputs, %"),
    "sample_time_s": ("float64", "sample time of the recordings, s"),
}


def mode_rows(periods: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of the table, in the order of turbine, time and frequency."""
    rows = []
    for period in periods:
        for mode in period["modes"]:
            where = max(mode["outputs"], key=lambda name: mode["outputs"][name])
            facts = {**period, **mode, "pole_real": mode["eigenvalue"][0], "pole_imag": mode["eigenvalue"][1]}
            facts |= {"mostly_in": where, "share": mode["outputs"][where]}
            rows.append({name: facts.get(name, "") if name == "name" else facts[name] for name in SCHEMA})
    return rows


def write_models(folder: Path, periods: Sequence[Mapping[str, Any]]) -> None:
    """Write the model of each period as TURBINE/PERIOD.json, which all commands take. Raises UsageError."""
    written: set[Path] = set()
    for period in periods:
        turbine, label = (re.sub(r"^\.|[^\w.+-]", "_", str(period[key])) for key in ("turbine", "period"))
        path = folder / turbine / f"{label}.json"
        while path in written:  # names that differ in what no file name holds
            path = path.with_name(f"{path.stem}_.json")
        written.add(path)
        output.make_folder(path.parent)
        output.write_text(path, json.dumps(period["model"], indent=1), durable=False)


def write_modes(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet, each column with its description; whole or not at all. Raises UsageError."""
    import pyarrow as pa
    from pyarrow import parquet

    fields = [
        pa.field(name, pa.type_for_alias(kind), metadata={"description": text}) for name, (kind, text) in SCHEMA.items()
    ]
    schema = pa.schema(fields, metadata={"aeolid": __version__})
    table = pa.Table.from_pylist([dict(row) for row in rows], schema=schema)
    with output.replacing(path) as handle:
        parquet.write_table(table, handle)
