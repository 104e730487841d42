"""Hold answers against the truth of the cases and write the table."""

from __future__ import annotations

import collections
import statistics
from collections.abc import Iterable, Sequence
from typing import Any

Facts = dict[str, Any]
OUTCOMES = ("name", "open", "part", "family", "unnamed", "nothing", "wrong", "sure", "failed")
SURE = ("named", "multiple", "parameter", "data_fault")  # verdicts that leave nothing open
Z95 = 1.96
_SAME_MODE = 0.15  # of a mode's frequency, within which a mode that is told is that one
_SIZES = ("small", "medium", "large", "null")


def judge(case: str, truth: Facts, answer: Facts) -> Facts:
    """Return how an answer is to be called, with all that the table needs of it.

    outcome, of an effect: name (the first name is right; of two effects both), open (a right name is among those left
    open), part (one of two), family, unnamed, nothing, wrong, sure (wrong, and nothing left open), failed (no answer);
    of a null: nothing is right, unnamed a false detection, wrong and sure false names. beside: names that are wrong
    beside a right one.
    """
    said = answer["diagnosis"] or {}
    effects = said.get("effects", [])
    groups = grouped(effects)
    right = [g for g in groups if _is_right(g[0], truth)]
    outcome = _outcome(truth, answer, groups)
    beside = [g[0]["id"] for g in groups if not _is_right(g[0], truth) and g[0]["family"] not in truth["families"]]
    found = next((e for e in (*(g[0] for g in right), *effects) if _is_right(e, truth)), None)
    run = said.get("run") or {}
    return {
        "case": case, "effect": truth["effect"], "size": truth["size"], "wind": truth["wind"],
        "outputs": truth["outputs"], "outcome": outcome, "verdict": said.get("verdict"),
        "names": [e["id"] for e in effects], "beside": beside if right else [],
        "values": [] if found is None else _values(truth, effects), "diverges": _diverges(said),
        "nats": run.get("nats_lost"), "weight": run.get("weight"),
        "gain": (said.get("sealed") or {}).get("log_likelihood_gain"),
        "seconds": answer["seconds"], "processor_s": answer["processor_s"], "memory_mb": answer["memory_mb"],
    }  # fmt: skip


def grouped(effects: Sequence[Facts]) -> list[list[Facts]]:
    """Return the effects of a diagnosis in groups: a first name and those that are not told from it."""
    groups, k = [], 0
    while k < len(effects):
        more = len(effects[k].get("rivals", []))
        groups.append(list(effects[k : k + 1 + more]))
        k += 1 + more
    return groups


def _is_right(effect: Facts, truth: Facts) -> bool:
    placed = truth["place"] is None or effect["location"]["entry"] == truth["place"]
    return placed and effect["id"] in {*truth["ids"], *truth["also_accepted"]} and not _is_elsewhere(effect, truth)


def _is_elsewhere(effect: Facts, truth: Facts) -> bool:
    """Tell whether a mode stands at a frequency that is not the true one's: another mode, whatever its family."""
    true, told = truth["values"].get("frequency_hz"), effect["parameters"].get("frequency_hz")
    if true is None or told is None or told["value"] is None:
        return False
    return bool(abs(told["value"] - true["value"]) > _SAME_MODE * true["value"])


def _outcome(truth: Facts, answer: Facts, groups: Sequence[Sequence[Facts]]) -> str:
    verdict = (answer["diagnosis"] or {}).get("verdict")
    if answer["exit"] or verdict is None:
        return "failed"
    if not groups:
        return "sure" if verdict in SURE else "unnamed" if verdict in ("unnamed", "ambiguous") else "nothing"
    first, said = [g[0] for g in groups], [e for g in groups for e in g]
    asked, hit = truth["ids"], {e["id"] for e in first if _is_right(e, truth)}
    if len(asked) > 1 and hit:
        return "name" if set(asked) <= hit else "part"
    if hit:
        return "name"
    if any(_is_right(e, truth) for e in said):
        return "open"
    if any(_is_near(e, truth) for e in first):
        return "family"
    return "sure" if verdict in SURE else "wrong"


def _is_near(effect: Facts, truth: Facts) -> bool:
    """Tell whether an effect is of a right family: no other mode, no right name at a wrong input."""
    misplaced = truth["place"] is not None and effect["id"] in truth["ids"]
    return effect["family"] in truth["families"] and not misplaced and not _is_elsewhere(effect, truth)


def _diverges(said: Facts) -> bool:
    return bool(said.get("effects")) and (said.get("model") or {}).get("divergence") is not None


def _values(truth: Facts, effects: Iterable[Facts]) -> list[Facts]:
    """Return the values that a right name tells and the truth knows: relative error, deviations off, in the band."""
    found = []
    for effect in effects:
        if not _is_right(effect, truth):
            continue
        for name, true in truth["values"].items():
            told = effect["parameters"].get(name)
            if told is None or told["value"] is None or told["unit"] not in (true["unit"], ""):
                continue
            away, std = told["value"] - true["value"], told["std"]
            off = abs(away) / std if std else None
            found.append(
                {"name": name, "told": told["value"], "std": std, "true": true["value"],
                 "error": abs(away) / abs(true["value"]), "off": off, "inside": off is not None and off <= Z95}
            )  # fmt: skip
        break
    return found


