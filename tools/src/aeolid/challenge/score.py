"""Count what a challenge shows: the table of the aims, with intervals, and which family was taken for which."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.challenge.families import family_of
from aeolid.challenge.items import WAYS
from aeolid.challenge.judge import Judged, judge
from aeolid.challenge.run import read_results
from aeolid.challenge.write import open_answers, read_seal

Facts = dict[str, Any]
_DRAWS = 2000  # of the bootstrap


def score(folder: Path, out: Path) -> Facts:
    """Return the table, every case, the confusion of families, and what was found by way of hiding and by entry.

    Raises DataError where the seal is broken.
    """
    answers = open_answers(folder)
    results = read_results(folder, out)
    judged = [judge(r["case"], answers["answers"][r["case"]], r) for r in results]
    return {
        "seal": read_seal(folder)["sha256"], "settings": answers["settings"], "run": results[0]["settings"],
        "classes": dict(sorted(Counter(j.sort for j in judged).items())), "table": table(judged),
        "confusion": confusion(judged), "ways": ways(judged, answers["answers"]), "entries": entries(judged),
        "cases": [_row(j, answers["answers"][j.case]) for j in judged],
    }  # fmt: skip


def table(judged: Sequence[Judged]) -> list[Facts]:
    """Return one row an aim: how many of how many, the share or size, its 95 % interval, and the aims."""
    hidden = [j for j in judged if j.hidden and j.decidable]
    found = [j for j in hidden if j.detected]
    null = [j for j in judged if j.sort in ("null", "parameter")]
    never = [j for j in judged if j.sort == "impossible" or (j.hidden and not j.decidable)]
    foreign = [j for j in judged if j.sort == "outside"]
    rows = [
        _share("recall of concealed decidable effects", hidden, lambda j: j.detected, ">= 80 %", ">= 95 %"),
        _share("… named, or in the set", hidden, lambda j: j.in_set, "", ""),
        _share("false name where nothing is hidden", null, lambda j: j.false_name, "<= 2 %", "<= 0.5 %"),
        _share("top-1 id, of detected", found, lambda j: j.right, ">= 75 %", ">= 90 %"),
        _share("top-1 family, of detected", found, lambda j: j.right_family, ">= 90 %", ">= 97 %"),
        _share("top-3, of detected", found, _top3, ">= 93 %", ">= 99 %"),
        _share("truth inside the set, of named", [j for j in found if j.offered], lambda j: j.in_set, ">= 95 %",
               ">= 99 %"),
        _size("size of the set, mean", [float(len(j.offered)) for j in found if j.offered], np.mean, "<= 2.5",
              "<= 1.7"),
        _size("parameter error, median", [e for j in judged for e, _ in j.errors], np.median, "<= 0.15", "<= 0.05"),
    ]  # fmt: skip
    covered = [c for j in judged for _, c in j.errors if c is not None]
    good = [j.recovered for j in found if j.right and j.said and j.recovered is not None]
    every, double = list(judged), [j for j in hidden if len(j.truth) > 1]
    return [
        *rows,
        _count("coverage of 90 % intervals", sum(covered), len(covered), "80–97 %", "87–93 %"),
        _size("recovered fraction, median", good, np.median, ">= 0.85", ">= 0.95"),
        _size("recovered fraction, 10th percentile", good, lambda x: np.quantile(x, 0.1), ">= 0.6", ">= 0.85"),
        _share("two effects: both named or in the set", double, lambda j: j.every_in_set, "", ""),
        _share("outside the catalogue: no forced name", foreign, lambda j: not j.said, ">= 70 %", ">= 90 %"),
        _share("outside the catalogue: unnamed", foreign, lambda j: j.verdict == "unnamed", "", ""),
        _share("undecidable or impossible: a name", never, lambda j: bool(j.said) and not j.right, "", ""),
        _share("wrong but confident, of all", every, lambda j: j.wrong_but_confident, "<= 3 %", "<= 0.5 %"),
        _share("crashed, refused or timed out", every, lambda j: j.outcome != "done", "", ""),
        _size("seconds a case, median", [j.seconds for j in every], np.median, "<= 300", "<= 60"),
        _size("seconds a case, longest", [j.seconds for j in every], np.max, "", ""),
    ]


def wilson(good: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a proportion (Wilson 1927, score interval)."""
    if of == 0:
        return 0.0, 1.0
    z, p = 1.959964, good / of
    centre, half = p + z * z / (2 * of), z * float(np.sqrt(p * (1 - p) / of + (z / (2 * of)) ** 2))
    scale = 1 + z * z / of
    return max(0.0, (centre - half) / scale), min(1.0, (centre + half) / scale)


