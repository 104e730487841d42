"""Measure time and memory of identification on the host beside the targets and the reference toolbox.

python tests/bench/identify.py [--smoke] [--only NAME …] [--out FILE]   (three minutes, two quiet cores)

Each measurement is a process of its own with one thread: the library call on data in memory, settings beside the name.
CPU s is the processor time of the call (of all processes for the fleet), which other work on the machine hardly moves;
elapsed s is shown for the fleet, whose target it is. MB is the largest resident set of the process, interpreter,
libraries and data included. A call runs twice where it is short, and the second counts: the first compiles or loads
what Numba has compiled. --smoke takes small data and shows only that everything runs; no test asserts a time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BLOCK = 1_000_000
WINDOW = 115  # samples: what `aeolid identify` takes by itself of the turbine's 10^5 samples
FLEET_ROLES = """[recording]
time = "time_s"
"""


@dataclass(frozen=True)
class Case:
    """One measurement: target in s and MB (0: none), what the reference toolbox took in CPU s and MB, samples."""

    title: str
    prepare: Callable[[int], Callable[[], Any]]
    samples: int
    smoke: int
    seconds: float = 0.0
    megabytes: float = 0.0
    toolbox: tuple[float, float] | None = None
    repeat: bool = True
    elapsed: bool = False


def fourth_order(samples: int) -> Callable[[], Any]:
    """VARX, p = f = 10, order 4, on the fourth-order example in closed loop."""
    from aeolid.identify.varx import identify_varx
    from aeolid.plants.lti import simulate_fourth_order

    record = simulate_fourth_order(samples, 1, feedback=0.25)
    return lambda: identify_varx([record], past=10, order=4)


def fourth_order_auto(samples: int) -> Callable[[], Any]:
    """The same with the order chosen on held-out data."""
    from aeolid.identify.varx import identify_varx
    from aeolid.plants.lti import simulate_fourth_order

    record = simulate_fourth_order(samples, 1, feedback=0.25)
    return lambda: identify_varx([record], past=10)


def turbine(samples: int) -> Callable[[], Any]:
    """VARMAX, ten passes, p = f = 10, order 7, on the closed-loop turbine of paper 000."""
    from aeolid.identify.varmax import identify_varmax
    from aeolid.plants.hawt import simulate_closed_loop

    record = simulate_closed_loop(samples, 1)
    through = record.names("input")
    return lambda: identify_varmax([record], past=10, order=7, feedthrough=through, passes=10)


def passes(samples: int) -> Callable[[], Any]:
    """The ten passes of extended least squares alone, n = 82."""
    import numpy as np

    from aeolid.identify.extended import collect, run_pass
    from aeolid.identify.windows import find_scaling
    from aeolid.plants.hawt import simulate_closed_loop

    record = simulate_closed_loop(samples, 1)
    data = collect([record], find_scaling([record]), 10)

    def run() -> None:
        theta, e = np.zeros((3, 82)), np.zeros((samples, 3))
        for _ in range(10):
            run_pass(data, 10, (0, 1), theta, e, 1.0, 0.1)

    return run


def blade(refined: bool) -> Callable[[int], Callable[[], Any]]:
    """LPV kernel, p = 10, order 2, Tikhonov, on the flapping blade in closed loop; `refined`: as the command does."""

    def prepare(samples: int) -> Callable[[], Any]:
        from aeolid.identify.lpv import identify_lpv
        from aeolid.plants.lpv import simulate_blade_in_loop

        record = simulate_blade_in_loop(samples, 1)
        return lambda: identify_lpv(
            [record], past=10, method="lpv-kernel", order=2, varying="A,K", refined=refined, offsets=refined
        )

    return prepare


def long_recording(samples: int) -> Callable[[], Any]:
    """VARX, p = 20, order 5, 2 inputs and 3 outputs, data of 40 bytes a sample."""
    import numpy as np

    from aeolid.identify.varx import identify_varx
    from aeolid.models.recursion import run_states
    from aeolid.record import Channel, Record

    random, x = np.random.default_rng(1), np.zeros(5)
    A = np.zeros((5, 5))
    A[:2, :2], A[2:4, 2:4], A[4, 4] = [[0.9, 0.3], [-0.3, 0.9]], [[0.5, 0.7], [-0.7, 0.5]], 0.8
    B, C, K = random.standard_normal((5, 2)), random.standard_normal((3, 5)), 0.1 * random.standard_normal((5, 3))
    values = np.empty((samples, 5))
    for at in range(0, samples, BLOCK // 10):
        count = min(BLOCK // 10, samples - at)
        u, e = random.standard_normal((count, 2)), 0.3 * random.standard_normal((count, 3))
        states = run_states(A, u @ B.T + e @ K.T, x)
        x = states[-1]
        values[at : at + count] = np.hstack([u, states[:-1] @ C.T + e])
    channels = tuple(Channel(f"{n}{i + 1}", "", role) for n, role, c in (("u", "input", 2), ("y", "output", 3))
                     for i in range(c))  # fmt: skip
    record = Record(np.arange(samples, dtype=float), values, channels, 1.0, "long", "")
    return lambda: identify_varx([record], past=20, order=5)


def left_to_the_data(given: bool) -> Callable[[int], Callable[[], Any]]:
    """`aeolid identify` on the turbine in its loop: window and feedthrough from the recording, or given the same."""

    def prepare(samples: int) -> Callable[[], Any]:
        from aeolid.identify.request import Request
        from aeolid.identify.run import identify_records
        from aeolid.plants.hawt import simulate_closed_loop

        record = simulate_closed_loop(samples, 1)
        if not given:
            return lambda: identify_records([record], Request())
        request = Request(past=WINDOW if samples > 10 * WINDOW * 5 else 10, feedthrough=record.names("input"))
        return lambda: identify_records([record], request)

    return prepare


def fleet(recordings: int) -> Callable[[], Any]:
    """`aeolid fleet`: ten-minute recordings of 5 channels at 10 Hz of two turbines, p = 40, order chosen, no cache."""
    import numpy as np
    import pyarrow
    import pyarrow.parquet as parquet

    from aeolid.plants.hawt import simulate_closed_loop

    where = Path(tempfile.mkdtemp(prefix="aeolid_bench_"))
    names = simulate_closed_loop(20, 0).names("input", "output")
    for k in range(recordings):
        record = simulate_closed_loop(6000, k)
        folder = where / "data" / f"T{k % 2}"
        folder.mkdir(parents=True, exist_ok=True)
        columns = {"time_s": 1.7e9 + 600.0 * (k // 2) + np.arange(6000) / 10}
        columns |= {n: record.column(n) for n in names}
        parquet.write_table(pyarrow.table(columns), folder / f"r{k:03d}.parquet")
    roles = [
        f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"'
        for c in record.channels
        if c.name in names
    ]
    (where / "roles.toml").write_text(FLEET_ROLES + "\n".join(roles) + "\n", encoding="utf-8")
    command = [sys.executable, "-m", "aeolid.cli.main", "fleet", str(where / "data"), "--roles",
               str(where / "roles.toml"), "--past", "40", "--workers", "2", "--window", "6h",
               "--out", str(where / "out")]  # fmt: skip

    def run() -> None:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        shutil.rmtree(where)

    return run


CASES = {
    "varx": Case("VARX p = f = 10, 4 channels, N = 10^5", fourth_order, 100_000, 2000, 0.15, 0, (0.6, 174)),
    "varx-auto": Case("  the same, order chosen", fourth_order_auto, 100_000, 2000),
    "varmax": Case("VARMAX p = 10, ten passes, turbine, N = 10^4", turbine, 10_000, 2000, 0.5, 0, (17.3, 72)),
    "passes": Case("  its ten passes alone", passes, 10_000, 2000),
    "lpv": Case("LPV kernel p = 10, blade in closed loop, N = 2000", blade(False), 2000, 400, 2.0, 0, (11.5, 239)),
    "lpv-refined": Case("  the same as the command runs it", blade(True), 2000, 400, 2.0, 0, (11.5, 239)),
    "n6": Case("VARX p = 20, 5 channels, N = 10^6", long_recording, 10**6, 5000, repeat=False),
    "n6.5": Case("  N = 3·10^6", long_recording, 3 * 10**6, 6000, repeat=False),
    "n7": Case("  N = 10^7", long_recording, 10**7, 7000, 0, 1000, repeat=False),
    "auto": Case(
        "identify, turbine, N = 10^5, all left to the data", left_to_the_data(False), 10**5, 2000, repeat=False
    ),
    "given": Case("  window and feedthrough given", left_to_the_data(True), 10**5, 2000, repeat=False),
    "fleet": Case("fleet of 200 ten-minute recordings, two cores", fleet, 200, 4, 180, repeat=False, elapsed=True),
}


def usage() -> tuple[float, float]:
    """Return CPU seconds and the largest resident set in MB, of this process and of its children."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(r.ru_utime + r.ru_stime for r in both), max(r.ru_maxrss for r in both) / 1024


