"""Play somebody who has just met the tool: own files with own headings, from `aeolid init` to a named effect.

    python tests/studies/newcomer.py FOLDER [--field csv|outb] [--clone] [--seconds 1000]

The turbine's file is a CSV of a logger: dates with a zone, SCADA headings, a column of words, torque in N m; or
(--field outb) an .outb with headings of earlier versions of OpenFAST. The simulator's is an .outb with today's headings
and its torque in kN m. Both are made from a pair of the known cases, whose pitch drive has a lag of 0.3 s that the
simulation lacks. With --clone the repository is cloned and set up in FOLDER first. Three commands follow, each timed.
Ends with 1 where no effect is named.
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

REPOSITORY = Path(__file__).resolve().parents[2]
CASE = REPOSITORY.parent / "shared" / "cases" / "known" / "openfast_lag"
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
EARLIER = {
    "pitch_demand": ("PtchPMzc1", "deg"), "torque_demand": ("GenTq", "kN-m"), "generator_speed": ("GenSpeed", "rpm"),
    "tower_acc_fore_aft": ("NcIMUTAxs", "m/s^2"), "tower_acc_side_side": ("NcIMUTAys", "m/s^2"),
    "flap_moment_1": ("RootMyc1", "kN-m"), "flap_moment_2": ("RootMyc2", "kN-m"), "flap_moment_3": ("RootMyc3", "kN-m"),
    "nacelle_wind": ("HorWindV", "m/s"), "azimuth": ("LSSTipPxa", "deg"),
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


def write_outb(
    path: Path, columns: dict[str, NDArray[np.float64]], headings: dict[str, tuple[str, str]] = SIMULATOR
) -> None:
    """Write OpenFAST's binary output as OpenFAST packs it: 16 bits a value, a scale and an offset a channel."""
    data = np.column_stack([columns[c] for c in headings])
    low, high = data.min(axis=0), data.max(axis=0)
    scale = (65535.0 / (high - low)).astype("<f4")
    offset = (-32768.0 - scale.astype(float) * low).astype("<f4")
    packed = np.clip(np.rint(data * scale.astype(float) + offset.astype(float)), -32768, 32767).astype("<i2")
    names = ["Time", *(name for name, _ in headings.values())]
    units = ["(s)", *(f"({unit})" for _, unit in headings.values())]
    step = float(np.median(np.diff(columns["time_s"])))
    with open(path, "wb") as handle:
        handle.write(struct.pack("<hiidd", 2, data.shape[1], len(data), 0.0, step))
        handle.write(scale.tobytes() + offset.tobytes() + struct.pack("<i", 4) + b"made")
        handle.writelines(text.ljust(10)[:10].encode() for text in names + units)
        handle.write(packed.tobytes())


def make_files(folder: Path, seconds: float, field: str = "csv", case: Path = CASE) -> tuple[Path, Path]:
    """Write the two files a newcomer has."""
    folder.mkdir(parents=True, exist_ok=True)
    recorded, simulator = read(case / "recording.csv.gz", seconds), folder / "model.outb"
    turbine = folder / ("WTG07_fast_log.csv" if field == "csv" else "WTG07.outb")
    if field == "csv":
        write_field(turbine, recorded)
    else:
        write_outb(turbine, recorded, EARLIER)
    write_outb(simulator, read(case / "simulation.csv.gz", seconds))
    return turbine, simulator


def run(command: list[str], folder: Path) -> float:
    """Run a command as it would be typed; returns its seconds, and ends where it fails."""
    print(f"$ {' '.join(command)}", flush=True)
    started = time.perf_counter()
    done = subprocess.run(command, cwd=folder, env={**os.environ, "COLUMNS": "140"}, check=False)
    took = time.perf_counter() - started
    print(f"[{done.returncode}] {took:.1f} s\n", flush=True)
    if done.returncode:
        sys.exit(done.returncode)
    return took


def set_up(folder: Path) -> tuple[Path, list[float]]:
    """Clone the repository and set it up; returns its command, and how long either took."""
    copy = folder / "aeolid"
    took = [run(["git", "clone", "--quiet", str(REPOSITORY), str(copy)], folder)]
    took.append(run(["sh", "tools/setup"], copy))
    return copy / ".venv" / "bin" / "aeolid", took


def main() -> None:
    """Play the newcomer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=1000.0, help="of both files")
    parser.add_argument("--field", choices=("csv", "outb"), default="csv", help="what the turbine's file is")
    parser.add_argument("--clone", action="store_true", help="begin with a fresh clone")
    parser.add_argument("--known", type=Path, default=CASE, help="the case whose tables the files are made of")
    asked = parser.parse_args()
    if not asked.known.is_dir():
        sys.exit(f"{asked.known}: no such folder; --known names the case openfast_lag")
    field, simulator = make_files(asked.folder.resolve(), asked.seconds, asked.field, asked.known)
    here = field.parent
    aeolid, took = set_up(here) if asked.clone else (AEOLID, [])
    took.append(run([str(aeolid), "init", field.name, "--baseline", simulator.name], here))
    took.append(run([str(aeolid), "check", "."], here))
    took.append(run([str(aeolid), "diagnose", ".", "--out", "diagnosis"], here))
    found = json.loads((here / "diagnosis" / "diagnosis.json").read_text())
    print(f"{len(took)} commands, {sum(took):.0f} s: {found['verdict']}, {found['statement']}")
    sys.exit(0 if found["verdict"] == "named" else 1)


if __name__ == "__main__":
    main()
