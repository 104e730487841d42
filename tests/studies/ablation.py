"""Ask of every decision rule which stored answers owe something to it, and what they would be without it.

    python tests/studies/ablation.py table SOURCE… [--json FILE]
    python tests/studies/ablation.py try FOLDER SOURCE… --rule SECTION.NAME=VALUE [--rule …] [--most N] [--workers 2]

A source is a folder of answers that were given with the margins of the rules: `challenge:DIR` (after `aeolid challenge
run`), `pairs:FOLDER:PART` (after `openfast_corpus.py` or `other_turbines.py score`), `known:OUT` (after `known.py --out
OUT`). `table` counts without a fit, for each rule and source, the answers that may be others were the rule half or
twice as large, or at either end of what it may be: where that is none at one end, no stored answer needs the rule.
`try` diagnoses the answers that a change leaves open, at most N of each source drawn by a fixed seed, keeps what came
out in FOLDER, and tells won and lost: an answer that one may ask for (named, or in the set; no name where there is
none) and one that is wrong though sure, before and after. Exit code 2 where there is nothing to read.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import known  # noqa: E402
from openfast_pairs import answers as pairs  # noqa: E402
from openfast_pairs import judging  # noqa: E402

from aeolid.challenge.judge import judge as judge_challenge  # noqa: E402
from aeolid.challenge.rescore import out_of_margins  # noqa: E402
from aeolid.challenge.run import RESULT  # noqa: E402
from aeolid.challenge.score import good  # noqa: E402
from aeolid.challenge.write import open_answers  # noqa: E402
from aeolid.diagnose.rules import every_rule, rules_of  # noqa: E402
from aeolid.diagnose.rules.declaring import Rule, ends_of  # noqa: E402

Facts = dict[str, Any]
Wanted = dict[str, dict[str, float]]
HIGHEST = 1e12  # stands for no end
DEFAULTS = {r.name: r.value for r in every_rule()}
GOOD = ("name", "open")


@dataclass(frozen=True)
class Stored:
    """Hold one stored answer; judged: an answer's diagnosis → (what one may ask for, wrong though sure)."""

    source: str
    case: Path
    margins: Facts
    diagnosis: Facts
    judged: Callable[[Facts], tuple[bool, bool]]

    def may_change(self, wanted: Wanted) -> bool:
        """Tell whether a rule of these values lies out of the answer's margins."""
        return bool(out_of_margins({"settings": {}, "margins": self.margins}, wanted, DEFAULTS))


def of_challenge(folder: str) -> Iterator[Stored]:
    """Yield the answers of a challenge, as far as it has been run."""
    root = Path(folder)
    truth = open_answers(root)["answers"]

    def judged(name: str, diagnosis: Facts) -> tuple[bool, bool]:
        found = judge_challenge(
            name, truth[name], {"outcome": "done", "reason": "", "seconds": 0.0, "diagnosis": diagnosis}
        )
        return good(found), found.wrong_but_confident

    for name in truth:
        file = root / "results" / name / RESULT
        r = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {"outcome": "none"}
        if r["outcome"] == "done" and r.get("margins") is not None:
            yield Stored(
                f"challenge {root.name}", root / name, r["margins"], r["diagnosis"], lambda d, n=name: judged(n, d)
            )


def of_pairs(folder: str, part: str) -> Iterator[Stored]:
    """Yield the answers to the pairs of a part, each of the product's version that was asked last for it."""
    root = Path(folder)
    versions = sorted((root / "answers").glob("*/"), key=lambda p: p.stat().st_mtime, reverse=True)

    def judged(case: Path, answer: Facts, diagnosis: Facts) -> tuple[bool, bool]:
        truth = json.loads(pairs.truth_file(case).read_text(encoding="utf-8"))
        row = judging.judge(case.name, truth, {**answer, "diagnosis": diagnosis})
        return row["outcome"] in (("nothing",) if truth["effect"] == "null" else GOOD), row["outcome"] == "sure"

    for case in pairs.cases_of(root, part):
        files = (folder / f"{case.name}.json" for folder in versions)
        answers = (json.loads(file.read_text(encoding="utf-8")) for file in files if file.is_file())
        answer = next((a for a in answers if a.get("margins") is not None), None)
        if answer is not None:
            yield Stored(f"pairs {root.name}", case, answer["margins"], answer["diagnosis"],
                         lambda d, c=case, a=answer: judged(c, a, d))  # fmt: skip


