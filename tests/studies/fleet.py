"""Follow one turbine for a year: how time and memory of `aeolid fleet` grow, and whether a slow change is found.

    python tests/studies/fleet.py [--recordings 2000] [--out FOLDER]

Writes fleet.txt and fleet.json; the recordings are made in the folder and kept there for a second run. The plant has
modes at 0.32 and 0.90 Hz (damping 2 and 3 %), two inputs in closed loop (u = r − 0.05 y, r white), two outputs with
measurement noise. Ten-minute recordings at 10 Hz are spread evenly over 365 days; from day 120 on the lower mode falls
in a straight line, by 3 % until the end. `aeolid fleet --window 1w --past 20 --workers 2` runs on every eighth, fourth,
second and on all of them, each in a folder of its own; then once more on all with everything cached, once more with one
new file; then anew, killed (SIGKILL) while it runs, and started again. Memory is the largest sum of resident sizes of
all its processes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.formats import write_table
from aeolid.models.recursion import run_states

STEP, SAMPLES, DAYS, ONSET, FALL = 0.1, 6000, 365.0, 120.0, 0.03
START = 1_767_225_600.0  # 2026-01-01, s since 1970
MODES = ((0.32, 0.02), (0.90, 0.03))
FEEDBACK, NOISE = 0.05, 0.1
PAST = 20
YEAR = 52_560


def frequency_at(day: float) -> float:
    """Return the lower mode in Hz."""
    return MODES[0][0] * (1 - FALL * max(day - ONSET, 0.0) / (DAYS - ONSET))


def simulate(day: float, seed: int) -> dict[str, Any]:
    """Return the columns of one recording."""
    A, B, C = np.zeros((4, 4)), np.zeros((4, 2)), np.zeros((2, 4))
    for i, (hz, damping) in enumerate(((frequency_at(day), MODES[0][1]), MODES[1])):
        s = 2 * np.pi * hz * STEP
        size, angle = np.exp(-damping * s), s * np.sqrt(1 - damping**2)
        turn = size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = turn
    B[[0, 2], [0, 1]] = B[[2, 0], [0, 1]] = 0.3, 0.1
    C[[0, 1], [0, 2]], C[[0, 1], [2, 0]] = 1.0, 0.2  # feedback adds damping
    random = np.random.default_rng(seed)
    r, w, v = (random.standard_normal((SAMPLES + 500, k)) for k in (2, 4, 2))
    closed = A - FEEDBACK * B @ C
    forced = r @ B.T + 0.05 * w - FEEDBACK * NOISE * v @ B.T
    x = run_states(closed, forced, np.zeros(4))[:-1]
    y = x @ C.T + NOISE * v
    u = r - FEEDBACK * y
    columns = {"time_s": START + 86400 * day + STEP * np.arange(SAMPLES)}
    return columns | {name: part[500:, i] for part, names in ((u, "ab"), (y, "cd")) for i, name in enumerate(names)}


def make(folder: Path, count: int) -> list[Path]:
    """Write the recordings that are not there yet; file k of `count` is of day 365 k/count."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k in range(count):
        path = folder / f"T1_{k:05d}.parquet"
        if not path.exists():
            write_table(path, simulate(DAYS * k / count, k), {})
        paths.append(path)
    channel = '[[channel]]\nname = "{}"\nunit = ""\nrole = "{}"\n'
    roles = "".join(channel.format(n, "input" if n in "ab" else "output") for n in "abcd")
    (folder.parent / "roles.toml").write_text('[recording]\ntime = "time_s"\n' + roles)
    return paths


