"""Make the runs and the cases, each whole or not at all, so that making may stop and go on at any time.

Folder: runs/NAME/run.csv.gz and run.json, tuning/CASE and held/CASE (what a diagnosis reads), CASE.truth.json beside
each, scratch (removed when all is made), failed/NAME.txt (what the simulator said; tried again by the next call).
"""

from __future__ import annotations

import fcntl
import gzip
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from openfast_pairs.design import PARTS, Pair, Run, all_pairs, runs_in_order

CHANNELS = {
    "pitch_demand": ("deg", "input"), "torque_demand": ("kN m", "input"), "generator_speed": ("rpm", "output"),
    "tower_acc_fore_aft": ("m/s^2", "output"), "tower_acc_side_side": ("m/s^2", "output"),
    "flap_moment_1": ("kN m", "output"), "flap_moment_2": ("kN m", "output"), "flap_moment_3": ("kN m", "output"),
    "nacelle_wind": ("m/s", "scheduling"), "azimuth": ("deg", "azimuth"), "pitch_excitation": ("deg", "excitation"),
    "torque_excitation": ("kN m", "excitation"),
}  # fmt: skip
TWO = ("pitch_demand", "torque_demand", "generator_speed", "tower_acc_fore_aft", "pitch_excitation",
       "torque_excitation")  # fmt: skip
OUTPUTS = {"all": tuple(CHANNELS), "two": TWO}
STEP_S = 0.05
_CASE = """[case]
title = "{title}, above rated: does the simulation lack anything?"

[recordings]
files = ["recording.csv.gz"]
roles = "roles.toml"

[baseline]
kind = "run"
file = "simulation.csv.gz"
same_inputs = false

[context]
machine = "wind turbine"
blades = 3
rated_speed_rad_s = {speed:.6g}
gearbox_ratio = {ratio:.6g}
"""
Machine = tuple[str, float, float]  # title, rated speed of the rotor in rad/s, ratio of the gear
_MACHINE: Machine = ("5 MW turbine", 1.267, 97.0)

Runner = Callable[[Run, Path, Path], str]  # run, folder to fill, scratch → what went wrong, or nothing


def case_name(pair: Pair, outputs: str) -> str:
    """Return the name of a case of a pair with the outputs "all" or "two"."""
    return f"{pair.name}-{outputs}"


def truth_of(pair: Pair, outputs: str) -> dict[str, Any]:
    """Return what is true of a case; the keys of tests/studies/known.py and what the table asks for besides."""
    return {
        "verdict": ["named", "ambiguous", "multiple", "parameter"] if pair.families else ["no_mismatch", "immaterial"],
        "ids": list(pair.ids), "also_accepted": list(pair.accepted), "families": list(pair.families),
        "place": pair.place, "values": {k: {"value": v, "unit": u} for k, (v, u) in pair.values.items()},
        "effect": pair.effect, "size": pair.size, "wind": pair.wind, "outputs": outputs, "seconds": pair.seconds,
        "recording_run": pair.recording, "simulation_run": pair.simulation,
    }  # fmt: skip


