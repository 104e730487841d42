"""Say the answer of a diagnosis at the top of its page: verdict, sentence, proof, what to set in a simulator."""

from __future__ import annotations

from typing import Any

from aeolid.diagnose.hypotheses.catalogue import in_words, meaning_of, name_of
from aeolid.report.markup import Html, tag
from aeolid.report.numbers import number, percent, quantity
from aeolid.wording import odds, spoken

Facts = dict[str, Any]

_VERDICTS = {
    "no_mismatch": ("good", "No mismatch", "Nothing was found that the model lacks."),
    "immaterial": ("good", "Immaterial", "A difference can be measured, but it is too small to matter."),
    "data_fault": ("open", "Data fault", "The recording is at fault, not the model."),
    "parameter": ("found", "Parameter", "The structure of the model holds; a parameter is wrong."),
    "named": ("found", "Named", "The effect the model lacks is found."),
    "ambiguous": ("open", "Ambiguous", "More than one explanation fits this recording; it does not tell them apart."),
    "multiple": ("found", "Several effects", "The model lacks more than one effect."),
    "unnamed": (
        "open",
        "Unnamed",
        "The model lacks something; it is located below and fits no entry of the catalogue.",
    ),
    "not_testable": ("open", "Not testable", "This recording does not carry the answer."),
}


def verdict_sentence(diagnosis: Facts) -> str:
    """Return the one sentence that says the result: the diagnosis's own, else the best effect's, else the verdict's.

    Of an ambiguous one it is the verdict's: what may be is listed below it.
    """
    effects, verdict = diagnosis.get("effects") or [], diagnosis.get("verdict", "")
    _, _, general = _VERDICTS.get(verdict, ("", "", ""))
    if verdict == "ambiguous" and len(effects) > 1:
        return f"{general[:-1]}: {len(effects)} are open."
    if diagnosis.get("statement"):
        return sentence_of(diagnosis["statement"])
    if verdict in ("named", "parameter", "data_fault") and effects and effects[0].get("statement"):
        return sentence_of(effects[0]["statement"])
    if verdict in ("multiple", "ambiguous") and effects:
        joined = "; ".join(str(e.get("statement") or e.get("id")).rstrip(".") for e in effects[:3])
        return f"{general} {sentence_of(joined)}"
    return general


def sentence_of(value: Any) -> str:
    """Return a text as a sentence, the places and effects in it in words."""
    text = in_words(spoken(str(value).strip()))
    if text.partition(" ")[0].isalpha():  # the name of a channel is written as it is
        text = text[:1].upper() + text[1:]
    return text if not text or text[-1] in ".!?" else text + "."


def share_of(effect: Facts) -> str:
    """Return an effect's share of the evidence as a percentage; what is next to nothing is said so."""
    weight = effect.get("weight")
    if not isinstance(weight, int | float):
        return "–"
    return "below 0.1 %" if weight < 1e-3 else percent(min(weight, 0.999), 3 if weight > 0.99 else 2)


def groups_of(effects: list[Facts]) -> list[list[Facts]]:
    """Return the effects that act together, each with what may stand in its place behind it."""
    groups: list[list[Facts]] = []
    for effect in effects:
        here = effect.get("id"), (effect.get("location") or {}).get("entry")
        home = next(
            (g for g in groups if here in [(r.get("id"), r.get("entry")) for r in g[0].get("rivals") or []]), None
        )
        groups.append([effect]) if home is None else home.append(effect)
    return groups


def answer(diagnosis: Facts) -> Html:
    """Build the box at the top of a page."""
    effects, verdict = diagnosis.get("effects") or [], diagnosis.get("verdict", "")
    kind, word, _ = _VERDICTS.get(verdict, ("open", str(verdict), ""))
    names = dict.fromkeys(name_of(str(e.get("id"))) for e in effects)
    named = f" · {', '.join(list(names)[:3])}" if names else ""
    several = verdict == "ambiguous" and len(effects) > 1
    return tag(
        "div",
        tag("div", "Verdict: " + word + ("" if several else named), class_="word"),
        tag("div", verdict_sentence(diagnosis), class_="sentence"),
        _open(effects) if several else None,
        tag("div", _proof(diagnosis.get("sealed") or {}, effects, several)),
        None if several else _settings(effects),
        class_=f"verdict {kind}",
    )


def _open(effects: list[Facts]) -> Html:
    """List what may be, likeliest first; of effects that act together each with what may stand in its place."""
    groups = groups_of(effects)
    if len(groups) == 1 or all(len(g) == 1 for g in groups):
        ranked = sorted(effects, key=lambda e: -float(e.get("weight") or 0.0))
        return tag("ol", *(tag("li", _said(e)) for e in ranked))
    parts = []
    for group in groups:
        one = len(group) == 1
        inside = _said(group[0]) if one else tag("ol", *(tag("li", _said(e)) for e in group), type="a")
        parts.append(tag("li", inside if one else Html(f"one of {inside}")))
    return tag("div", "Together:", tag("ol", *parts))


def _said(effect: Facts) -> str:
    weight = effect.get("weight")
    share = f" ({share_of(effect)} of the evidence)" if isinstance(weight, int | float) else ""
    return sentence_of(effect.get("statement") or name_of(str(effect.get("id"))))[:-1] + share + "."


def _proof(sealed: Facts, effects: list[Facts], several: bool) -> str:
    """Say in one line what the sealed data say, from whatever of it is known."""
    parts = []
    if effects and effects[0].get("parameters") and not several:
        found, identifier = effects[0]["parameters"], str(effects[0].get("id"))
        told = (f"{meaning_of(identifier, name) or name} {quantity(value)}" for name, value in found.items())
        parts.append("estimated: " + ", ".join(told))
    before, after = sealed.get("nrmse_before") or {}, sealed.get("nrmse_after") or {}
    if effects and after:
        worst = max(after, key=lambda y: (before.get(y) or 0.0) - (after.get(y) or 0.0))
        parts.append(
            f"on data never used before, the error of {worst} falls from {percent(before.get(worst))}"
            f" to {percent(after.get(worst))} of its standard deviation"
        )
    if effects and sealed.get("log_likelihood_gain"):
        interval, gain = sealed.get("interval") or [], float(sealed["log_likelihood_gain"])
        between = f", 90 % interval {number(interval[0])} to {number(interval[1])}" if len(interval) == 2 else ""
        parts.append(f"{odds(gain)} for the corrected model (log-likelihood gain {number(gain)} nats{between})")
    gain, ceiling = sealed.get("log_likelihood_gain") or 0.0, sealed.get("ceiling_gain")
    if effects and ceiling is not None and sealed.get("recovered_fraction") is not None:
        share = f"{percent(sealed['recovered_fraction'], 2)} of what a correction of any form gains there"
        parts.append(share if ceiling > gain else "a correction of any form gains no more there")
    text = "; ".join(parts)
    return text[:1].upper() + text[1:] + "." if text else ""


def _settings(effects: list[Facts]) -> Html | None:
    """Say what to set in which simulator, where the catalogue knows."""
    rows = [s for e in effects for s in e.get("settings") or []]
    return (
        tag("div", *(tag("div", f"In {s['simulator']}: set ", tag("code", s["set"])) for s in rows)) if rows else None
    )
