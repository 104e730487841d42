"""Hide the physics of textbook systems, integrated here apart from the package, and ask the diagnosis for it.

    python tests/studies/textbook.py [--seed 1] [--only NAME …] [--out FOLDER] [--write-only]

Oscillators, vehicles, aircraft, ships, tanks, ovens and machines from the literature of each field: the model of a case
lacks one or two effects that the recording has, or nothing. Their equations stand in textbook_plants.py and
textbook_machines.py, integrated by Runge–Kutta steps of a twentieth of a sample or finer; values start up to a fifth
off. Each case has case.toml and truth.json, and known.py diagnoses and judges them; the same exit codes.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import known
from textbook_machines import MACHINES
from textbook_plants import PLANTS, Case

_CASE = """[case]
title = "{name}"
[recordings]
files = {files}
roles = "roles.toml"
[baseline]
kind = "equations"
file = "model.toml"
[context]
machine = "rig"
"""


def truth_of(case: Case) -> dict[str, object]:
    """Return what known.py judges by: of a null any verdict without an effect but a wrong value."""
    if not case.hidden:
        return {"verdict": list(case.verdicts or ("no_mismatch", "parameter", "immaterial")), "ids": []}
    alike = ["ambiguous"] if case.accepted else []  # with one input a dead time and an offset of clocks are one
    return {
        "verdict": ["named", "multiple", *alike, *case.verdicts], "ids": list(case.hidden),
        "also_accepted": list(case.accepted),
        "parameters": {k: {"value": v, "tolerance": 0.1} for k, v in case.values.items()},
    }  # fmt: skip


def write(case: Case, folder: Path) -> None:
    """Write recording, roles, model, case and truth."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [*case.inputs, *case.outputs]
    files = ["recording.csv"] if case.parts == 1 else [f"recording_{k + 1}.csv" for k in range(case.parts)]
    for name, rows in zip(files, np.array_split(np.column_stack([*case.columns.values()]), case.parts), strict=True):
        table = np.column_stack([case.step * np.arange(len(rows)), rows])
        header = ",".join(["time_s", *case.columns])
        np.savetxt(folder / name, table, delimiter=",", header=header, comments="", fmt="%.9g")
    roles = [f'[recording]\nsample_time_s = {case.step!r}\ntime = "time_s"\n']
    for name in names:
        role = "input" if name in case.inputs else "output"
        roles.append(f'[[channel]]\nname = "{name}"\nunit = "1"\nrole = "{role}"\n')
    (folder / "roles.toml").write_text("".join(roles), encoding="utf-8")
    (folder / "model.toml").write_text(case.model, encoding="utf-8")
    (folder / "case.toml").write_text(_CASE.format(name=case.name, files=json.dumps(files)), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(truth_of(case), indent=1) + "\n", encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Write the cases, diagnose and judge them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[], help="names of cases, or beginnings of them")
    parser.add_argument("--out", type=Path, default=Path("textbook"), help="folder of cases and answers")
    parser.add_argument("--write-only", action="store_true", help="write the cases and diagnose nothing")
    args = parser.parse_args(arguments)
    for number, plant in enumerate(PLANTS + MACHINES):  # cases are called after their plants
        own = plant.__name__
        if args.only and not any(word.startswith(own) or own.startswith(word) for word in args.only):
            continue
        for case in plant(np.random.default_rng([args.seed, number])):
            if not args.only or any(case.name.startswith(word) for word in args.only):
                write(case, args.out / "cases" / case.name)
    if args.write_only:
        return 0
    return known.main(["--cases", str(args.out / "cases"), "--out", str(args.out / "told")])


if __name__ == "__main__":
    sys.exit(main())
