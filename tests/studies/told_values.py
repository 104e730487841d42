"""Ask how far the told values lie from the truth, and whether their bands hold it, when the name is right.

    python tests/studies/told_values.py [--seeds 3] [--only WORD …] [--samples 6000] [--workers 2] [--out FILE]

Every effect of the challenge that has a value, hidden in its textbook form in recordings with an `equations` baseline,
is fitted as the entry that names it, at its best place, to all but the sealed data: no choice among names, so what is
off here is off in the equations, the estimate or its deviation. --only keeps effects whose name or plant has one of the
words. Each line of FILE is one fit; run again with the same FILE it goes on where it stopped.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import sys
import tempfile
import traceback
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.challenge.judge import Z90

PLACES = 4  # best scored, at which the entry is tried
Facts = dict[str, Any]


def valued() -> list[Any]:
    """Return the effects of the challenge that have a value in a model of equations, each plant's own."""
    from aeolid.challenge.menu_turbine import singles

    return [i for i in singles() if i.quantity is not None and "equations" in i.kinds]


def one(number: int, seed: int, samples: int) -> Facts:
    """Hide an effect, fit the entry that names it and say where value and deviation come to lie."""
    from aeolid.challenge.draw import build, place
    from aeolid.challenge.write import write_case
    from aeolid.diagnose.baseline.prepare import prepare
    from aeolid.diagnose.candidates.race import fit_rows
    from aeolid.diagnose.candidates.reestimate import estimated_on_all
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.scoring.scores import score_bank

    item = valued()[number]
    only = replace(item, kinds=("equations",), forms=1)
    draw = build("single", (only,), 7_000_003 + 1009 * number + seed, samples)
    label, true = item.quantity[0], item.quantity[1](place(draw, draw.strength))
    row = {"effect": item.what, "plant": item.plant, "label": label, "true": true, "number": number, "seed": seed}
    with tempfile.TemporaryDirectory() as folder:
        write_case(Path(folder) / "case", draw, samples)
        prepared = prepare(load_case(Path(folder) / "case"))
        bank = score_bank(prepared, prepared.hypotheses, 1)
        found = fit_rows(prepared, [r for r in bank.rows if r.attachment.entry in item.accepted][:PLACES])
    best = max((c for c in found if c.plausible), key=lambda c: c.score, default=None)
    if best is None:
        return row | {"key": None, "why": "; ".join(c.reason for c in found)[:200]}
    (values,) = estimated_on_all(prepared, best).values.values()
    if label not in values:
        return row | {"key": best.key, "why": f"has no {label}"}
    told, std = values[label]
    return row | {"key": best.key, "told": told, "std": std if np.isfinite(std) else None, "gain": best.fit_gain}


def ended(future: Future[Facts], number: int, seed: int) -> Facts:
    """Return what a fit said; a crash is a result too."""
    try:
        return future.result()
    except Exception as error:
        traceback.print_exc()
        item = valued()[number]
        row = {"effect": item.what, "plant": item.plant, "label": item.quantity[0], "number": number, "seed": seed}
        return row | {"key": None, "why": f"crash: {error}"}


def table(rows: list[Facts]) -> str:
    """Return a line for every effect: deviations in per cent and in standard deviations; then the totals."""
    groups: dict[tuple[str, str, str], list[Facts]] = collections.defaultdict(list)
    for r in rows:
        groups[r["effect"], r["plant"], r["label"]].append(r)
    lines = ["| effect | plant | value | off by, % | deviations | fitted |", "|---|---|---|---|---|---|"]
    inside: list[bool] = []
    errors: list[float] = []
    for (effect, plant, label), found in sorted(groups.items()):
        told = [r for r in found if r.get("told") is not None]
        off = [100 * (r["told"] / r["true"] - 1) for r in told]
        z = [(r["told"] - r["true"]) / r["std"] for r in told if r["std"]]
        inside += [abs(v) <= Z90 for v in z]
        errors += [abs(v) / 100 for v in off]
        cells = [", ".join(f"{v:+.2g}" for v in values) or "–" for values in (off, z)]
        lines.append(f"| {effect} | {plant} | {label} | {cells[0]} | {cells[1]} | {len(told)} of {len(found)} |")
    share = f"{sum(inside)} of {len(inside)} in their 90 % band" if inside else "no band"
    return "\n".join([*lines, "", f"median error {np.median(errors):.2%}; {share}" if errors else "nothing fitted"])


def main(arguments: list[str] | None = None) -> int:
    """Run what FILE does not hold yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--samples", type=int, default=6000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("build/told_values.jsonl"))
    o = parser.parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    kept = [n for n, i in enumerate(valued()) if not o.only or any(w in (i.what, i.plant) for w in o.only)]
    if not kept:
        sys.exit(f"no effect or plant is called {' or '.join(o.only)}: {sorted({i.what for i in valued()})}")
    o.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in o.out.read_text().splitlines()] if o.out.exists() else []
    done = {(r["number"], r["seed"]) for r in rows}
    jobs = [(n, s) for s in range(o.seeds) for n in kept if (n, s) not in done]
    with ProcessPoolExecutor(o.workers, mp_context=get_context("spawn")) as pool, o.out.open("a") as file:
        begun = {pool.submit(one, n, s, o.samples): (n, s) for n, s in jobs}
        for k, future in enumerate(as_completed(begun), 1):
            rows.append(ended(future, *begun[future]))
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(f"{k} of {len(jobs)}: {rows[-1]['effect']}, {rows[-1]['plant']}", file=sys.stderr, flush=True)
    print(table([r for r in rows if r["number"] in kept]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
