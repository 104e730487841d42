"""Play somebody who has just met the tool: own files with own headings, from `aeolid init` to a named effect.

    python tests/studies/newcomer.py FOLDER [--seconds 1000]

The turbine's file is a CSV of a logger: dates with a zone, SCADA headings, a column of words, torque in N m. The
simulator's is an .outb with OpenFAST's own headings and its torque in kN m. Both are made from a pair of the known
cases, whose pitch drive has a lag of 0.3 s that the simulation lacks. Three commands follow, each timed. Ends with 1
where no effect is named.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import struct
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

CASE = Path(__file__).resolve().parents[2].parent / "shared" / "cases" / "known" / "openfast_lag"
AEOLID = Path(sys.executable).with_name("aeolid")
BEGIN = datetime(2024, 3, 1, 13, 0, tzinfo=UTC)
FIELD = {
    "pitch_demand": ("Pitch angle demand (°)", 1.0), "torque_demand": ("Generator torque demand (Nm)", 1e3),
    "generator_speed": ("Generator RPM (1/min)", 1.0), "tower_acc_fore_aft": ("Nacelle acceleration fore-aft", 1.0),
    "tower_acc_side_side": ("Nacelle acceleration side-side", 1.0), "flap_moment_1": ("Blade root flap moment A", 1.0),
    "flap_moment_2": ("Blade root flap moment B", 1.0), "flap_moment_3": ("Blade root flap moment C", 1.0),
    "nacelle_wind": ("Wind speed (m/s)", 1.0), "azimuth": ("Rotor position (°)", 1.0),
}  # fmt: skip
SIMULATOR = {
    "pitch_demand": ("BldPitch1", "deg"), "torque_demand": ("GenTq", "kN-m"), "generator_speed": ("GenSpeed", "rpm"),
    "tower_acc_fore_aft": ("YawBrTAxp", "m/s^2"), "tower_acc_side_side": ("YawBrTAyp", "m/s^2"),
    "flap_moment_1": ("RootMyb1", "kN-m"), "flap_moment_2": ("RootMyb2", "kN-m"), "flap_moment_3": ("RootMyb3", "kN-m"),
    "nacelle_wind": ("Wind1VelX", "m/s"), "azimuth": ("Azimuth", "deg"),
}  # fmt: skip


def read(path: Path, seconds: float) -> dict[str, NDArray[np.float64]]:
    """Read a packed table up to some second."""
    with gzip.open(path, "rt") as handle:
        table = np.genfromtxt(handle, delimiter=",", names=True)
    table = table[table["time_s"] <= seconds]
    return {name: table[name] for name in table.dtype.names or ()}


def write_field(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    """Write the logger's file: local time with its zone, thousandths of a second, names of a SCADA system."""
    local = [BEGIN + timedelta(seconds=float(t)) for t in columns["time_s"]]
    lines = [",".join(["Timestamp", *(name for name, _ in FIELD.values()), "Status"])]
    for k, moment in enumerate(local):
        cells = [f"{columns[c][k] * scale:.7g}" for c, (_, scale) in FIELD.items()]
        lines.append(",".join([moment.isoformat(timespec="milliseconds"), *cells, "production"]))
    path.write_text("\n".join(lines) + "\n")


def write_outb(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    """Write OpenFAST's binary output as OpenFAST packs it: 16 bits a value, a scale and an offset a channel."""
    data = np.column_stack([columns[c] for c in SIMULATOR])
    low, high = data.min(axis=0), data.max(axis=0)
    scale = (65535.0 / (high - low)).astype("<f4")
    offset = (-32768.0 - scale.astype(float) * low).astype("<f4")
    packed = np.clip(np.rint(data * scale.astype(float) + offset.astype(float)), -32768, 32767).astype("<i2")
    names = ["Time", *(name for name, _ in SIMULATOR.values())]
    units = ["(s)", *(f"({unit})" for _, unit in SIMULATOR.values())]
    step = float(np.median(np.diff(columns["time_s"])))
    with open(path, "wb") as handle:
        handle.write(struct.pack("<hiidd", 2, data.shape[1], len(data), 0.0, step))
        handle.write(scale.tobytes() + offset.tobytes() + struct.pack("<i", 4) + b"made")
        handle.writelines(text.ljust(10)[:10].encode() for text in names + units)
        handle.write(packed.tobytes())


def make_files(folder: Path, seconds: float) -> tuple[Path, Path]:
    """Write the two files a newcomer has."""
    folder.mkdir(parents=True, exist_ok=True)
    field, simulator = folder / "WTG07_fast_log.csv", folder / "model.outb"
    write_field(field, read(CASE / "recording.csv.gz", seconds))
    write_outb(simulator, read(CASE / "simulation.csv.gz", seconds))
    return field, simulator


def main() -> None:
    """Play the newcomer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=1000.0, help="of both files")
    asked = parser.parse_args()
    if not CASE.is_dir():
        sys.exit(f"{CASE.name}: the known cases are not beside the repository")
    field, simulator = make_files(asked.folder, asked.seconds)
    case, out = str(asked.folder), str(asked.folder / "diagnosis")
    commands = (
        ["init", str(field), "--baseline", str(simulator)],
        ["check", case],
        ["diagnose", case, "--out", out],
    )
    begun = time.perf_counter()
    for arguments in commands:
        print(f"$ aeolid {' '.join(arguments)}", flush=True)
        started = time.perf_counter()
        done = subprocess.run([AEOLID, *arguments], env={**os.environ, "COLUMNS": "140"}, check=False)
        print(f"[{done.returncode}] {time.perf_counter() - started:.1f} s\n", flush=True)
        if done.returncode:
            sys.exit(done.returncode)
    found = json.loads((asked.folder / "diagnosis" / "diagnosis.json").read_text())
    print(f"{len(commands)} commands, {time.perf_counter() - begun:.0f} s: {found['verdict']}, {found['statement']}")
    sys.exit(0 if found["verdict"] == "named" else 1)


if __name__ == "__main__":
    main()
