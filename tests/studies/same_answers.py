"""Compare two folders of diagnoses of the same cases: has a change of the code changed an answer?

    python tests/studies/same_answers.py BEFORE AFTER [--relative 1e-9]

Each folder holds, at any depth, what `aeolid diagnose --out` (diagnosis.json) or `aeolid challenge run` (result.json)
leaves behind; files are paired by their path below the two folders. Compared are verdict, effects (names, places,
values, deviations), the location of what has no name, the gain on the sealed data with its interval, what is not
excluded and the next experiment: texts and lengths exactly, numbers to a relative difference. One line a difference; a
case that one side alone has is one, too. Exit code 1 where there is a difference, 2 where there is nothing to compare.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

COMPARED = ("verdict", "effects", "location", "sealed", "not_excluded", "next_experiment")
UNREAD = {"series", "spectra", "profile"}  # of the sealed data, for pictures


def answers_in(folder: Path) -> dict[str, Any]:
    """Return the compared part of every diagnosis below a folder, by the path of the folder that it lies in."""
    found = {}
    for path in sorted([*folder.rglob("diagnosis.json"), *folder.rglob("result.json")]):
        facts = json.loads(path.read_text(encoding="utf-8"))
        said = facts.get("diagnosis") if path.name == "result.json" else facts
        if said is None and path.name == "result.json":
            said = {"verdict": f"none: {facts.get('outcome')}"}
        name = path.parent.parent if path.parent.name == "diagnosis" else path.parent
        found[str(name.relative_to(folder))] = {key: said.get(key) for key in COMPARED}
    return found


def differences(before: Any, after: Any, relative: float, place: str = "") -> Iterator[str]:
    """List where two answers differ: `place: before → after`."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [k for k in {**before, **after} if k not in UNREAD]:
            yield from differences(before.get(key), after.get(key), relative, f"{place}.{key}".lstrip("."))
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for i, (one, other) in enumerate(zip(before, after, strict=True)):
            yield from differences(one, other, relative, f"{place}[{i}]")
    elif not _alike(before, after, relative):
        yield f"{place}: {_short(before)} → {_short(after)}"


def _alike(before: Any, after: Any, relative: float) -> bool:
    if before == after:
        return True
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (before, after))
    return numbers and math.isclose(before, after, rel_tol=relative, abs_tol=0.0)


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}…"


def compare(before: Path, after: Path, relative: float) -> tuple[list[str], int, int]:
    """Return the differences of two folders, the number of cases, and that of cases with a difference."""
    one, other = answers_in(before), answers_in(after)
    lines, cases = [], sorted({**one, **other})
    differ = 0
    for case in cases:
        if case not in one or case not in other:
            found = [f"only {'before' if case in one else 'after'}"]
        else:
            found = list(differences(one[case], other[case], relative))
        differ += bool(found)
        lines += [f"{case}: {text}" for text in found]
    return lines, len(cases), differ


def main(arguments: list[str] | None = None) -> int:
    """Compare and print; see the module's text."""
    parser = argparse.ArgumentParser(description="Compare two folders of diagnoses of the same cases.")
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--relative", type=float, default=1e-9, help="largest relative difference of a number")
    options = parser.parse_args(arguments)
    lines, cases, differ = compare(options.before, options.after, options.relative)
    for line in lines:
        print(line)
    print(f"{cases - differ} of {cases} answers are the same to {options.relative:g}")
    return 2 if not cases else int(differ > 0)


if __name__ == "__main__":
    raise SystemExit(main())
