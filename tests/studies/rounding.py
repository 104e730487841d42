"""Ask whether an answer depends on the processor: the same diagnoses with the instructions that others have.

    python tests/studies/rounding.py FOLDER … [--sets sse avx2 avx512] [--workers 2] [--out FILE]
    python tests/studies/rounding.py --tests [--sets …] [--out FILE] [-- ARGUMENTS OF PYTEST]

FOLDER is a case or holds cases. Each is diagnosed (without sham runs) once with each instruction set. With --tests the
diagnosis tests are run instead, whole, once with each set: what they assert must hold, and every diagnosis.json they
write is an answer. A set chooses the kernels of OpenBLAS, the loops of numpy, the code that LLVM makes of models and
loops, and the mathematical functions of the C library: they differ in the order they sum in and in fused products, so
in rounding alone. Sets beyond this processor are left out by name; `common` is what aeolid chooses by itself.

A line for each case: what is said, and by how many of its standard deviations the value furthest off moves. Each line
of FILE is one case; run again it goes on where it stopped. Exit code 1 where verdict or names differ, a value moves by
more than a tenth of its standard deviation or a test fails, 2 where there is nothing to ask.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from pathlib import Path
from typing import Any

from aeolid import arithmetic

ROOT = Path(__file__).resolve().parents[2]
MOST_MOVED = 0.1  # of a value's standard deviation: nobody reads a difference of that size
EXACT = 1e-6  # relative, for values without a deviation
_LOOPS_512 = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4"
_LOOPS_256 = f"AVX FMA3 AVX2 X86_V3 {_LOOPS_512}"  # numpy's names, old and new; what it does not know it passes over
SETS: dict[str, dict[str, str]] = {
    "common": {},  # what aeolid itself chooses where a processor has AVX2
    "native": {},
    "sse": {
        "OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": _LOOPS_256, "NUMBA_CPU_NAME": "nehalem",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
    },
    "avx": {
        "OPENBLAS_CORETYPE": "Sandybridge", "NPY_DISABLE_CPU_FEATURES": _LOOPS_256, "NUMBA_CPU_NAME": "sandybridge",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
    },
    "avx2": {
        "OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": _LOOPS_512, "NUMBA_CPU_NAME": "haswell",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F",
    },
    "zen": {
        "OPENBLAS_CORETYPE": "Zen", "NPY_DISABLE_CPU_FEATURES": _LOOPS_512, "NUMBA_CPU_NAME": "znver2",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F",
    },
    "avx512": {"OPENBLAS_CORETYPE": "SkylakeX", "NUMBA_CPU_NAME": "skylake-avx512"},
}  # fmt: skip
_NEEDS = {"avx": "avx", "avx2": "avx2", "zen": "avx2", "avx512": "avx512f"}  # as /proc/cpuinfo calls it
_VARIABLES = {v for s in SETS.values() for v in s} | {"NUMBA_CPU_FEATURES", arithmetic.VARIABLE}
Facts = dict[str, Any]


def cases_in(folders: list[Path]) -> list[Path]:
    """Return the folders with a case.toml among these and what they hold."""
    return [c for f in folders if f.is_dir() for c in (f, *sorted(f.iterdir())) if (c / "case.toml").is_file()]


def can_run(name: str) -> bool:
    """Tell whether this processor has the instructions of a set; where nobody tells, it has."""
    told = Path("/proc/cpuinfo")
    need = _NEEDS.get(name)
    return need is None or not told.is_file() or need in told.read_text(encoding="utf-8").split()


def surroundings(name: str) -> dict[str, str]:
    """Return the environment in which a process computes with this set alone, on one thread."""
    env = {k: v for k, v in os.environ.items() if k not in _VARIABLES}
    env |= {} if name == "common" else {arithmetic.VARIABLE: arithmetic.NATIVE}
    chosen = SETS[name]
    if "NUMBA_CPU_NAME" in chosen:
        env["NUMBA_CPU_FEATURES"] = ""  # those of the named processor, not this one's
    return env | chosen | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def facts_of(diagnosis: Facts) -> Facts:
    """Return what counts of a diagnosis.json: verdict, names with places, sealed gain, values with deviations."""
    return {
        "verdict": diagnosis["verdict"], "ids": [e["id"] for e in diagnosis["effects"]],
        "gain": (diagnosis.get("sealed") or {}).get("log_likelihood_gain"),
        "values": {
            f"{e['id']} {e['location']['entry']} {name}": [v["value"], v["std"]]
            for e in diagnosis["effects"] for name, v in e["parameters"].items()
        },
    }  # fmt: skip


def said(case: Path, name: str) -> Facts:
    """Diagnose a case with an instruction set; returns what counts, or the reason why there is nothing."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", out, "--sham", "0"]
        done = subprocess.run(
            [*command, "--no-report"], check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            env=surroundings(name),
        )  # fmt: skip
        if done.returncode:
            reason = f"exit code {done.returncode}: {done.stderr.strip()[-200:]}"
            return {"set": name, "verdict": reason, "ids": [], "gain": None, "values": {}}
        facts = json.loads((Path(out) / "diagnosis.json").read_text(encoding="utf-8"))
    return {"set": name, **facts_of(facts)}


