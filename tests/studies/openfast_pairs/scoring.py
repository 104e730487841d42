"""Diagnose the cases of a part, print the table and keep its rows: the command `score` of the studies of pairs."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from openfast_pairs import answers, judging


def add_options(score: argparse.ArgumentParser) -> None:
    """Add what both studies' `score` may be told."""
    score.add_argument("--json", type=Path, metavar="FILE", help="rows of the table, for a later --before")
    score.add_argument("--before", type=Path, metavar="FILE", help="rows of an earlier version, to be held against")
    score.add_argument("--python", default=sys.executable, help="Python of the product that is asked")
    score.add_argument("--patience", type=float, default=600.0, metavar="S", help="time limit of a diagnosis")


def score(options: argparse.Namespace, part: str, say: Callable[[str], None]) -> int:
    """Score the cases of a part of options.folder; returns the exit code, 2 where there is none."""
    if not answers.cases_of(options.folder, part):
        say(f"{options.folder / part}: no case with its truth; make some first")
        return 2
    version = answers.version_of(options.python)
    diagnose = answers.diagnosed(options.python, options.patience)
    found = answers.answered(options.folder, part, version, diagnose, say)
    rows = [judging.judge(f["case"], f["truth"], f["answer"]) for f in found]
    print(judging.table(rows, version, part))
    if options.before is not None:
        before = json.loads(options.before.read_text(encoding="utf-8"))
        print(f"{before['version']} → {version}\n\n{judging.compared(before['rows'], rows)}")
    if options.json is not None:
        facts = {"version": version, "part": part, "rows": rows}
        options.json.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return 0
