"""Diagnose recordings of others once more with the best model of them as the baseline: nothing is to have a name.

    python tests/studies/real_nulls.py --diagnosed FOLDER [--cases ../shared/cases/known] [--only NAME …]
                                       [--kinds recorded simulated linear] [--seeds 1] [--out real_nulls]

DIAGNOSED holds folders that `aeolid diagnose --out` wrote, called like the cases (tests/studies/known.py makes them).
Kinds of null: `recorded`, the recording against the corrected model, with what that still lacks of the machine;
`simulated`, the corrected model's free run on the recorded inputs plus noise like its residual on the recording, which
lacks nothing (an autoregression of order 12, driven by blocks of its own errors in random order: spectrum, tails and
bursts stay, what followed the inputs goes); `linear`, the recording against a state-space model identified from it,
where the machine is linear. Answers that are there already are not made again. Prints a table, writes real_nulls.json;
exit code 1 where a null has a name, 2 where there is nothing to diagnose.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from aeolid.diagnose.data.case import Case, load_case
from aeolid.errors import AeolidError
from aeolid.models.equations import TIME, Equations
from aeolid.models.integrate import Compiled, compile_equations, free_run
from aeolid.record import Record

Array = NDArray[np.float64]
CASES = Path(__file__).resolve().parents[2].parent / "shared" / "cases" / "known"
KINDS = ("recorded", "simulated", "linear")
LINEAR = {"real_robot_arm", "real_heater_coupling"}  # what is missing there is linear, a free order has it
ORDER = 12  # of the residual's autoregression
SETTLING = 400  # rows from which a free run's start is estimated


def like(errors: Array, rng: np.random.Generator) -> Array:
    """Return noise (N,) like errors (N,), at random times: their autoregression driven by blocks of its own errors."""
    e = np.nan_to_num(errors - np.nanmean(errors))
    order = min(ORDER, len(e) // 8)
    past = np.column_stack([e[order - k : len(e) - k] for k in range(1, order + 1)])
    a = np.linalg.lstsq(past, e[order:], rcond=1e-8)[0]
    driven, length = e[order:] - past @ a, max(2, round(len(e) ** (1 / 3)))
    starts = rng.integers(0, len(driven) - length, size=2 * len(e) // length + 1)
    drawn = np.concatenate([driven[s : s + length] for s in starts])
    noise = np.asarray(lfilter([1.0], np.concatenate([[1.0], -a]), drawn))[-len(e) :]
    spread = float(noise.std())
    return noise * min(1.0, 2 * float(e.std()) / spread) if spread > 0 else noise


def run_of(compiled: Compiled, record: Record) -> Array:
    """Return the free run (N, l) on a record, its free first states those that fit the first rows best."""
    model = compiled.model
    u, y = model.inputs_of(record), record.columns([o.name for o in model.outputs])
    free = [i for i, s in enumerate(model.states) if s.initial_free]

    def started(x: Array, rows: int) -> Array:
        x0 = model.x0.copy()
        x0[free] = x
        return free_run(compiled, u[:rows], model.theta, x0, record.sample_time_s)

    def off(x: Array) -> Array:
        scaled = (started(x, SETTLING) - y[:SETTLING]) / np.maximum(np.nanstd(y, axis=0), 1e-300)
        return np.clip(np.nan_to_num(scaled, nan=0.0, posinf=1e6, neginf=-1e6), -1e6, 1e6).ravel()

    first = model.x0[free]
    best = least_squares(off, first, x_scale=np.maximum(np.abs(first), 1e-3)).x if free else first
    return started(best, len(u))


def simulated(case: Case, model: Equations, rng: np.random.Generator) -> list[Record]:
    """Return the recordings with the model's outputs in the place of the recorded ones, and noise like the residual."""
    compiled, found = compile_equations(model), []
    names = [o.name for o in model.outputs]
    for record in case.records:
        ran, places = run_of(compiled, record), [[c.name for c in record.channels].index(n) for n in names]
        values = record.values.copy()
        for j, place in enumerate(places):
            seen = values[:, place]
            values[:, place] = np.where(np.isfinite(seen), ran[:, j] + like(seen - ran[:, j], rng), np.nan)
        found.append(replace(record, values=values))
    return found


def write_table(record: Record, file: Path) -> None:
    """Write a record as a table under its channels' columns."""
    heads = ",".join([TIME, *(c.column or c.name for c in record.channels)])
    rows = np.column_stack([record.time_s, record.values])
    np.savetxt(file, rows, delimiter=",", fmt="%.9g", comments="", header=heads)


