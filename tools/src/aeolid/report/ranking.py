"""Rank the explanations that were fitted by what decided between them: the evidence that each fit gained."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from aeolid.diagnose.hypotheses.catalogue import in_words, name_of
from aeolid.report import charts
from aeolid.report.markup import Html, figure, folded, section, table, tag
from aeolid.report.numbers import is_open, number
from aeolid.wording import place, spoken

Facts = dict[str, Any]
Named = set[tuple[Any, Any]]  # id and place of what the answer names
_MOST_BARS = 12
_REFUSED = "not accepted"


def called(identifier: Any, entry: Any) -> str:
    """Return an effect and its place in words.

    >>> called("actuator_lag", "input:pitch")
    'first-order actuator lag, at the input pitch'
    """
    where = place(str(entry or ""))
    return f"{name_of(str(identifier))}, {where}" if where else name_of(str(identifier))


def label_of(key: str) -> str:
    """Return the words of a candidate's key: effect, what of it, place; those of a set joined by "and"."""
    return " and ".join(_label_of_one(part) for part in key.split(" + "))


def _label_of_one(key: str) -> str:
    identifier, _, rest = key.strip().partition(" ")
    rest = spoken(rest)
    return f"{name_of(identifier)}, {rest}" if rest else name_of(identifier)


def gain_of(candidate: Facts) -> float:
    """Return what a candidate is ranked by, in nats; files from before it was written have its parts."""
    for key in ("score", "nats"):
        if isinstance(candidate.get(key), int | float):
            return float(candidate[key])
    parts = (candidate.get("fit_gain"), candidate.get("select_gain"))
    return float(sum(p for p in parts if isinstance(p, int | float)))


def names_it(candidate: Facts, found: Named) -> bool:
    """Tell whether every effect of a candidate is one of those that the answer names."""
    parts = candidate.get("parts") or [_part_of(part) for part in str(candidate.get("key", "")).split(" + ")]
    return bool(parts) and all((identifier, where) in found for identifier, where in parts)


def _part_of(key: str) -> tuple[str, str]:
    identifier, _, rest = key.strip().partition(" ")
    return identifier, next((word for word in reversed(rest.split()) if ":" in word), rest)


def ranking(candidates: Sequence[Facts], found: Named) -> Html:
    """Show what every fitted explanation gains; found: (id, place) of what the answer names."""
    ranked = sorted((c for c in candidates if not is_open(gain_of(c))), key=lambda c: -gain_of(c))
    if not ranked:
        return Html("")
    shown = [c for i, c in enumerate(ranked) if i < _MOST_BARS or names_it(c, found)]
    labels = [charts.short(label_of(str(c.get("key", "")))) for c in shown]
    labels = [f"{text} ({_REFUSED})" if _is_refused(c) else text for c, text in zip(shown, labels, strict=True)]
    with charts.sketch((charts.WIDE[0], 0.9 + 0.3 * len(shown))) as drawing:
        marked = {i for i, c in enumerate(shown) if names_it(c, found)}
        charts.bars(drawing.axes[0, 0], labels, [gain_of(c) for c in shown], [None] * len(shown), marked)
        drawing.axes[0, 0].set_xlabel("evidence gained (nats)")
    caption = (
        "Gain in log-likelihood of each fitted explanation over the model before correction, less a penalty for its"
        " parameters. 3 nats are odds of 20 to 1, 7 nats of 1000 to 1; explanations less than 3 nats apart are not"
        " distinguished. Blue: what is named above; not accepted: its values are not plausible for a machine, or it"
        " failed a check, which the table says."
    )
    rest = f" Shown: the first {len(shown)} of {len(ranked)}." if len(shown) < len(ranked) else ""
    return section("What decided", figure(drawing.svg, caption + rest), _table(ranked))


def _is_refused(candidate: Facts) -> bool:
    return not candidate.get("plausible", True)


def _table(ranked: Sequence[Facts]) -> Html:
    rows = [
        (label_of(str(c.get("key", ""))), number(gain_of(c)), number(c.get("fit_gain")), number(c.get("select_gain")),
         in_words(spoken(str(c.get("reason") or (_REFUSED if _is_refused(c) else "")))))
        for c in ranked
    ]  # fmt: skip
    head = ["explanation", "#evidence (nats)", "#on the fit data", "#on the selection data", "not accepted because"]
    if all(c.get("fit_gain") is None for c in ranked):
        head, rows = [head[0], head[1], head[4]], [(r[0], r[1], r[4]) for r in rows]  # type: ignore[misc]
    note = tag("p", "Gains are differences of log-likelihood, in nats.", class_="soft")
    return folded(f"All {len(ranked)} fitted explanations, with the reasons against them", note, table(head, rows))
