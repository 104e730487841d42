"""Leave one source out: set the decision rules by the answers of all other sources, and diagnose the one left out.

    python tests/studies/left_out.py FOLDER NAME=SOURCE[,SOURCE…] NAME=… [--leave NAME …] [--most N] [--workers 2]

NAME is a source in the sense of this study (a machine, an author, a kind of recording), SOURCE a folder of answers as
`ablation.py` reads them; `pairs:FOLDER:PART:PREFIX` takes the cases whose names begin with PREFIX. Every answer has
margins: the interval in which a rule may lie with the same answer. The right answers of the others together allow a
rule an interval, too. Where that has two ends, the rule is set in its middle (geometric where both are positive);
where it is open to a side, the others do not decide and the rule stays. Under all rules so set at once the answers of
the source that was left out are given again, where its own margins do not tell that they stay, at most N drawn by a
fixed seed; FOLDER keeps them. The table tells what is won and lost by it, and how many rules the source needs that no
other source holds at all. Exit code 2 where there is nothing to read.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import ablation  # noqa: E402
from ablation import Stored, Wanted  # noqa: E402

from aeolid.diagnose.rules import every_rule, rules_of  # noqa: E402
from aeolid.diagnose.rules.declaring import Rule, ends_of  # noqa: E402

HEAD = (
    "left out", "answers", "right", "rules that others hold", "moved by, median", "most", "answers that may change",
    "tried", "changed", "won", "lost", "wrong though sure", "rules that it alone needs",
)  # fmt: skip


def answers_of(text: str) -> tuple[str, list[Stored]]:
    """Return name and answers of one argument NAME=SOURCE[,SOURCE…]."""
    name, _, sources = text.partition("=")
    found: list[Stored] = []
    for source in sources.split(","):
        kind, *where = source.split(":")
        prefix = where.pop() if kind == "pairs" and len(where) == 3 else ""
        found += [s for s in ablation.stored([":".join([kind, *where])]) if s.case.name.startswith(prefix)]
    return name, found


def allowed(rule: Rule, answers: Sequence[Stored]) -> tuple[float, float]:
    """Return the interval of a rule in which every one of these answers stays, as far as its margins go."""
    low, high = -math.inf, math.inf
    for s in answers:
        ends = s.margins.get(rule.name, (None, None))
        low = max(low, -math.inf if ends[0] is None else ends[0])
        high = min(high, math.inf if ends[1] is None else ends[1])
    return low, high


def middle(rule: Rule, low: float, high: float) -> float:
    """Return the middle of an interval that has two ends, as a value that the rule may take."""
    value = math.sqrt(low * high) if low > 0 else (low + high) / 2
    least, most = ends_of(rule.unit, isinstance(rule.value, int))
    value = min(max(value, least), most)
    return int(min(max(round(value), math.ceil(low)), math.floor(high))) if isinstance(rule.value, int) else value


def calibrated(others: Sequence[Stored]) -> dict[str, float]:
    """Return the rules that right answers of others hold from both sides, each in the middle of what they allow."""
    found = {}
    for rule in every_rule():
        low, high = allowed(rule, others)
        if math.isfinite(low) and math.isfinite(high):
            found[rule.name] = middle(rule, low, high) if low < high else rule.value
    return found


def needed_alone(own: Sequence[Stored], others: Sequence[Stored]) -> list[str]:
    """Return the rules that answers of a source hold from a side at least, and no answer of the others does."""
    return [r.name for r in every_rule() if _held(allowed(r, own)) and not _held(allowed(r, others))]


def _held(ends: tuple[float, float]) -> bool:
    return math.isfinite(ends[0]) or math.isfinite(ends[1])


def as_file(values: Mapping[str, float]) -> Wanted:
    """Return values by section and name, those alone that differ from the rules by default."""
    wanted: Wanted = {}
    for rule in every_rule():
        if rule.name in values and values[rule.name] != rule.value:
            section, own = rule.name.split(".")
            wanted.setdefault(section, {})[own] = values[rule.name]
    rules_of(wanted, "left out")  # raises where one is out of its range
    return wanted


def moves(values: Mapping[str, float]) -> list[float]:
    """Return by how much of itself each rule is moved."""
    defaults = ablation.DEFAULTS
    return [abs(v / defaults[n] - 1) for n, v in values.items() if defaults[n]]


def row(name: str, groups: Mapping[str, Sequence[Stored]], folder: Path, most: int, workers: int) -> list[str]:
    """Return the table's row of one source that is left out, and list on standard error what became another answer."""
    right = {n: [s for s in answers if s.judged(s.diagnosis)[0]] for n, answers in groups.items()}
    own, others = groups[name], [s for n, answers in right.items() if n != name for s in answers]
    values = calibrated(others)
    ends = ablation.again(own, as_file(values), folder / name, most, workers)
    counts, alone, moved = ablation.counted(ends), needed_alone(right[name], others), moves(values)
    for line in ablation.changed_lines(ends):
        print(line, file=sys.stderr)
    print(f"{name} alone needs: {', '.join(alone) or 'none'}", file=sys.stderr)
    may = sum(s.may_change(as_file(values)) for s in own)
    return [
        name, str(len(own)), str(len(right[name])), str(len(values)), f"{statistics.median(moved or [0.0]):.1%}",
        f"{max(moved or [0.0]):.0%}", str(may), str(len(ends)), str(counts.changed), str(counts.won), str(counts.lost),
        f"{counts.sure_before} → {counts.sure_after}", str(len(alone)),
    ]  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Print the table, a row for each source left out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder that keeps the answers under other rules")
    parser.add_argument("source", nargs="+", metavar="NAME=SOURCE[,SOURCE…]")
    parser.add_argument("--leave", nargs="*", default=[], help="sources to leave out, one after another (all)")
    parser.add_argument("--most", type=int, default=1000, metavar="N", help="answers of each source that are tried")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args(arguments)
    groups = dict(answers_of(text) for text in args.source)
    if len([n for n, answers in groups.items() if answers]) < 2:
        print("answers with margins of two sources are needed", file=sys.stderr)
        return 2
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for name in args.leave or groups:
        print("| " + " | ".join(row(name, groups, args.folder, args.most, args.workers)) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
