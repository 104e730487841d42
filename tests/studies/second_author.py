"""Ask the diagnosis for the physics that a second set of machines hides, and grade each answer.

    python tests/studies/second_author.py [--seed 0] [--only NAME …] [--out FOLDER] [--write-only]

Turbines, drives, vehicles, loops, reactors and sensors, written without regard to what the diagnosis is good at: the
model of a case lacks an effect of the catalogue or physics that no entry has, the recording is at fault, or all is
complete. The equations stand in second_author_turbines.py, _plants.py, _machines.py and _nulls.py and are integrated
by SciPy's solve_ivp, apart from the package. Declared values are off by some per cent; recordings have units,
disturbances, loops, gaps and converters. Seed 0 has the random streams of the first figures, any other fresh ones.

Each diagnosis is a process of its own; where an answer is there already, it stays. The grades: right, open (the truth
is one of several), unnamed (something is missing, without a name), nothing (no name, though something is missing, or
the recording is called too short) and wrong (a false name, or a value more than a tenth off). The table is printed
and written as second_author.md and second_author.json. Exit code 1 where an answer is wrong, 2 where there is no case.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent))
from second_author_machines import MACHINES
from second_author_nulls import NULLS
from second_author_parts import Case
from second_author_plants import PLANTS
from second_author_turbines import TURBINES

GRADES = ("right", "open", "unnamed", "nothing", "wrong")
TOLERANCE = 0.1
Makers = Mapping[str, tuple[int, Callable[[np.random.Generator], Case]]]  # name, its stream and what makes it
SECOND: Makers = TURBINES | PLANTS | MACHINES | NULLS
_CASE = """[case]
title = "{name}"
[recordings]
files = {files}
roles = "roles.toml"
[baseline]
kind = "{kind}"
file = "{file}"
[context]
machine = "{machine}"
{context}"""


def generated(every: Makers, seed: int, only: list[str]) -> list[Case]:
    """Return the cases, all or those whose names begin with a word."""
    chosen = [name for name in every if not only or any(name.startswith(word) for word in only)]
    streams = {name: np.random.default_rng([seed, every[name][0]] if seed else every[name][0]) for name in chosen}
    return [every[name][1](streams[name]) for name in chosen]


def kept_rows(case: Case) -> list[tuple[int, NDArray[np.intp]]]:
    """Return the first row of each recording and which of its rows are in the file.

    What is lost has a stream of its own, the same for every seed.
    """
    rng, rows = np.random.default_rng(77), len(next(iter(case.columns.values()))[0])
    edges = [0, *case.cuts, rows]
    found: list[tuple[int, NDArray[np.intp]]] = []
    for begin, end in pairwise(edges):
        keep = np.ones(end - begin, dtype=bool)
        if case.lost:
            count = max(1, case.lost // (len(edges) - 1))
            keep[rng.choice(np.arange(5, end - begin - 5), count, replace=False)] = False
        if case.gap and begin == 0:
            keep[slice(*case.gap)] = False
        found.append((begin, np.flatnonzero(keep)))
    return found


def write(case: Case, folder: Path) -> None:
    """Write recordings, roles, model and case."""
    folder.mkdir(parents=True, exist_ok=True)
    titles = {k: f"{k} [{unit}]" if case.headings and unit else k for k, (_, unit, _) in case.columns.items()}
    files = []
    for number, (begin, rows) in enumerate(kept_rows(case), 1):
        lines = [",".join([case.time, *titles.values()])]
        for k in rows:
            told = [f"{values[begin + k]:.{case.digits}g}" for values, _, _ in case.columns.values()]
            lines.append(",".join([f"{round(k * case.step * case.time_scale, 9):.9g}", *told]))
        files.append(f"run{number}.csv")
        (folder / files[-1]).write_text("\n".join(lines) + "\n", encoding="utf-8")
    roles = ["[recording]", f'time = "{case.time}"']
    for name, (_, unit, role) in case.columns.items():
        roles += ["[[channel]]", f'name = "{name}"', f'unit = "{unit}"', f'role = "{role}"']
        roles += [f'column = "{titles[name]}"'] if titles[name] != name else []
    (folder / "roles.toml").write_text("\n".join(roles) + "\n", encoding="utf-8")
    text = case.model if isinstance(case.model, str) else json.dumps(case.model)
    kind, file = ("equations", "model.toml") if isinstance(case.model, str) else ("state_space", "model.json")
    (folder / file).write_text(text, encoding="utf-8")
    head = _CASE.format(name=case.name, files=json.dumps(files), kind=kind, file=file, machine=case.machine,
                        context=case.context)  # fmt: skip
    (folder / "case.toml").write_text(head, encoding="utf-8")


def diagnosed(case: Path, out: Path) -> dict[str, Any]:
    """Return the answer to a case, asked for as a user would unless it is there; without one the verdict is `crash`."""
    answer = out / "diagnosis.json"
    if not answer.is_file():
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", str(out), "--sham", "0"]
        done = subprocess.run([*command, "--no-report"], check=False, stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True)  # fmt: skip
        if done.returncode or not answer.is_file():
            print(f"{case.name}: exit code {done.returncode}: {done.stderr.strip()[-300:]}", file=sys.stderr)
            return {"verdict": "crash", "effects": []}
    facts: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return facts


def told_values(case: Case, said: Mapping[str, Any]) -> dict[str, float]:
    """Return the values that an entry which is right tells, of those that are asked for: of the first that has one."""
    right = [e for name in reversed(case.right) for e in said["effects"] if e["id"] == name]
    return {
        name: float(effect["parameters"][name]["value"])
        for effect in right for name in case.values if name in effect["parameters"]
    }  # fmt: skip


def is_off(told: float, true: float) -> bool:
    """Tell whether a value is further from the true one than the tolerance."""
    return abs(told - true) > TOLERANCE * abs(true)


def grade(case: Case, said: Mapping[str, Any]) -> str:
    """Hold an answer against the truth; a declared value that is told beside the effect is no name.

    A case may have further fair verdicts; where the truth is a wrong declared value, the verdict `parameter` is one.
    """
    wanted, verdict = {*case.right, *case.alike}, said["verdict"]
    names = {effect["id"] for effect in said["effects"]}
    complete = not case.right and not case.outside
    if verdict == "crash" or names - wanted - {"parameter_error", *case.beside}:
        return "wrong"
    if (case.outside and verdict in case.verdicts) or (verdict == "parameter" and "parameter_error" in case.right):
        return "right"
    if verdict == "unnamed":
        return "right" if case.outside else "unnamed"
    if complete:
        fine = verdict in ("no_mismatch", "parameter", "immaterial", *case.verdicts)
        return "right" if fine else "nothing" if verdict == "not_testable" else "wrong"
    if not names & wanted:
        return "nothing"
    if verdict == "ambiguous":
        return "open"
    return "wrong" if any(is_off(v, case.values[k]) for k, v in told_values(case, said).items()) else "right"


def row_of(case: Case, said: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of the table."""
    truth = [*case.right] or ["outside the catalogue" if case.outside else "complete"]
    return {
        "case": case.name, "truth": truth, "verdict": said["verdict"], "named": [e["id"] for e in said["effects"]],
        "values": {k: {"told": v, "true": case.values[k]} for k, v in told_values(case, said).items()},
        "grade": grade(case, said),
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as a table, and how many have each grade."""
    lines = ["| case | truth | verdict | named | values (true) | grade |", "|---|---|---|---|---|---|"]
    for r in rows:
        values = "; ".join(
            f"{name} {v['told']:.4g} ({v['true']:.4g}){' ✗' if is_off(v['told'], v['true']) else ''}"
            for name, v in r["values"].items()
        )
        named = ", ".join(dict.fromkeys(r["named"])) or "–"
        lines.append(
            f"| {r['case']} | {' or '.join(r['truth'])} | {r['verdict']} | {named} | {values} | {r['grade']} |"
        )
    count = Counter(r["grade"] for r in rows)
    return "\n".join([*lines, "", f"Of {len(rows)}: " + ", ".join(f"{count[g]} {g}" for g in GRADES) + "."])


def run(every: Makers, title: str, description: str | None, arguments: list[str] | None) -> int:
    """Write the cases of a set, diagnose those without an answer and print the table; the files have its title."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="0 for the streams of the first run")
    parser.add_argument("--only", nargs="*", default=[], help="names of cases, or beginnings of them")
    parser.add_argument("--out", type=Path, default=Path(title), help="folder of cases and answers")
    parser.add_argument("--write-only", action="store_true", help="write the cases and diagnose nothing")
    args = parser.parse_args(arguments)
    own = args.out / f"seed_{args.seed}"  # answers stay, so each seed has a folder
    cases = generated(every, args.seed, args.only)
    if not cases:
        print("no case has such a name; nothing was run", file=sys.stderr)
        return 2
    for case in cases:
        write(case, own / "cases" / case.name)
    if args.write_only:
        return 0
    rows: list[dict[str, Any]] = []
    for k, case in enumerate(cases):
        print(f"{k + 1} of {len(cases)}: {case.name} …", file=sys.stderr, flush=True)
        rows.append(row_of(case, diagnosed(own / "cases" / case.name, own / "told" / case.name)))
        (own / f"{title}.md").write_text(table(rows) + "\n", encoding="utf-8")
        (own / f"{title}.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table(rows))
    return 1 if any(r["grade"] == "wrong" for r in rows) else 0


def main(arguments: list[str] | None = None) -> int:
    """Write, diagnose and grade the cases of this set."""
    return run(SECOND, "second_author", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
