"""Ask whether an answer depends on the processor: the same cases with linear algebra that rounds as others do.

    python tests/studies/rounding.py FOLDER … [--kernels Prescott Sandybridge Haswell] [--workers 2] [--out FILE]

FOLDER is a case or holds cases. Each is diagnosed (without sham runs) once with each kernel of OpenBLAS, which differ
in the order they sum in, so in rounding alone; any processor with AVX2 has these three. A line for each case: what is
said, the sealed gain and the first value by kernel. Each line of FILE is one case; run again it goes on where it
stopped. Exit code 1 where verdict or names differ, 2 where there is no case.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

KERNELS = ("Prescott", "Sandybridge", "Haswell")
Facts = dict[str, Any]


def cases_in(folders: list[Path]) -> list[Path]:
    """Return the folders with a case.toml among these and what they hold."""
    return [c for f in folders if f.is_dir() for c in (f, *sorted(f.iterdir())) if (c / "case.toml").is_file()]


def said(case: Path, kernel: str) -> Facts:
    """Diagnose a case as on a processor with this kernel; returns verdict, names, sealed gain and first value."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(case), "--out", out, "--sham", "0"]
        env = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(
            command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env
        )
        if done.returncode:
            return {
                "kernel": kernel,
                "verdict": f"exit code {done.returncode}: {done.stderr.strip()[-200:]}",
                "ids": [],
            }
        facts = json.loads((Path(out) / "diagnosis.json").read_text(encoding="utf-8"))
    values = [v["value"] for e in facts["effects"][:1] for v in e["parameters"].values()]
    return {
        "kernel": kernel, "verdict": facts["verdict"], "ids": [e["id"] for e in facts["effects"]],
        "gain": facts["sealed"]["log_likelihood_gain"], "value": values[0] if values else None,
    }  # fmt: skip


def is_the_same(row: Facts) -> bool:
    """Tell whether verdict and names are those of every kernel."""
    return len({(a["verdict"], tuple(sorted(a["ids"]))) for a in row["answers"]}) == 1


def line(row: Facts) -> str:
    """Return one case as a line of text."""
    parts = [
        f"{a['kernel']}: {a['verdict']} {', '.join(a['ids']) or '–'}, {a.get('gain') or 0.0:.1f} nats"
        + ("" if a.get("value") is None else f", {a['value']:.4g}")
        for a in row["answers"]
    ]
    return f"{'' if is_the_same(row) else 'DIFFERS '}{row['case']}: " + "; ".join(parts)


def main(arguments: list[str] | None = None) -> int:
    """Diagnose what FILE does not hold yet, print a line each and the count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--kernels", nargs="+", default=list(KERNELS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("build/rounding.jsonl"))
    o = parser.parse_args(arguments)
    cases = cases_in(o.folders)
    if not cases:
        print(f"no case.toml in {', '.join(map(str, o.folders))}", file=sys.stderr)
        return 2
    o.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(text) for text in o.out.read_text().splitlines()] if o.out.exists() else []
    rows = [row for row in rows if [a["kernel"] for a in row["answers"]] == o.kernels]
    known = {row["case"] for row in rows}
    with ThreadPoolExecutor(o.workers) as pool, o.out.open("a") as file:
        for case in cases:
            if str(case) in known:
                continue
            rows.append({"case": str(case), "answers": list(pool.map(lambda k, c=case: said(c, k), o.kernels))})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            print(line(rows[-1]), flush=True)
    rows = [row for row in rows if row["case"] in {str(c) for c in cases}]
    same = sum(is_the_same(row) for row in rows)
    print(f"{same} of {len(rows)} answers are the same with {', '.join(o.kernels)}")
    return 0 if same == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