def moved(row: Facts) -> tuple[float, str]:
    """Return the largest distance between two sets' values, in standard deviations, and which value it is."""
    worst = (0.0, "")
    for one, other in combinations(row["answers"], 2):
        for name in one["values"].keys() & other["values"].keys():
            (a, s), (b, t) = one["values"][name], other["values"][name]
            if a is None or b is None:
                distance = 0.0 if a is b else float("inf")
            else:
                unit = max(s or 0.0, t or 0.0) or EXACT / MOST_MOVED * max(abs(a), abs(b))
                distance = abs(a - b) / unit if a != b else 0.0
            worst = max(worst, (distance, name))
    return worst


def says_the_same(row: Facts) -> bool:
    """Tell whether every set has an answer with one verdict, the same names and the same places."""
    answers = {(a["verdict"], tuple(sorted(a["ids"])), tuple(sorted(a["values"]))) for a in row["answers"]}
    return len(answers) == 1


def is_the_same(row: Facts) -> bool:
    """Tell whether the answers differ in nothing that anybody would notice."""
    return says_the_same(row) and moved(row)[0] <= MOST_MOVED


def line(row: Facts) -> str:
    """Return one case as a line of text."""
    parts = [
        f"{a['set']}: {a['verdict']} {', '.join(a['ids']) or '–'}, {a['gain'] or 0.0:.1f} nats" for a in row["answers"]
    ]
    distance, name = moved(row)
    text = f"{'' if is_the_same(row) else 'DIFFERS '}{row['case']}: {'; '.join(parts)}"
    if not name:
        return text
    told = [
        "beyond the data" if v is None else f"{v:.5g}" for a in row["answers"] for v in a["values"].get(name, [])[:1]
    ]
    return f"{text}; {name} {', '.join(told)}: {distance:.2g} deviations apart"


def ask_cases(o: argparse.Namespace, sets: list[str]) -> list[Facts]:
    """Diagnose what FILE does not hold yet; a line each."""
    cases = cases_in(o.folders)
    rows = [json.loads(text) for text in o.out.read_text().splitlines()] if o.out.exists() else []
    rows = [r for r in rows if [a["set"] for a in r["answers"]] == sets and r["case"] in {str(c) for c in cases}]
    known = {row["case"] for row in rows}
    with ThreadPoolExecutor(o.workers) as pool, o.out.open("a") as file:
        waiting = {c: [pool.submit(said, c, s) for s in sets] for c in cases if str(c) not in known}
        for case, answers in waiting.items():
            rows.append({"case": str(case), "answers": [a.result() for a in answers]})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]), flush=True)
    return rows


def ask_tests(o: argparse.Namespace, sets: list[str]) -> tuple[list[Facts], list[str]]:
    """Run the diagnosis tests with every set; returns a row a diagnosis.json, and the sets whose tests failed."""
    found: dict[str, list[Facts]] = {}
    failed = []
    for name in sets:
        with tempfile.TemporaryDirectory() as folder:
            answers = Path(folder) / "answers"
            command = [sys.executable, "-m", "pytest", "-c", "tools/pyproject.toml", "--rootdir", ".", "-q", "-n",
                       str(o.workers), "-m", "diagnosis and not nightly", *(o.pytest or ["tests/host"])]  # fmt: skip
            env = surroundings(name) | {"AEOLID_ANSWERS": str(answers)}
            print(f"== {name}", flush=True)
            if subprocess.run(command, check=False, cwd=ROOT, env=env).returncode:
                failed.append(name)
            for file in sorted(answers.glob("*.jsonl")):
                for row in map(json.loads, file.read_text(encoding="utf-8").splitlines()):
                    found.setdefault(row["test"], []).append({"set": name, **facts_of(row["diagnosis"])})
    rows = []
    for test, answers in sorted(found.items()):
        silent = [s for s in sets if s not in {a["set"] for a in answers}]
        none = [{"set": s, "verdict": "no answer", "ids": [], "gain": None, "values": {}} for s in silent]
        rows.append({"case": test, "answers": [*answers, *none]})
        print(line(rows[-1]), flush=True)
    o.out.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return rows, failed


def main(arguments: list[str] | None = None) -> int:
    """Ask with every set, print a line a case and the count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--tests", action="store_true", help="run the diagnosis tests; what follows -- goes to pytest")
    parser.add_argument("--sets", nargs="+", default=["sse", "avx2", "avx512"], choices=list(SETS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("build/rounding.jsonl"))
    given = list(sys.argv[1:] if arguments is None else arguments)
    cut = given.index("--") if "--" in given else len(given)
    o = parser.parse_args(given[:cut])
    o.pytest = given[cut + 1 :]
    if not o.tests and not cases_in(o.folders):
        print(f"no case.toml in {', '.join(map(str, o.folders)) or 'no folder'}", file=sys.stderr)
        return 2
    o.out.parent.mkdir(parents=True, exist_ok=True)
    sets = [s for s in o.sets if can_run(s)]
    for name in o.sets:
        if name not in sets:
            print(f"{name} left out: this processor has no {_NEEDS[name]}", file=sys.stderr)
    rows, failed = ask_tests(o, sets) if o.tests else (ask_cases(o, sets), [])
    if o.tests and not rows:
        print("no test wrote a diagnosis", file=sys.stderr)
        return 2
    same = sum(is_the_same(row) for row in rows)
    print(f"{same} of {len(rows)} answers are the same with {', '.join(sets)}")
    if failed:
        print(f"tests failed with {', '.join(failed)}")
    return 0 if same == len(rows) and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