def table(rows: Sequence[Facts], version: str, part: str) -> str:
    """Return the table of a part: effects by size, nulls by kind, all together, and what was wrong case by case."""
    effects, nulls = [r for r in rows if r["effect"] != "null"], [r for r in rows if r["effect"] == "null"]
    lines = [f"Part {part}, product {version}, {len(rows)} cases ({len(nulls)} nulls)", "", *_by_effect(effects)]
    lines += ["", *_by_kind(nulls), "", *_costs(rows), ""]
    for title, chosen in (
        ("False names and detections on nulls", [r for r in nulls if r["outcome"] != "nothing"]),
        ("Wrong names", [r for r in effects if r["outcome"] in ("wrong", "sure", "failed") or r["beside"]]),
    ):
        lines += [f"{title}: {len(chosen) or 'none'}", *(f"- {_line(r)}" for r in chosen), ""]
    return "\n".join(lines)


def _line(r: Facts) -> str:
    nats = "–" if r["nats"] is None else f"{r['nats']:.0f}"
    beside = f"; beside: {', '.join(r['beside'])}" if r["beside"] else ""
    return f"{r['case']}: {r['outcome']}, {r['verdict']}: {', '.join(r['names']) or '–'}{beside} ({nats} nats)"


def _row(title: str, rows: Sequence[Facts]) -> str:
    count = collections.Counter(r["outcome"] for r in rows)
    values = [v for r in rows for v in r["values"]]
    offs = [v["off"] for v in values if v["off"] is not None]
    told = ["", "", ""] if not values else [
        f"{100 * statistics.median(v['error'] for v in values):.0f}", f"{statistics.median(offs):.1f}" if offs else "–",
        f"{sum(v['inside'] for v in values)}/{len(values)}",
    ]  # fmt: skip
    cells = [str(count[o] or "·") for o in OUTCOMES]
    beside = sum(bool(r["beside"]) for r in rows)
    return f"| {title} | {len(rows)} | {' | '.join(cells)} | {beside or '·'} | {' | '.join(told)} |"


def _head(first: str) -> list[str]:
    heads = [first, "cases", *OUTCOMES, "beside", "error %", "dev. off", "in band"]
    return [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]


def _by_effect(rows: Sequence[Facts]) -> list[str]:
    lines = _head("effect, size")
    for key in sorted({(r["effect"], _SIZES.index(r["size"])) for r in rows}):
        lines.append(_row(f"{key[0]} {_SIZES[key[1]]}", [r for r in rows if _key(r) == key]))
    for outputs in ("all", "two"):
        for size in _SIZES[:3]:
            chosen = [r for r in rows if r["outputs"] == outputs and r["size"] == size]
            lines.append(_row(f"**{outputs} outputs, {size}**", chosen))
    return [*lines, _row("**all effects**", rows)]


def _key(r: Facts) -> tuple[str, int]:
    return r["effect"], _SIZES.index(r["size"])


def _by_kind(rows: Sequence[Facts]) -> list[str]:
    lines = ["| nulls | cases | no mismatch | detected, no name | false name | of these sure | failed | nats, most |",
             "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for wind, kind in (("u", "uniform"), ("f", "full field"), ("", "all")):
        for outputs in (("all",), ("two",)) if wind else (("all", "two"),):
            chosen = [r for r in rows if r["wind"].startswith(wind) and r["outputs"] in outputs]
            count = collections.Counter(r["outcome"] for r in chosen)
            false = sum(count[o] for o in ("name", "open", "part", "family", "wrong", "sure"))
            most = max((r["nats"] for r in chosen if r["nats"] is not None), default=0.0)
            lines.append(
                f"| {kind}, {' and '.join(outputs)} outputs | {len(chosen)} | {count['nothing']} | {count['unnamed']} |"
                f" {false} | {count['sure']} | {count['failed']} | {most:.0f} |"
            )
    return lines


def _costs(rows: Sequence[Facts]) -> list[str]:
    if not rows:
        return []
    wild = [r["case"] for r in rows if r["diverges"]]
    return [
        f"{name}: median {statistics.median(r[key] for r in rows):.0f}, most {max(r[key] for r in rows):.0f}"
        for name, key in (("Seconds", "seconds"), ("Seconds of processor", "processor_s"), ("Memory, MB", "memory_mb"))
    ] + [f"Corrected models that diverge: {', '.join(wild) or 'none'}"]


def compared(before: Sequence[Facts], after: Sequence[Facts]) -> str:
    """Return a table of two versions on the cases that both have answered."""
    old = {r["case"]: r for r in before}
    both = [(old[r["case"]], r) for r in after if r["case"] in old]
    lines = ["| effect | cases | right | family or better | wrong | sure | in band |", "|---|---|---|---|---|---|---|"]
    real = [(a, b) for a, b in both if b["effect"] != "null"]
    groups = [(e, [(a, b) for a, b in real if b["effect"] == e]) for e in sorted({b["effect"] for _, b in real})]
    groups += [("**all effects**", real), ("**nulls**", [(a, b) for a, b in both if b["effect"] == "null"])]
    for title, chosen in groups:
        if not chosen:
            continue
        right = ("nothing",) if title == "**nulls**" else ("name",)
        near = right if title == "**nulls**" else ("name", "open", "part", "family")
        cells = []
        for outcomes in (right, near, ("wrong", "sure"), ("sure",)):
            x, y = (sum(r["outcome"] in outcomes for r in side) for side in zip(*chosen, strict=True))
            cells.append(f"{x} → {y}")
        inside = [
            f"{sum(v['inside'] for r in side for v in r['values'])}/{sum(len(r['values']) for r in side)}"
            for side in zip(*chosen, strict=True)
        ]
        lines.append(f"| {title} | {len(chosen)} | {' | '.join(cells)} | {' → '.join(inside)} |")
    return "\n".join(lines)