def _top3(j: Judged) -> bool:
    best = dict.fromkeys([*j.said, *j.offered])
    return bool(set(list(best)[:3]) & set(j.all_accepted)) or j.right


def _share(
    name: str, chosen: Sequence[Judged], holds: Callable[[Judged], bool], release: str, best: str
) -> Facts:  # fmt: skip
    return _count(name, sum(holds(j) for j in chosen), len(chosen), release, best)


def _count(name: str, good: int, of: int, release: str, best: str) -> Facts:
    low, high = wilson(good, of)
    value = good / of if of else None
    return {"metric": name, "count": int(good), "of": of, "value": value, "interval": [low, high], "release": release,
            "world_best": best}  # fmt: skip


def _size(name: str, values: Sequence[float], of: Callable[[Any], Any], release: str, best: str) -> Facts:
    """Return a statistic with the interval of a percentile bootstrap, its seed fixed."""
    facts: Facts = {"metric": name, "count": None, "of": len(values), "value": None, "interval": None}
    if len(values):
        x, rng = np.asarray(values, dtype=float), np.random.default_rng(0)
        draws = [float(of(x[rng.integers(0, len(x), len(x))])) for _ in range(_DRAWS)]
        facts |= {"value": float(of(x)), "interval": [float(q) for q in np.quantile(draws, [0.025, 0.975])]}
    return facts | {"release": release, "world_best": best}


def confusion(judged: Sequence[Judged]) -> list[Facts]:
    """Return how often a hidden family was answered by which family or verdict."""
    counts: Counter[tuple[str, str]] = Counter()
    for j in judged:
        if j.truth and j.sort != "impossible":
            own = {family_of(i) for i in j.all_accepted}
            hidden = family_of(j.first) if family_of(j.first) in own else family_of(j.truth[0][0])
        else:
            hidden = {"outside": "(outside)", "impossible": "(impossible)"}.get(j.sort, "(nothing)")
        counts[hidden, family_of(j.first)] += 1
    return [{"hidden": a, "answered": b, "count": n} for (a, b), n in sorted(counts.items())]


def ways(judged: Sequence[Judged], answers: Facts) -> list[Facts]:
    """Return, for each way to hide, how many decidable effects that hid so were named or in the set."""
    hidden = [j for j in judged if j.hidden and j.decidable]
    used = {j.case: {h["what"] for h in answers[j.case]["hides"]} for j in hidden}
    listed = [(what, [j for j in hidden if what in used[j.case]]) for what in WAYS.values()]
    return [_tally(what, chosen) for what, chosen in listed if chosen]


def entries(judged: Sequence[Judged]) -> list[Facts]:
    """Return the same for each entry of the catalogue that was hidden, by the first id that names it rightly."""
    hidden = [j for j in judged if j.hidden and j.decidable]
    ids = sorted({accepted[0] for j in hidden for accepted in j.truth if accepted})
    return [_tally(i, [j for j in hidden if any(t and t[0] == i for t in j.truth)]) for i in ids]


def _tally(what: str, chosen: Sequence[Judged]) -> Facts:
    return {"what": what, "count": sum(j.in_set for j in chosen), "of": len(chosen)}


def failed(facts: Facts, least: float) -> bool:
    """Tell whether the recall lies below a share."""
    value = facts["table"][0]["value"]
    return value is None or value < least


def _row(j: Judged, answer: Facts) -> Facts:
    return {
        "case": j.case, "class": j.sort, "plant": j.plant, "baseline": j.baseline, "what": list(j.what),
        "truth": [list(t) for t in j.truth], "hides": [h["what"] for h in answer["hides"]], "nats": j.nats,
        "vaf_points": answer["vaf_points"], "decidable": j.decidable, "outcome": j.outcome, "verdict": j.verdict,
        "said": list(j.said), "offered": list(j.offered), "good": good(j), "seconds": j.seconds,
        "statement": j.statement,
    }  # fmt: skip


def good(j: Judged) -> bool:
    """Tell whether the answer is what one may ask for."""
    if j.outcome != "done":
        return False
    if j.sort in ("null", "parameter"):
        return not j.false_name
    if j.sort == "outside":
        return not j.said and j.verdict not in ("parameter", "data_fault")
    if j.hidden and j.decidable:
        return j.in_set
    return not j.said or j.in_set
