"""Decide a challenge's stored results again under other decision rules: without a fit where their margins tell it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aeolid import __version__
from aeolid.challenge.judge import Judged, judge
from aeolid.challenge.run import RESULT, Notice, Rules, read_results, run
from aeolid.challenge.score import table
from aeolid.challenge.write import open_answers
from aeolid.errors import DataError, UsageError
from aeolid.fleet.workers import Pool
from aeolid.text_files import is_number

Facts = dict[str, Any]
Wanted = Mapping[str, Mapping[str, float]]  # values of rules, by section and name


@dataclass(frozen=True)
class Rescored:
    """Hold the answers of the same cases before and after, and what margins left open.

    stay: how many stored answers the margins decide; diagnosed: how many others were diagnosed under the new rules;
    open: the rest with the rules that are out of each one's margins, in neither table.
    """

    stay: int
    diagnosed: int
    open: dict[str, tuple[str, ...]]
    before: tuple[Judged, ...]
    after: tuple[Judged, ...]

    def to_json(self) -> Facts:
        """Return both tables, the cases that changed their answer, and what is open."""
        pairs = zip(self.before, self.after, strict=True)
        return {
            "stay": self.stay, "diagnosed": self.diagnosed,
            "open": {case: list(rules) for case, rules in self.open.items()},
            "before": table(self.before), "after": table(self.after),
            "changed": [
                {"case": a.case, "hidden": list(a.what), "before": list(a.said) or [a.verdict],
                 "after": list(b.said) or [b.verdict], "right_before": a.right, "right_after": b.right}
                for a, b in pairs if (a.verdict, a.said) != (b.verdict, b.said)
            ],
        }  # fmt: skip


def out_of_margins(result: Facts, wanted: Wanted, defaults: Mapping[str, float]) -> tuple[str, ...]:
    """Return the rules whose wanted value may change a stored result, in order; none where it is the same by margins.

    wanted: what differs from the rules by default (defaults, by section.name); what the result was made with and these
    do not name goes back to its default. A result without margins (a crash, an older version) is open to every rule
    that differs from its own.
    """
    own: Wanted = result["settings"].get("rules", {})
    values = {f"{s}.{n}": v for s, table_ in wanted.items() for n, v in table_.items()}
    had = {f"{s}.{n}": v for s, table_ in own.items() for n, v in table_.items()}
    values |= {name: defaults[name] for name in had if name not in values}
    moved = {name: v for name, v in values.items() if v != had.get(name, defaults[name])}
    margins = result.get("margins")
    if not isinstance(margins, dict):
        return tuple(sorted(moved))
    return tuple(sorted(name for name, v in moved.items() if name in margins and not _inside(v, margins[name])))


def _inside(value: float, ends: Any) -> bool:
    """Tell whether a value lies between two ends, None for no end; what are no ends holds nothing."""
    if not isinstance(ends, list) or len(ends) != 2 or not all(e is None or is_number(e) for e in ends):
        return False
    low, high = ends
    return (low is None or value >= low) and (high is None or value <= high)


def rescore(
    folder: Path,
    out: Path,
    rules: Rules,
    pool: Pool | None = None,
    *,
    most_s: float = 900.0,
    notice: Notice | None = None,
) -> Rescored:
    """Decide every stored result of a challenge again under `rules`.

    Without a pool nothing is diagnosed: that takes milliseconds a case, and what margins leave open is listed. With
    one, the open cases are diagnosed under the rules; their results are kept in `out`/rescored and used again. Raises
    DataError where results are missing or the seal is broken, UsageError where they are another version's.
    """
    answers = open_answers(folder)["answers"]
    stored = {r["case"]: r for r in read_results(folder, out)}
    open_ = {name: found for name, r in stored.items() if (found := out_of_margins(r, rules.differing, rules.defaults))}
    fresh: dict[str, Facts] = {}
    again = folder_of(out, rules)
    if pool is not None and open_:
        first = next(iter(stored.values()))["settings"]
        if first["version"] != __version__:
            raise UsageError(
                f"{out}: diagnosed by version {first['version']}, this is {__version__}, so that a difference would not"
                f" be the rules'; run `aeolid challenge run {folder}` again first"
            )
        results = run(folder, again, pool, sham=first["sham"], seed=first["seed"], most_s=most_s, rules=rules,
                      notice=notice, only=tuple(open_))  # fmt: skip
        fresh = {r["case"]: r for r in results}
    else:
        kept = {name: _kept(again / name / RESULT, stored[name], rules) for name in open_}
        fresh = {name: result for name, result in kept.items() if result is not None}
    left = {name: found for name, found in open_.items() if name not in fresh}
    decided = [name for name in stored if name not in left]
    before = tuple(judge(n, answers[n], stored[n]) for n in decided)
    after = tuple(judge(n, answers[n], fresh.get(n, stored[n])) for n in decided)
    return Rescored(len(stored) - len(open_), len(fresh), left, before, after)


def folder_of(out: Path, rules: Rules) -> Path:
    """Return where the results under other rules are kept."""
    from hashlib import sha256

    text = json.dumps(rules.differing, sort_keys=True)
    return out / "rescored" / sha256(text.encode()).hexdigest()[:12]


def _kept(path: Path, stored: Facts, rules: Rules) -> Facts | None:
    """Return a result that an earlier call diagnosed under the same rules, None where there is none."""
    try:
        found: Facts = json.loads(path.read_text(encoding="utf-8"))
        settings = {**stored["settings"], "rules": rules.differing}
        same = found["case_sha256"] == stored["case_sha256"] and found["settings"] == settings
        return found if same and found["outcome"] == "done" else None
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path}: is no result of a challenge ({error}); remove it") from None
