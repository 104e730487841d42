"""Hold the run as prior against the surrogate of few states that it took the place of, pair by pair.

    python tests/studies/surrogate.py FOLDER [--cases ../shared/cases/known] [--only NAME …] [--patience 1200]

Every case whose baseline is a simulator's run with inputs of its own is diagnosed twice, each time in a process of its
own: as the product does, and by the search with a model of 14 states of the run, which the product keeps for runs that
so few hold. Prints a table of verdict, name, sealed nats, seconds, processor and memory, and what is right. Goes on
where it stopped; FOLDER/rows.json has the rows. Exit code 2 where there is no case.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

from known import CASES, is_right, judge  # noqa: E402

Facts = dict[str, Any]
WAYS = ("surrogate", "prior")


def by_surrogate(case: Path, out: Path) -> None:
    """Diagnose one case by the model of few states; the child of `diagnosed`."""
    from aeolid.diagnose.conclusion.verdict import diagnose
    from aeolid.diagnose.data.bridging import bridged_case
    from aeolid.diagnose.data.case import load_case
    from aeolid.diagnose.data.masking import masked_case
    from aeolid.diagnose.pipeline import study
    from aeolid.errors import NotIdentifiable

    known = bridged_case(masked_case(load_case(case))[0])[0]
    try:
        said = diagnose(study(known, sham=0, seed=0, progress=lambda *_: None))
    except NotIdentifiable as error:
        said = {"verdict": "not_testable", "statement": str(error), "effects": [], "sealed": {}}
    out.mkdir(parents=True, exist_ok=True)
    (out / "diagnosis.json").write_text(json.dumps(said), encoding="utf-8")


def diagnosed(case: Path, way: str, out: Path, patience: float) -> Facts:
    """Diagnose in a process; returns diagnosis, seconds, seconds of processor, MB."""
    command = [sys.executable, str(Path(__file__).resolve()), str(out), "--one", str(case)]
    if way == "prior":
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", str(out), "--sham", "0"]
    begun = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    status = None
    while status is None:
        pid, code, usage = os.wait4(child.pid, os.WNOHANG)
        status = code if pid else None
        if not pid and time.perf_counter() - begun > patience:
            child.kill()
        time.sleep(0.2)
    child.returncode = os.waitstatus_to_exitcode(status)
    seconds, made = time.perf_counter() - begun, out / "diagnosis.json"
    said: Facts = {"verdict": "time-out" if seconds > patience else "crash", "effects": [], "sealed": {}}
    said = json.loads(made.read_text(encoding="utf-8")) if status == 0 and made.is_file() else said
    return {"said": said, "seconds": seconds, "processor_s": usage.ru_utime + usage.ru_stime,
            "memory_mb": usage.ru_maxrss / 1024}  # fmt: skip


def row_of(case: Path, way: str, found: Facts) -> Facts:
    """Return the facts of a row."""
    truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
    said = found["said"]
    facts = judge(truth, said)
    nats = float((said.get("sealed") or {}).get("log_likelihood_gain") or 0.0)
    return {"case": case.name, "way": way, "nats": nats, "right": is_right(facts)} | facts | {
        k: found[k] for k in ("seconds", "processor_s", "memory_mb")
    }  # fmt: skip


def table(rows: list[Facts]) -> str:
    """Write both ways side by side, a line a case, and their sums."""
    lines = ["| case | asked for | 14 states | nats | s | MB | run as prior | nats | s | MB |", "|---|" + "---|" * 9]
    for name in dict.fromkeys(r["case"] for r in rows):
        cells = []
        for way in WAYS:
            own = next((r for r in rows if r["case"] == name and r["way"] == way), None)
            if own is None:
                cells += ["", "", "", ""]
                continue
            said = f"{own['verdict']}: {', '.join(own['ids']) or '–'}{'' if own['right'] else ' ✗'}"
            cells += [said, f"{own['nats']:.0f}", f"{own['processor_s']:.0f}", f"{own['memory_mb']:.0f}"]
        asked = next(r["asked"] for r in rows if r["case"] == name)
        lines.append(f"| {name} | {', '.join(asked) or '–'} | " + " | ".join(cells) + " |")
    for way in WAYS:
        own = [r for r in rows if r["way"] == way]
        middle = sorted(r["processor_s"] for r in own)[len(own) // 2] if own else 0.0
        lines.append(f"\n{way}: {sum(r['right'] for r in own)} of {len(own)} right, {middle:.0f} s of processor in the"
                     f" median, {max((r['processor_s'] for r in own), default=0.0):.0f} s at most")  # fmt: skip
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Diagnose what is left and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the answers")
    parser.add_argument("--cases", type=Path, default=CASES, help="folder of cases with their truth")
    parser.add_argument("--only", nargs="*", default=[], help="names of cases, or beginnings of them")
    parser.add_argument("--patience", type=float, default=1200.0, metavar="S", help="time limit of a diagnosis")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one is not None:
        by_surrogate(options.one, options.folder)
        return 0
    found = sorted(p.parent for p in options.cases.glob("*/truth.json")) if options.cases.is_dir() else []
    cases = [c for c in found if 'kind = "run"' in (c / "case.toml").read_text(encoding="utf-8")]
    cases = [c for c in cases if not options.only or c.name.startswith(tuple(options.only))]
    if not cases:
        print(f"{options.cases}: no case with a simulator's run and its truth", file=sys.stderr)
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    kept = options.folder / "rows.json"
    rows: list[Facts] = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else []
    for case in cases:
        for way in reversed(WAYS):
            if any(r["case"] == case.name and r["way"] == way for r in rows):
                continue
            print(f"{case.name}, {way} …", file=sys.stderr, flush=True)
            rows.append(row_of(case, way, diagnosed(case, way, options.folder / way / case.name, options.patience)))
            kept.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
