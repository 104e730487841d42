"""Identify drawn plants with the command's defaults and count what holds, what is refused or marked, what is silent.

    python tests/studies/identify_stress.py [--plants 200] [--seed 1] [--jobs 2] [--out FOLDER] [--longest 100000]

Each plant (stress_plants.py) is written as recordings and roles, identified by `aeolid identify`, with no option where
the command asks for none, and judged (stress_judge.py). Where --past has to be given it is one period of the slowest
mode, as README says, and no more than the recordings allow. Rows go to stress.jsonl as they come, and a run that was
stopped goes on from there; the table to stress.txt.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import io
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from stress_judge import BAND, FAR, judge, silent, worst
from stress_plants import LONGEST, SHORTEST, Drawn, draw

Row = dict[str, Any]
LEAST_PAST = 8


def options(drawn: Drawn) -> list[str]:
    """Return the options that `aeolid identify` cannot do without: the window, where it has no default."""
    from aeolid.cli.identify import identify

    if inspect.signature(identify).parameters["past"].default is not inspect.Parameter.empty:
        return []
    slowest = min(float(np.angle(z)) for z in drawn.poles if z.imag > 0)
    channels = drawn.recordings[0].shape[1]
    most = int(0.5 * min(len(p) for p in drawn.recordings) / (channels + 1))
    return ["--past", str(max(min(round(2 * np.pi / slowest), most), min(LEAST_PAST, most)))]


def write(drawn: Drawn, folder: Path) -> list[Path]:
    """Write recordings (.npz) and roles.toml; returns the recordings' paths."""
    r, h = drawn.plant.B.shape[1], drawn.plant.sample_time_s
    names = [f"u{i + 1}" for i in range(r)] + [f"y{i + 1}" for i in range(len(drawn.plant.C))]
    lines = ["[recording]", f"sample_time_s = {h!r}"]
    for i, name in enumerate(names):
        role = "input" if i < r else "output"
        lines += ["[[channel]]", f'name = "{name}"', 'unit = ""', f'role = "{role}"']
    (folder / "roles.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    paths = []
    for number, values in enumerate(drawn.recordings):
        paths.append(folder / f"recording{number}.npz")
        np.savez(paths[-1], **dict(zip(names, values.T, strict=True)))
    return paths


def identify(drawn: Drawn) -> tuple[int, dict[str, Any] | None, str]:
    """Run the command; returns exit code, JSON facts (None where none were written) and what it said on an error."""
    from aeolid.cli.main import main as aeolid

    with tempfile.TemporaryDirectory() as name:
        folder, said = Path(name), io.StringIO()
        paths, facts = write(drawn, folder), folder / "facts.json"
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            code = aeolid(["identify", *map(str, paths), "--roles", str(folder / "roles.toml"), *options(drawn),
                           "--out", str(folder / "model.json"), "--json", str(facts)])  # fmt: skip
        found = json.loads(facts.read_text(encoding="utf-8")) if facts.exists() else None
    return code, found, said.getvalue().replace(str(folder), "").strip()[-300:]


def one(seed: int, number: int, longest: int = LONGEST) -> Row:
    """Draw, identify and judge one plant."""
    drawn = draw(seed, number)
    if drawn.samples > longest:
        drawn = draw(seed, number, longest)
    start = time.process_time()
    code, facts, said = identify(drawn)
    row = judge(drawn, code, facts) | {"seed": seed, "number": number, "seconds": time.process_time() - start}
    return row | ({"said": said} if facts is None else {})


def share(part: int, whole: int) -> str:
    """Return a count and its percentage."""
    return f"{part}/{whole} {100 * part / whole:.1f} %" if whole else "–"


def counts(rows: list[Row]) -> list[str]:
    """Return the columns of the table for these plants."""
    answered = [r for r in rows if r["outcome"] == "answered"]
    bare = [r for r in answered if not r["marked"]]

    def held(kinds: tuple[str, ...]) -> str:
        each = [d[k] for r in bare for m in r["modes"] for k in kinds if k in (d := m.get("deviations", {}))]
        return share(sum(e <= BAND for e in each), len(each))

    poles = [m for r in bare for m in r["modes"]]
    far = sum(worst({"modes": [m]}) > FAR for m in poles)
    return [
        str(len(rows)), share(sum(r["outcome"] == "refused" for r in rows), len(rows)),
        share(len(answered) - len(bare), len(rows)), str(sum(r["outcome"] == "failed" for r in rows)),
        held(("frequency", "rate")), held(("damping",)), held(("peak",)),
        share(sum(m["missed"] for m in poles), len(poles)), share(far, len(poles)),
        share(sum(map(silent, rows)), len(rows)),
    ]  # fmt: skip


HEAD = ["plants", "refused", "marked", "failed", "frequency held", "damping held", "peak held", "missed",
        "poles far, no word", "plants far, no word"]  # fmt: skip


def table(rows: list[Row]) -> str:
    """Return all plants and each class as Markdown; bands and poles are those of answers without a mark."""
    lines = ["| | " + " | ".join(HEAD) + " |", "|---" * (len(HEAD) + 1) + "|"]
    groups: list[tuple[str, Callable[[Row], bool]]] = [("all", lambda _: True)]
    words = sorted({w for r in rows for w in r["classes"]})
    groups += [(w, lambda r, w=w: w in r["classes"]) for w in words]  # type: ignore[misc]
    for name, belongs in groups:
        lines.append(f"| {name} | " + " | ".join(counts([r for r in rows if belongs(r)])) + " |")
    lines += ["", f"Far: more than {FAR:.0f} deviations, or an excited pole missed. Silent:", ""]
    for r in sorted(filter(silent, rows), key=lambda r: r["number"]):
        bad = [m for m in r["modes"] if worst({"modes": [m]}) > FAR]
        what = ", ".join(
            f"{m['hz']:.4g} Hz " + ("missed" if m["missed"] else f"{worst({'modes': [m]}):.1f}") for m in bad
        )
        lines.append(f"- {r['seed']}/{r['number']} N {r['samples']}, p {r['past']}, order {r['order']} of {r['truth']} "
                     f"({', '.join(r['classes'])}): {what}")  # fmt: skip
    return "\n".join(lines)


def run(seed: int, numbers: list[int], jobs: int, longest: int) -> Iterator[Row]:
    """Yield the rows as they come."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # a second thread of each process only waits
    with ProcessPoolExecutor(jobs) as pool:
        waiting = {pool.submit(one, seed, n, longest): n for n in numbers}
        for done in as_completed(waiting):
            yield done.result()


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description="Identify drawn plants with the command's defaults and judge them.")
    parser.add_argument("--plants", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="number of the first plant")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--longest", type=int, default=LONGEST, help=f"samples, {SHORTEST} to {LONGEST}")
    parser.add_argument("--out", type=Path, default=Path("build/studies"))
    asked = parser.parse_args(arguments)
    asked.out.mkdir(parents=True, exist_ok=True)
    file = asked.out / "stress.jsonl"
    old = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []
    wanted = range(asked.first, asked.first + asked.plants)
    rows = [r for r in old if r["seed"] == asked.seed and r["number"] in wanted]
    left = sorted(set(wanted) - {r["number"] for r in rows})
    with file.open("a", encoding="utf-8") as handle:
        for row in run(asked.seed, left, asked.jobs, asked.longest) if left else ():
            rows.append(row)
            handle.write(json.dumps(row) + "\n")
            handle.flush()
            print(f"\r{len(rows)} of {asked.plants}", end="", file=sys.stderr)
    print(file=sys.stderr)
    text = table(rows)
    print(text)
    (asked.out / "stress.txt").write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