def child(name: str, smoke: bool) -> None:
    """Run one case in this process and print its figures as JSON."""
    case = CASES[name]
    run = case.prepare(case.smoke if smoke else case.samples)
    if case.repeat:
        run()
    begun, spent = time.monotonic(), usage()[0]
    run()
    elapsed = time.monotonic() - begun
    total, peak = usage()
    print(json.dumps({"cpu_s": total - spent, "elapsed_s": elapsed, "peak_mb": peak}))


def measure(name: str, smoke: bool) -> dict[str, float]:
    """Run one case in a process of its own with one thread; ends the program where it fails."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    command = [sys.executable, __file__, "--child", name, *(["--smoke"] if smoke else [])]
    done = subprocess.run(command, env={**os.environ, **threads}, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        sys.exit(f"{name}: ended with {done.returncode}")
    return json.loads(done.stdout.splitlines()[-1])


def line(case: Case, found: dict[str, float], smoke: bool) -> str:
    """Return a row of the table; small data are held against nothing."""
    if smoke:
        return f"| {case.title} | {found['cpu_s']:.3g} | | {found['peak_mb']:.0f} | small data | |"
    taken = found["elapsed_s"] if case.elapsed else found["cpu_s"]
    targets, ratio = [], ""
    if case.seconds:
        targets.append(f"{case.seconds:g} s {'met' if taken <= case.seconds else 'MISSED'}")
    if case.megabytes:
        targets.append(f"{case.megabytes:g} MB {'met' if found['peak_mb'] <= case.megabytes else 'MISSED'}")
    if case.toolbox:
        ratio = f"{case.toolbox[0]:g} s, {case.toolbox[1]:g} MB: {case.toolbox[0] / found['cpu_s']:.0f} times as fast"
    elapsed = f"{found['elapsed_s']:.1f}" if case.elapsed else ""
    return (
        f"| {case.title} | {found['cpu_s']:.3g} | {elapsed} | {found['peak_mb']:.0f} | {', '.join(targets)} | {ratio} |"
    )


def growth(found: dict[str, dict[str, float]]) -> str:
    """Return what ten times the samples cost."""
    short, long = found["n6"], found["n7"]
    return (
        f"From N = 10^6 to 10^7 the time grows {long['cpu_s'] / short['cpu_s']:.1f}fold, the memory by "
        f"{long['peak_mb'] - short['peak_mb']:.0f} MB, of which the longer data are 432 MB."
    )


def machine() -> str:
    """Return the processor and how busy it was."""
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text(encoding="utf-8") if cpuinfo.exists() else ""
    names = [row.partition(":")[2].strip() for row in text.splitlines() if row.startswith("model name")]
    load = os.getloadavg()[2]
    return f"{names[0] if names else 'processor'}, {os.cpu_count()} cores, mean load of the last 15 minutes {load:.1f}."


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time and memory of identification on the host.")
    parser.add_argument("--smoke", action="store_true", help="small data: shows that everything runs")
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--out", type=Path, help="write the table to this file too")
    parser.add_argument("--child", choices=list(CASES), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child, options.smoke)
        return
    lines = ["| call, one thread | CPU s | elapsed s | peak MB | target | reference toolbox |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    print("\n".join(lines), flush=True)
    found = {}
    for name in options.only:
        found[name] = measure(name, options.smoke)
        lines.append(line(CASES[name], found[name], options.smoke))
        print(lines[-1], flush=True)
    if {"n6", "n7"} <= set(found) and not options.smoke:
        lines += ["", growth(found)]
        print("\n".join(lines[-2:]))
    if options.out:
        text = ["# Identification on the host", "", "`python tests/bench/identify.py`", "", machine(), "", *lines]
        options.out.write_text("\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
