"""Show the score of a challenge: as text, and as one self-contained page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.markup import Html, figure, join, section, table, tag, write_page

Facts = dict[str, Any]
_TALLIES = {"ways": "How it hid", "entries": "What was hidden"}


def text(facts: Facts) -> str:
    """Return the table, the confusion of families and every answer that is not what one may ask for."""
    lines = [f"seal intact: {facts['seal']}", _summary(facts), "", *table_text(facts["table"])]
    lines += ["", "hidden family → first answer's family, or verdict:"]
    lines += [f"  {c['hidden']:22} → {c['answered']:22} ×{c['count']}" for c in facts["confusion"]]
    for key, head in _TALLIES.items():
        lines += ["", f"{head}, named or in the set:"]
        lines += [f"  {t['what']:34} {t['count']} of {t['of']}" for t in facts[key]]
    wrong = [c for c in facts["cases"] if not c["good"]]
    lines += ["", f"answers that miss what one may ask for: {len(wrong)} of {len(facts['cases'])}"]
    lines += [f"  {c['case']} {_truth(c)} → {_answer(c)}" for c in wrong]
    return "\n".join(lines)


def table_text(rows: list[Facts]) -> list[str]:
    """Return the lines of a table of aims."""
    lines = [f"{'':44} {'count':>10} {'value':>8}  {'95 % interval':17} {'release':9} world-best"]
    for row in rows:
        count = f"{row['count']} of {row['of']}" if row["count"] is not None else f"of {row['of']}"
        lines.append(
            f"{row['metric']:44} {count:>10} {_value(row):>8}  {_interval(row):17} {row['release']:9} "
            f"{row['world_best']}".rstrip()
        )
    return lines


def render(facts: Facts, path: Path) -> None:
    """Write the page; raises UsageError where it cannot be written."""
    wrong = [c for c in facts["cases"] if not c["good"]]
    rows = [[r["metric"], f"{r['count']} of {r['of']}" if r["count"] is not None else f"of {r['of']}", _value(r),
             _interval(r), r["release"], r["world_best"]] for r in facts["table"]]  # fmt: skip
    head = ["", "#count", "#value", "#95 % interval", "release", "world-best"]
    note = "Proportions with Wilson's interval, sizes with a percentile bootstrap."
    write_page(
        path, "Challenge", tag("h1", "Concealed physics: found, missed, wrongly named"), tag("p", _summary(facts)),
        section("Score", tag("p", note, class_="soft"), table(head, rows)),
        section("Which family was taken for which", _matrix(facts)),
        *(
            section(f"{head}, named or in the set",
                    table(["", "#found"], [[t["what"], f"{t['count']} of {t['of']}"] for t in facts[key]]))
            for key, head in _TALLIES.items()
        ),
        section("Answers that miss what one may ask for", _cases(wrong)),
        section("All cases", _cases(facts["cases"])),
        section("Settings", tag("p", f"Seal (SHA-256 of the answers): {facts['seal']}; {facts['settings']}; run: "
                                f"{facts['run']}.", class_="soft")),
    )  # fmt: skip


def _summary(facts: Facts) -> str:
    classes = ", ".join(f"{n} {sort}" for sort, n in facts["classes"].items())
    s = facts["settings"]
    hidden = [c["vaf_points"] for c in facts["cases"] if c["vaf_points"] is not None and c["class"] != "impossible"]
    under = sum(v < 1 for v in hidden)
    return (
        f"{s['cases']} cases of {s['samples']} samples, seed {s['seed']}: {classes}; of {len(hidden)} effects measured "
        f"{under} move the baseline's sealed one-step VAF by less than a point"
    )


def _matrix(facts: Facts) -> Html:
    hidden = sorted({c["hidden"] for c in facts["confusion"]})
    said = sorted({c["answered"] for c in facts["confusion"]})
    counts = np.zeros((len(hidden), len(said)))
    for c in facts["confusion"]:
        counts[hidden.index(c["hidden"]), said.index(c["answered"])] = c["count"]
    with charts.sketch((10.6, 1.8 + 0.27 * len(hidden))) as drawing:
        axes = drawing.axes[0, 0]
        axes.imshow(np.sqrt(counts), cmap="Blues", aspect="auto", vmin=0, vmax=1.6 * np.sqrt(counts.max()))
        for i, j in zip(*np.nonzero(counts), strict=True):
            axes.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=9)
        axes.set_yticks(range(len(hidden)), hidden)
        axes.set_xticks(range(len(said)), said, rotation=40, ha="right")
        axes.grid(visible=False)
    return figure(drawing.svg, "Rows: what was hidden. Columns: the family of the first name, or the verdict.")


def _cases(cases: list[Facts]) -> Html:
    head = ["case", "plant, baseline", "hidden", "how it hides", "#nats", "#VAF (points)", "answer", "#s"]
    rows = [
        [c["case"], f"{c['plant']}, {c['baseline']}", _truth(c), "; ".join(c["hides"]), _number(c["nats"], 0),
         _number(c["vaf_points"], 2), _answer(c), f"{c['seconds']:.0f}"] for c in cases
    ]  # fmt: skip
    return table(head, rows) if rows else join([tag("p", "None.")])


def _truth(case: Facts) -> str:
    if not case["what"]:
        return {"null": "nothing", "parameter": "nothing but wrong declared values"}[case["class"]]
    ids = " and ".join("/".join(t) for t in case["truth"]) or "outside the catalogue"
    mark = "" if case["decidable"] else ", undecidable"
    return f"{' and '.join(case['what'])} ({ids}, {case['class']}{mark})"


def _answer(case: Facts) -> str:
    if case["outcome"] != "done":
        return f"{case['outcome']}: {case['statement'][:80]}"
    return f"{case['verdict']}: {', '.join(case['said'])}" if case["said"] else str(case["verdict"])


def _value(row: Facts) -> str:
    if row["value"] is None:
        return "–"
    return f"{row['value']:.1%}" if row["count"] is not None else _number(row["value"], 3)


def _interval(row: Facts) -> str:
    if row["interval"] is None:
        return "–"
    low, high = row["interval"]
    if row["count"] is not None:
        return f"{low:.1%} … {high:.1%}"
    return f"{_number(low, 3)} … {_number(high, 3)}"


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}" if digits < 3 else f"{value:.3g}"