def make(source: Path, diagnosed: Path, kind: str, seed: int, folder: Path) -> None:
    """Write a null as a case: the source's recordings or simulated ones, its best model as the baseline."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder, copy_function=shutil.copyfile)
    folder.chmod(0o755)
    text = (folder / "case.toml").read_text(encoding="utf-8")
    if kind == "linear":
        case = load_case(source)
        files = [str(Path(r.source)) for r in case.records]
        command = ["identify", *files, "--roles", str(source / "roles.toml"), "--out", str(folder / "model.json")]
        aeolid(*command, "--force")
        text = text.replace('kind = "equations"', 'kind = "state_space"').replace("model.toml", "model.json")
        (folder / "case.toml").write_text(text, encoding="utf-8")
        return
    shutil.copyfile(diagnosed / "model" / "model.toml", folder / "model.toml")
    if kind == "simulated":
        case = load_case(folder)
        assert isinstance(case.baseline, Equations)
        records = simulated(case, case.baseline, np.random.default_rng((11, seed)))
        for record in records:
            write_table(record, folder / Path(record.source).name.removesuffix(".gz"))
        (folder / "case.toml").write_text(text.replace(".csv.gz", ".csv"), encoding="utf-8")


def aeolid(*arguments: str) -> None:
    """Run a command as a user would; raises RuntimeError with its last words."""
    command = [sys.executable, "-m", "aeolid.cli.main", *arguments]
    done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(arguments[:2])}: exit code {done.returncode}: {done.stderr.strip()[-300:]}")


def row_of(name: str, kind: str, seed: int, said: dict[str, Any]) -> dict[str, Any]:
    """Return what counts of an answer."""
    effects = [f"{e['id']} at {e['location']['entry']}" for e in said["effects"]]
    gain = {"gain": said["sealed"]["log_likelihood_gain"], "interval": said["sealed"]["interval"]}
    return {"case": name, "kind": kind, "seed": seed, "verdict": said["verdict"], "effects": effects, **gain}


def line_of(row: dict[str, Any]) -> str:
    """Return a row of the table."""
    names = ", ".join(row["effects"]) or "–"
    gain = f"{row['gain']:.0f} [{row['interval'][0]:.0f}, {row['interval'][1]:.0f}]" if row["effects"] else ""
    return f"| {row['case']} | {row['kind']} {row['seed']} | {row['verdict']} | {names} | {gain} |"


def nulls_of(name: str, kinds: Sequence[str], seeds: int) -> list[tuple[str, int]]:
    """List the nulls of a case: kind and seed; only simulated ones are drawn more than once."""
    chosen = [k for k in kinds if k != "linear" or name in LINEAR]
    return [(k, s) for k in chosen for s in range(1, (seeds if k == "simulated" else 1) + 1)]


def main(arguments: list[str] | None = None) -> int:
    """Make the nulls, diagnose them and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--diagnosed", type=Path, required=True, help="folder of diagnoses, called like the cases")
    parser.add_argument("--cases", type=Path, default=CASES, help="folder of the cases")
    parser.add_argument("--only", nargs="*", default=[], help="names of cases")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=KINDS)
    parser.add_argument("--seeds", type=int, default=1, help="draws of each simulated null")
    parser.add_argument("--out", type=Path, default=Path("real_nulls"), help="folder of nulls, answers and table")
    args = parser.parse_args(arguments)
    done = sorted(p.parent.parent for p in args.diagnosed.glob("*/model/model.toml"))
    chosen = [d for d in done if (args.cases / d.name).is_dir() and (not args.only or d.name in args.only)]
    rows = []
    for folder in chosen:
        for kind, seed in nulls_of(folder.name, args.kinds, args.seeds):
            case = args.out / folder.name / f"{kind}_{seed}"
            told = case.with_name(f"{case.name}_told")
            try:
                if not (told / "diagnosis.json").is_file():
                    make(args.cases / folder.name, folder, kind, seed, case)
                    aeolid("diagnose", str(case), "--out", str(told), "--sham", "0", "--no-report", "--force")
            except (AeolidError, RuntimeError) as error:
                print(f"{case}: {error}", file=sys.stderr)
                continue
            rows.append(row_of(folder.name, kind, seed, json.loads((told / "diagnosis.json").read_text("utf-8"))))
            print(line_of(rows[-1]), flush=True)
    if not rows:
        print(f"{args.diagnosed}: nothing to diagnose", file=sys.stderr)
        return 2
    (args.out / "real_nulls.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    false = sum(bool(r["effects"]) for r in rows)
    print(f"{false} of {len(rows)} nulls have a name.")
    return int(false > 0)


if __name__ == "__main__":
    sys.exit(main())