def of_known(folder: str) -> Iterator[Stored]:
    """Yield the answers to the recordings and runs of others."""

    def judged(case: Path, diagnosis: Facts) -> tuple[bool, bool]:
        row = known.judge(json.loads((case / "truth.json").read_text(encoding="utf-8")), diagnosis)
        wrong = diagnosis["verdict"] in judging.SURE and not (row["verdict_ok"] and row["ids_ok"])
        return bool(row["verdict_ok"] and row["ids_ok"]), wrong

    for out in sorted(Path(folder).glob("*/margins.json")):
        case = known.CASES / out.parent.name
        margins = json.loads(out.read_text(encoding="utf-8"))["margins"]
        diagnosis = json.loads((out.parent / "diagnosis.json").read_text(encoding="utf-8"))
        sort = "simulator" if case.name.startswith("openfast") else "real"
        yield Stored(f"known {sort}", case, margins, diagnosis, lambda d, c=case: judged(c, d))


READERS: dict[str, Callable[..., Iterator[Stored]]] = {"challenge": of_challenge, "pairs": of_pairs, "known": of_known}


def stored(sources: Sequence[str]) -> list[Stored]:
    """Return every answer with margins of the sources, `KIND:FOLDER[:PART]` each."""
    found: list[Stored] = []
    for source in sources:
        kind, *where = source.split(":")
        if kind not in READERS:
            raise SystemExit(f"{source}: begins with none of {', '.join(READERS)}")
        found += READERS[kind](*where)
    return found


def changes(rule: Rule) -> dict[str, float]:
    """Return the values at which a rule is tried: at both ends of what it may be, and half and twice its own."""
    low, high = ends_of(rule.unit, isinstance(rule.value, int))
    wanted = {"lowest": low or 1e-12, "half": rule.value / 2, "twice": rule.value * 2, "highest": min(high, HIGHEST)}
    kind = int if isinstance(rule.value, int) else float
    return {how: kind(min(max(v, low), high)) for how, v in wanted.items()}


def one(name: str, value: float) -> Wanted:
    """Return the file of rules in which one differs."""
    section, own = name.split(".")
    return {section: {own: value}}


def table(found: Sequence[Stored], target: Path | None) -> None:
    """Print, for each rule, how many answers of each source may be others at each change."""
    sources = sorted({s.source for s in found})
    counts: dict[str, dict[str, dict[str, int]]] = {}
    for rule in every_rule():
        counts[rule.name] = {
            how: {
                source: sum(s.may_change(one(rule.name, v)) for s in found if s.source == source) for source in sources
            }
            for how, v in changes(rule).items()
        }
    total = {source: sum(s.source == source for s in found) for source in sources}
    print("answers: " + ", ".join(f"{source} {n}" for source, n in total.items()))
    head = ["rule", *(f"{source}: lowest, half, twice, highest" for source in sources)]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for name, ways in counts.items():
        cells = [" ".join(str(ways[how][source]) for how in ways) for source in sources]
        print("| " + " | ".join([f"`{name}`", *cells]) + " |")
    idle = [n for n, ways in counts.items() if any(not sum(by.values()) for by in (ways["lowest"], ways["highest"]))]
    print(f"\nno stored answer needs {len(idle)} of {len(counts)}:\n  " + "\n  ".join(idle))
    for source, names in asked_by_one(counts).items():
        print(f"\n{source} alone needs {len(names)}:\n  " + "\n  ".join(names))
    if target is not None:
        target.write_text(json.dumps({"answers": total, "rules": counts}, indent=1) + "\n", encoding="utf-8")


def asked_by_one(counts: dict[str, dict[str, dict[str, int]]]) -> dict[str, list[str]]:
    """Return of each source the rules that it alone needs: nobody would have found them with the other sources.

    A source needs a rule where at either end of what the rule may be some of its answers may be others.
    """
    found: dict[str, list[str]] = {}
    for name, ways in counts.items():
        sources = [s for s in ways["lowest"] if ways["lowest"][s] and ways["highest"][s]]
        if len(sources) == 1:
            found.setdefault(sources[0], []).append(name)
    return found


