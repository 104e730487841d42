"""Hide every effect of the catalogue on every rig and count: found, missed, wrongly named, falsely alarmed.

    python tests/studies/recall.py [--seeds 5] [--first-seed 1] [--rigs NAME …] [--only NAME …]
                                   [--workers 2] [--out FILE]

Each line of FILE is one diagnosis; run again with the same FILE it goes on where it stopped. The table of MISMATCH
section 6 is printed at the end, with 95 % intervals (Wilson), and what was named instead, by family. Every second seed
hides the effect in another form than the catalogue's where the rig has one.
"""

from __future__ import annotations

import argparse
import collections
import importlib
import json
import os
import sys
import tempfile
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
RIGS = {
    "diagnosis": 3000,
    "mechanics": 3000,
    "signals": 2000,
    "turbine": 3000,
    "structures": 3000,
}  # module → samples of a recording
DECIDABLE = 5.0  # nats on the sealed data that the effect itself gains when it is fitted
GOOD = ("right", "right, and one too many")


def rig(name: str) -> Any:
    """Import a rig by its name."""
    sys.path[:0] = [str(HERE), str(HERE / "rigs")]
    return importlib.import_module(name)


def one(name: str, number: int, seed: int) -> dict[str, Any]:
    """Diagnose one recording of one trial of a rig."""
    module = rig(name)
    trial = module.trials()[number]
    with tempfile.TemporaryDirectory() as folder:
        drawn = 200 + 2 * number + 1000 * seed + seed % 2  # odd and even stay odd and even: the form of the effect
        try:
            row: dict[str, Any] = module.diagnose_one(trial, Path(folder) / "case", RIGS[name], drawn, 0)
        except Exception:  # a crash is a result too, and the worst
            traceback.print_exc()
            kind = "hidden" if trial.truth else "null"
            row = {"trial": trial.name, "baseline": getattr(trial, "kind", None) or trial.baseline, "kind": kind}
            row |= {"verdict": "crash", "ids": [], "outcome": "crash", "parameter_error": None, "recovered": None}
            row |= {"seed": drawn, "seconds": 0.0}
    return row | {"rig": name, "number": number, "repeat": seed, "truth": list(trial.truth)}


def wilson(good: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a proportion (Wilson 1927)."""
    z, p = 1.96, good / max(of, 1)
    centre, half = p + z * z / (2 * max(of, 1)), z * np.sqrt(p * (1 - p) / max(of, 1) + (z / (2 * max(of, 1))) ** 2)
    scale = 1 + z * z / max(of, 1)
    return float((centre - half) / scale), float((centre + half) / scale)


def family(identifier: str) -> str:
    """Return the family of an entry; what is no entry is its own."""
    from aeolid.diagnose.hypotheses.catalogue import ENTRIES

    return next((e.family for e in ENTRIES if e.id == identifier), identifier)


def table(rows: list[dict[str, Any]]) -> str:
    """Return every trial's outcome, the totals and the confusion of families."""
    lines, trials = [], collections.defaultdict(list)
    for r in rows:
        trials[r["rig"], r["trial"], r["baseline"]].append(r)
    for (name, trial, kind), found in sorted(trials.items()):
        answers = collections.Counter(", ".join(r["ids"]) or r["verdict"] for r in found)
        good = sum(r["outcome"] in (*GOOD, "safe") for r in found)
        errors = [abs(r["parameter_error"]) for r in found if r["parameter_error"] is not None and r["outcome"] in GOOD]
        error = f"{np.median(errors):6.1%}" if errors else ""
        told = "; ".join(f"{a} ×{n}" for a, n in answers.most_common())
        missed = [f"{r['nats']:.0f}" for r in found if r.get("nats") is not None]
        told += f"  (missed, nats of the truth: {', '.join(missed)})" if missed else ""
        lines.append(f"{name:10} {trial:34} {kind:11} {good:2} of {len(found):2} {error:>7}  {told}")
    hidden, null = ([r for r in rows if r["kind"] == k] for k in ("hidden", "null"))
    outside = [r for r in rows if r["kind"] == "outside"]

    def count(what: str, chosen: list[dict[str, Any]], good: list[bool]) -> None:
        low, high = wilson(sum(good), len(chosen))
        lines.append(
            f"{what}: {sum(good)} of {len(chosen)}, {sum(good) / max(len(chosen), 1):.1%} ({low:.1%} … {high:.1%})"
        )

    named = [r for r in hidden if r["ids"]]
    decidable = [r for r in hidden if r["outcome"] in GOOD or r.get("nats") is None or r["nats"] >= DECIDABLE]
    lines.append("")
    count(
        "hidden and decidable (the truth gains 5 nats), named or in the set",
        decidable,
        [r["outcome"] in GOOD for r in decidable],
    )
    count("hidden, named or in the set", hidden, [r["outcome"] in GOOD for r in hidden])
    count("hidden, of those named: first name right", named, [r["ids"][0] in r["truth"] for r in named])
    right = [family(r["ids"][0]) in {family(t) for t in r["truth"]} for r in named]
    count("hidden, of those named: first family right", named, right)
    count("hidden, another name alone", hidden, [r["outcome"] == "wrong" for r in hidden])
    count("null, a name all the same", null, [bool(r["ids"]) for r in null])
    count("crashed", rows, [r["outcome"] == "crash" for r in rows])
    count("outside the catalogue, a name all the same", outside, [bool(r["ids"]) for r in outside])
    errors = [abs(r["parameter_error"]) for r in hidden if r["parameter_error"] is not None and r["outcome"] in GOOD]
    lines.append(f"parameter error where right: median {np.median(errors):.1%}" if errors else "no parameter compared")
    recovered = [r["recovered"] for r in hidden if r["outcome"] in GOOD and r["recovered"] is not None]
    if recovered:
        lines.append(
            f"recovered: median {np.median(recovered):.2f}, tenth percentile {np.quantile(recovered, 0.1):.2f}"
        )
    seconds = [r["seconds"] for r in rows]
    lines.append(f"seconds a diagnosis: median {np.median(seconds):.0f}, longest {max(seconds):.0f}")
    confusion = collections.Counter(
        (family(r["truth"][0]), family(r["ids"][0]) if r["ids"] else r["verdict"]) for r in hidden
    )
    lines.append("hidden family → first answer's family, or verdict:")
    lines += [f"  {a:24} → {b:24} ×{n}" for (a, b), n in sorted(confusion.items())]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the study; exit code 0."""
    from rich.progress import track

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="recordings a trial")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first recording")
    parser.add_argument("--rigs", nargs="*", default=list(RIGS), choices=list(RIGS), help="which rigs")
    parser.add_argument("--only", nargs="*", help="names (or parts of names) of trials")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--out", default="build/recall.jsonl", help="one line a diagnosis; goes on where it stopped")
    options = parser.parse_args(arguments)
    out = Path(options.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    done = {(r["rig"], r["number"], r["repeat"]) for r in rows}
    jobs = [
        (name, number, seed)
        for seed in range(options.first_seed, options.first_seed + options.seeds)
        for name in options.rigs
        for number, trial in enumerate(rig(name).trials())
        if not options.only or any(o in trial.name for o in options.only)
    ]
    left = [j for j in jobs if j not in done]
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool, out.open("a") as handle:
        running = {pool.submit(one, *job): job for job in left}
        for finished in track(as_completed(running), "diagnosing", len(left), disable=not sys.stderr.isatty()):
            rows.append(finished.result())
            handle.write(json.dumps(rows[-1]) + "\n")
            handle.flush()
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
