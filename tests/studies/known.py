"""Diagnose recordings made elsewhere, whose missing physics others have published, and hold each answer against that.

    python tests/studies/known.py [--cases ../shared/cases/known] [--only NAME …] [--sham 0] [--out FOLDER]

A case is a folder with case.toml and truth.json: accepted verdicts, ids (all are asked for; also_accepted may stand in
for any), where, and values with relative tolerances. Folders without truth.json are inputs of others. Each diagnosis is
a process of its own; the table is printed and written as known.md and known.json. Exit code 1 where an answer is wrong,
2 where there is no case.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().parents[2].parent / "shared" / "cases" / "known"
Facts = dict[str, Any]


def judge(truth: Facts, said: Facts) -> Facts:
    """Hold a diagnosis against the truth: verdict, ids, place, values; each true, false or None where none is asked."""
    found = [e["id"] for e in said["effects"]]
    stand_ins = set(truth.get("also_accepted", []))
    asked = truth["ids"]
    named = all(i in found for i in asked) or bool(stand_ins & set(found))
    right = next((e for e in said["effects"] if e["id"] in {*asked, *stand_ins}), None)
    place = truth.get("location", {}).get("entry")
    stray = [i for i in found if i != "parameter_error" or "parameter" not in truth["verdict"]]
    values = {}
    for name, wanted in truth.get("parameters", {}).items():
        told = (right or {"parameters": {}})["parameters"].get(name, {}).get("value")
        error = None if told is None else abs(told - wanted["value"]) / abs(wanted["value"])
        values[name] = {
            "told": told, "true": wanted["value"], "error": error,
            "ok": error is not None and error <= wanted["tolerance"],
        }  # fmt: skip
    return {
        "verdict": said["verdict"], "verdict_ok": said["verdict"] in truth["verdict"], "ids": found, "asked": asked,
        "ids_ok": named if asked else not stray,
        "place_ok": None if place is None or not asked else right is not None and right["location"]["entry"] == place,
        "values": values,
    }  # fmt: skip


def is_right(row: Facts) -> bool:
    """Tell whether verdict, ids, place and every value are as they should be."""
    return bool(
        row["verdict_ok"] and row["ids_ok"] and row["place_ok"] is not False
        and all(v["ok"] for v in row["values"].values())
    )  # fmt: skip


def diagnose(case: Path, out: Path, sham: int) -> Facts:
    """Run one diagnosis as a user would; returns diagnosis.json and the seconds it took.

    Where it ends without an answer, the verdict is `crash`, which is never the right one, and the table goes on.
    """
    begun = time.perf_counter()
    command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", str(out), "--sham", str(sham)]
    command += ["--margins"]  # of the decision rules: tests/studies/ablation.py reads them
    done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        print(f"{case.name}: exit code {done.returncode}: {done.stderr.strip()[-300:]}", file=sys.stderr, flush=True)
        none = {"log_likelihood_gain": 0.0, "interval": [0.0, 0.0]}
        return {"verdict": "crash", "effects": [], "sealed": none, "seconds": time.perf_counter() - begun}
    facts: Facts = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    return facts | {"seconds": time.perf_counter() - begun}


def table(rows: list[Facts]) -> str:
    """Write the rows as a table."""
    lines = ["| case | verdict | named | asked for | place | values | sealed gain, nats | s |", "|---|" + "---|" * 7]
    for r in rows:
        values = "; ".join(
            f"{n} {'–' if v['told'] is None else format(v['told'], '.4g')} ({v['true']:.4g}){'' if v['ok'] else ' ✗'}"
            for n, v in r["values"].items()
        )
        named = ", ".join(dict.fromkeys(r["ids"])) or "–"
        lines.append(
            f"| {r['case']} | {r['verdict']}{'' if r['verdict_ok'] else ' ✗'} | {named}{'' if r['ids_ok'] else ' ✗'} |"
            f" {', '.join(r['asked']) or '–'} | {'✗' if r['place_ok'] is False else ''} | {values} |"
            f" {r['gain']:.0f} [{r['interval'][0]:.0f}, {r['interval'][1]:.0f}] | {r['seconds']:.0f} |"
        )
    right = sum(is_right(r) for r in rows)
    return "\n".join([*lines, "", f"{right} of {len(rows)} right."])


def main(arguments: list[str] | None = None) -> int:
    """Diagnose every case that is there and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=Path, default=CASES, help="folder of the cases")
    parser.add_argument("--only", nargs="*", default=[], help="names of cases")
    parser.add_argument("--sham", type=int, default=0, help="null runs in each diagnosis")
    parser.add_argument("--out", type=Path, default=Path("known"), help="folder of the reports and the table")
    args = parser.parse_args(arguments)
    found = sorted(p.parent for p in args.cases.glob("*/truth.json")) if args.cases.is_dir() else []
    chosen = [c for c in found if not args.only or c.name in args.only]
    if not chosen:
        print(f"{args.cases}: no case with a truth.json; nothing was run", file=sys.stderr)
        return 2
    rows = []
    for k, case in enumerate(chosen):
        print(f"{k + 1} of {len(chosen)}: {case.name} …", file=sys.stderr, flush=True)
        said = diagnose(case, args.out / case.name, args.sham)
        truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
        sealed = said["sealed"]
        rows.append(
            {"case": case.name, **judge(truth, said), "seconds": said["seconds"],
             "gain": sealed["log_likelihood_gain"], "interval": sealed["interval"]}
        )  # fmt: skip
        (args.out / "known.md").write_text(table(rows) + "\n", encoding="utf-8")
        (args.out / "known.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table(rows))
    return 0 if all(is_right(r) for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