def simulator(script: Path) -> Runner:
    """Return what makes a run with the simulator's script run.py in a process of its own."""

    def run(asked: Run, folder: Path, scratch: Path) -> str:
        command = [sys.executable, str(script), str(folder / "run"), *asked.command()]
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, env={**os.environ, "TMPDIR": str(scratch)}
        )
        (folder / "run.outb").unlink(missing_ok=True)
        return "" if done.returncode == 0 else f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}\n"

    return run


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold the folder for this process. Raises SystemExit where another one makes it already."""
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "making.lock", "w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SystemExit(f"{folder}: another process is making this corpus") from None
        yield


def make(
    folder: Path, runner: Runner, workers: int, limit_s: float | None, say: Callable[[str], None],
    part: str | None = None,
) -> bool:  # fmt: skip
    """Make what is missing of one part or of both; no run begins after limit_s. Returns whether all of it is there."""
    begun = time.monotonic()
    with alone(folder):
        scratch = folder / "scratch"
        for left in [*scratch.glob("openfast-run-*"), *scratch.glob("making-*")]:
            shutil.rmtree(left) if left.is_dir() else left.unlink()
        scratch.mkdir(exist_ok=True)
        write_cases(folder)
        missing = [r for r in runs_in_order(part) if not (folder / "runs" / r.name).is_dir()]
        first, rest = missing[:1], missing[1:]  # the first one unpacks the programs, alone
        for runs, count in ((first, 1), (rest, workers)):
            _run_all(folder, runs, runner, count, lambda: limit_s is None or time.monotonic() - begun < limit_s, say)
        left_over = [r for r in missing if not (folder / "runs" / r.name).is_dir()]
        if not left_over:
            shutil.rmtree(scratch)
        return not left_over


def _run_all(
    folder: Path, runs: list[Run], runner: Runner, workers: int, may_begin: Callable[[], bool],
    say: Callable[[str], None],
) -> None:  # fmt: skip
    waiting, going = list(runs), set[Future[str]]()
    with ThreadPoolExecutor(workers) as pool:
        while waiting or going:
            while waiting and len(going) < workers and may_begin():
                going.add(pool.submit(_one_run, folder, waiting.pop(0), runner))
            if not going:
                return
            done, going = wait(going, return_when=FIRST_COMPLETED)
            for future in done:
                say(f"{future.result()}; {write_cases(folder)}")


def _one_run(folder: Path, run: Run, runner: Runner) -> str:
    """Make a run beside its place and move it there when it is whole."""
    scratch = folder / "scratch"
    own = scratch / f"making-{os.getpid()}-{run.name}"  # where the simulator of a killed process does not write
    own.mkdir()
    begun = time.monotonic()
    wrong = runner(run, own, scratch)
    if not wrong and not (own / "run.csv.gz").is_file():
        wrong = "no run.csv.gz\n"
    if wrong:
        shutil.rmtree(own)
        (folder / "failed").mkdir(exist_ok=True)
        (folder / "failed" / f"{run.name}.txt").write_text(wrong, encoding="utf-8")
        return f"{run.name}: FAILED, see failed/{run.name}.txt"
    (folder / "runs").mkdir(exist_ok=True)
    own.rename(folder / "runs" / run.name)
    (folder / "failed" / f"{run.name}.txt").unlink(missing_ok=True)
    return f"{run.name}: {time.monotonic() - begun:.0f} s"


def write_cases(folder: Path) -> str:
    """Write every case whose runs are there and that is not; returns how much there is of all."""
    pairs = all_pairs()
    there = 0
    for part in PARTS:
        (folder / part).mkdir(exist_ok=True)
    for pair in pairs:
        if not all((folder / "runs" / name / "run.csv.gz").is_file() for name in (pair.recording, pair.simulation)):
            continue
        for outputs in OUTPUTS:
            there += 1
            if not (folder / pair.part / case_name(pair, outputs)).is_dir():
                write_case(folder, pair, outputs, pair.part, _MACHINE)
    runs = sum(1 for r in runs_in_order() if (folder / "runs" / r.name).is_dir())
    return f"{runs} of {len(runs_in_order())} runs, {there} of {len(OUTPUTS) * len(pairs)} cases"


def write_case(folder: Path, pair: Pair, outputs: str, part: str, machine: Machine) -> None:
    """Write the case of a pair of runs that are there into a part, whole or not at all, and its truth beside it."""
    name, channels = case_name(pair, outputs), OUTPUTS[outputs]
    new = folder / "scratch" / f"making-{name}"
    if new.exists():
        shutil.rmtree(new)
    new.mkdir(parents=True)
    rows = round(pair.seconds / STEP_S)
    _write_table(folder / "runs" / pair.recording / "run.csv.gz", new / "recording.csv.gz", channels, rows)
    _write_table(folder / "runs" / pair.simulation / "run.csv.gz", new / "simulation.csv.gz", channels, None)
    title, speed, ratio = machine
    case = _CASE.format(title=title, speed=speed, ratio=ratio)
    (new / "case.toml").write_text(case, encoding="utf-8")
    (new / "roles.toml").write_text(_roles(channels), encoding="utf-8")
    truth = folder / "scratch" / f"making-{name}.truth.json"
    truth.write_text(json.dumps(truth_of(pair, outputs), indent=1) + "\n", encoding="utf-8")
    truth.rename(folder / part / f"{name}.truth.json")
    new.rename(folder / part / name)


def _write_table(source: Path, target: Path, channels: tuple[str, ...], rows: int | None) -> None:
    """Write the columns of a run that a case has, and no more rows than it has."""
    with gzip.open(source, "rt", encoding="utf-8") as f:
        lines = f.read().splitlines()
    header = lines[0].split(",")
    places = [header.index(c) for c in ("time_s", *channels)]
    chosen = lines if rows is None else lines[: rows + 1]
    with gzip.open(target, "wt", encoding="utf-8") as f:
        for line in chosen:
            values = line.split(",")
            f.write(",".join(values[k] for k in places) + "\n")


def _roles(channels: tuple[str, ...]) -> str:
    blocks = [f'[recording]\nsample_time_s = {STEP_S}\ntime = "time_s"\n']
    for name in channels:
        unit, role = CHANNELS[name]
        blocks.append(f'[[channel]]\nname = "{name}"\nunit = "{unit}"\nrole = "{role}"\n')
    return "\n".join(blocks)