def resident(process: int) -> float:
    """Return the resident size of a process and all below it, MB."""
    total, waiting = 0.0, [process]
    while waiting:
        number = waiting.pop()
        try:
            total += int(Path(f"/proc/{number}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
            for task in Path(f"/proc/{number}/task").iterdir():
                waiting += map(int, (task / "children").read_text().split())
        except (FileNotFoundError, ProcessLookupError):
            continue
    return total


def run(data: Path, out: Path, kill_after: int | None = None) -> dict[str, Any]:
    """Run the command on a folder; kill_after: factors in the cache at which it is killed."""
    words = [sys.executable, "-m", "aeolid.cli.main", "fleet", str(data), "--roles", str(data.parent / "roles.toml")]
    words += ["--past", str(PAST), "--window", "1w", "--out", str(out), "--workers", "2", "--group", "(?P<turbine>T1)"]
    began, before, peak = time.monotonic(), os.times(), 0.0
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    while process.poll() is None:
        peak = max(peak, resident(process.pid))
        done = len(list((out / "cache" / "factors").glob("*.npz"))) if kill_after is not None else 0
        if kill_after is not None and done >= kill_after:
            process.send_signal(signal.SIGKILL)
        time.sleep(0.2)
    text = process.stdout.read() if process.stdout is not None and kill_after is None else ""
    used = os.times()
    cpu = used.children_user + used.children_system - before.children_user - before.children_system
    found = {
        "code": process.returncode,
        "seconds": time.monotonic() - began,
        "cpu_s": cpu,
        "peak_mb": peak,
        "text": text,
    }
    cache = out / "cache"
    return found | {"cache_mb": sum(p.stat().st_size for p in cache.rglob("*.npz")) / 1e6}


def linked(paths: list[Path], folder: Path) -> Path:
    """Return a folder of links to some of the recordings."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for path in paths:
        (folder / path.name).symlink_to(path.resolve())
    return folder


def drift_of(out: Path) -> list[dict[str, Any]]:
    """Return what the run says of each mode that was found in more than half of the periods."""
    facts = json.loads((out / "fleet.json").read_text())
    return [t for t in facts["tracks"] if t["periods"] > len(facts["periods"]) / 2]


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Follow one turbine for a year.")
    parser.add_argument("--recordings", type=int, default=2000)
    parser.add_argument("--out", type=Path, default=Path("build/studies"), help="folder of results and recordings")
    options = parser.parse_args(arguments)
    work = options.out / "fleet"
    paths = make(work / "all", options.recordings)
    rows: list[tuple[str, int, dict[str, Any]]] = []
    for share in (8, 4, 2, 1):
        some = paths[::share]
        out = work / f"out{share}"
        shutil.rmtree(out, ignore_errors=True)
        rows.append(("fresh", len(some), run(linked(some, work / f"data{share}"), out)))
    data, out = work / "data1", work / "out1"
    rows.append(("cached", len(paths), run(data, out)))
    shutil.copy(make_one(work), data)
    rows.append(("one new", len(paths) + 1, run(data, out)))
    again = work / "killed"
    shutil.rmtree(again, ignore_errors=True)
    rows.append(("killed", len(paths), run(work / "all", again, kill_after=len(paths) // 2)))
    rows.append(("resumed", len(paths), run(work / "all", again)))
    lines = [
        f"{kind:<8} {count:>6} recordings {found['seconds']:7.1f} s, {found['cpu_s']:7.1f} s of processors,"
        f" {found['peak_mb']:5.0f} MB resident, {found['cache_mb']:6.0f} MB cache, exit {found['code']}"
        for kind, count, found in rows
    ]
    counts, seconds = (np.array([r[i] if i == 1 else r[2]["cpu_s"] for r in rows[:4]], float) for i in (1, 2))
    slope, start = np.polyfit(counts, seconds, 1)
    worst = float(abs(seconds - start - slope * counts).max())
    lines.append(f"processor seconds = {start:.1f} + {slope:.4f} a recording (off by {worst:.1f} s at most);"
                 f" a year of {YEAR} recordings: {(start + slope * YEAR) / 60:.0f} min,"
                 f" {YEAR * rows[3][2]['cache_mb'] / counts[-1] / 1e3:.1f} GB of cache")  # fmt: skip
    tracks = drift_of(again)
    lines += [line for line in rows[-1][2]["text"].splitlines() if "written to" not in line]
    lines += [f"mode {t['track']}: " + json.dumps(t["frequency_hz"]) for t in tracks]
    text = "\n".join(lines)
    print(text)
    (options.out / "fleet.txt").write_text(text + "\n", encoding="utf-8")
    (options.out / "fleet.json").write_text(json.dumps({"rows": rows, "tracks": tracks}, indent=1), encoding="utf-8")
    return 0


def make_one(work: Path) -> Path:
    """Write one recording more, of the last day."""
    path = work / "T1_new.parquet"
    write_table(path, simulate(DAYS - 0.5, 10**6), {})
    return path


if __name__ == "__main__":
    sys.exit(main())