def diagnose(s: Stored, rules: Path, folder: Path) -> Facts:
    """Return the answer to a case under a file of rules; kept in a folder, and used again."""
    kept = folder / f"{s.source.replace(' ', '_')}_{s.case.name}.json"
    if not kept.is_file():
        command = [sys.executable, "-m", "aeolid.cli.main", "diagnose", str(s.case), "--sham", "0", "--no-report"]
        with tempfile.TemporaryDirectory() as out:
            subprocess.run(
                [*command, "--rules", str(rules), "--out", f"{out}/out"],
                check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            file = Path(out) / "out" / "diagnosis.json"
            said = (
                json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {"verdict": "none", "effects": []}
            )
        kept.write_text(json.dumps(said) + "\n", encoding="utf-8")
    found: Facts = json.loads(kept.read_text(encoding="utf-8"))
    return found


@dataclass(frozen=True)
class Ending:
    """Hold an answer that was given again under other rules: (what one may ask for, wrong though sure) of each."""

    stored: Stored
    diagnosis: Facts
    before: tuple[bool, bool]
    after: tuple[bool, bool]

    @property
    def changed(self) -> bool:
        """Tell whether verdict or names are others."""
        return said(self.stored.diagnosis) != said(self.diagnosis)


@dataclass(frozen=True)
class Counts:
    """Count answers that were given again: changed, won, lost, wrong though sure before and after."""

    changed: int
    won: int
    lost: int
    sure_before: int
    sure_after: int


def again(found: Sequence[Stored], wanted: Wanted, folder: Path, most: int, workers: int) -> list[Ending]:
    """Diagnose what a change of rules leaves open, at most `most` drawn by a fixed seed; `folder` keeps the answers."""
    text = "".join(f"[{s}]\n" + "".join(f"{n} = {v!r}\n" for n, v in t.items()) for s, t in wanted.items())
    own = folder / sha256(text.encode()).hexdigest()[:12]
    own.mkdir(parents=True, exist_ok=True)
    (own / "rules.toml").write_text(text, encoding="utf-8")
    open_ = [s for s in found if s.may_change(wanted)]
    tried = random.Random(1).sample(open_, min(most, len(open_)))
    with ThreadPoolExecutor(workers) as pool:
        fresh = list(pool.map(lambda s: diagnose(s, own / "rules.toml", own), tried))
    return [Ending(s, d, s.judged(s.diagnosis), s.judged(d)) for s, d in zip(tried, fresh, strict=True)]


def counted(ends: Sequence[Ending]) -> Counts:
    """Count what became of answers that were given again."""
    won, lost = (sum(e.before[0] != e.after[0] and e.after[0] is way for e in ends) for way in (True, False))
    sure = sum(e.before[1] for e in ends), sum(e.after[1] for e in ends)
    return Counts(sum(e.changed for e in ends), won, lost, *sure)


def changed_lines(ends: Sequence[Ending]) -> list[str]:
    """List the answers that are others, one a line."""
    return [
        f"- {e.stored.source} {e.stored.case.name}: {said(e.stored.diagnosis)} → {said(e.diagnosis)}"
        f"{_mark(e.before, e.after)}"
        for e in ends
        if e.changed
    ]


def attempt(found: Sequence[Stored], wanted: Wanted, folder: Path, most: int, workers: int) -> None:
    """Diagnose what a change of rules leaves open and print what is won and lost by source."""
    print(
        f"{json.dumps(wanted)}\n\n| source | answers | may change | tried | changed | won | lost | wrong though sure |"
        f"\n|{'---|' * 8}"
    )
    lines = []
    for source in sorted({s.source for s in found}):
        mine = [s for s in found if s.source == source]
        ends = again(mine, wanted, folder, most, workers)
        c, open_ = counted(ends), sum(s.may_change(wanted) for s in mine)
        print(f"| {source} | {len(mine)} | {open_} | {len(ends)} | {c.changed} | {c.won} | {c.lost}"
              f" | {c.sure_before} → {c.sure_after} |")  # fmt: skip
        lines += changed_lines(ends)
    print("\n" + "\n".join(lines))


def said(diagnosis: Facts) -> str:
    """Return verdict and names of an answer."""
    return ": ".join(
        [diagnosis["verdict"], *([" + ".join(n)] if (n := [e["id"] for e in diagnosis["effects"]]) else [])]
    )


def _mark(before: tuple[bool, bool], after: tuple[bool, bool]) -> str:
    told = " (won)" if after[0] > before[0] else " (lost)" if after[0] < before[0] else ""
    return told + (" (now wrong, and sure)" if after[1] > before[1] else "")


def main(arguments: list[str] | None = None) -> int:
    """Print the table, or try a change."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    counting = commands.add_parser("table", help="count what may change, without a fit")
    counting.add_argument("source", nargs="+")
    counting.add_argument("--json", type=Path, metavar="FILE")
    trying = commands.add_parser("try", help="diagnose again what a change leaves open")
    trying.add_argument("folder", type=Path, help="folder of the answers")
    trying.add_argument("source", nargs="+")
    trying.add_argument("--rule", action="append", required=True, metavar="SECTION.NAME=VALUE")
    trying.add_argument("--most", type=int, default=1000, metavar="N", help="answers of each source that are tried")
    trying.add_argument("--workers", type=int, default=2)
    args = parser.parse_args(arguments)
    found = stored(args.source)
    if not found:
        print("no answer with margins in these sources", file=sys.stderr)
        return 2
    if args.command == "table":
        table(found, args.json)
        return 0
    wanted: Wanted = {}
    for text in args.rule:
        name, value = text.split("=")
        section, own = name.split(".")
        wanted.setdefault(section, {})[own] = json.loads(value)
    rules_of(wanted, "--rule")  # raises where one is unknown or out of its range
    attempt(found, wanted, args.folder, args.most, args.workers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
