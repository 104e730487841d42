"""Write the page of a diagnosis: the verdict sentence first, then the proof on sealed data, then the evidence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.report.evidence import appendix, before_after, confusion, score_bank
from aeolid.report.markup import Html, join, section, table, tag, write_page
from aeolid.report.numbers import number, percent, quantity, with_std
from aeolid.report.where import maps

Facts = dict[str, Any]

_VERDICTS = {
    "no_mismatch": ("good", "No mismatch", "Nothing was found that the model lacks."),
    "immaterial": ("good", "Immaterial", "A difference can be measured, but it is too small to matter."),
    "data_fault": ("open", "Data fault", "The recording is at fault, not the model."),
    "parameter": ("found", "Parameter", "The structure of the model holds; a parameter is wrong."),
    "named": ("found", "Named", "The effect the model lacks is found."),
    "ambiguous": ("open", "Ambiguous", "More than one effect explains this recording equally well."),
    "multiple": ("found", "Several effects", "The model lacks more than one effect."),
    "unnamed": (
        "open",
        "Unnamed",
        "The model lacks something; it is located below and fits no entry of the catalogue.",
    ),
    "not_testable": ("open", "Not testable", "This recording does not carry the answer."),
}


def render_diagnosis(diagnosis: Facts, evidence: Facts, path: str | Path) -> None:
    """Write one page from a diagnosis (the content of diagnosis.json) and the evidence behind it.

    Every key of `evidence` is optional: title, series, spectra, horizon, bank, bands, cells, equations, confusion,
    forensics, split, parameters, timing_s.
    """
    title = str(evidence.get("title") or "Diagnosis")
    write_page(path, title, tag("h1", title), diagnosis_parts(diagnosis, evidence))


def _after(diagnosis: Facts) -> str:
    """Say what the second model of the comparison has: an effect, a form without a name, or values fitted anew."""
    if diagnosis.get("effects"):
        return "with the effect"
    described = (diagnosis.get("sealed") or {}).get("log_likelihood_gain")
    return "with the form that comes nearest" if described else "parameters refitted"


def diagnosis_parts(diagnosis: Facts, evidence: Facts) -> Html:
    """Build the parts of the page below its title."""
    effects = diagnosis.get("effects") or []
    return join(
        [
            _verdict(diagnosis, effects),
            *(tag("p", f"Warning: {text}", class_="verdict open") for text in diagnosis.get("warnings") or []),
            before_after(evidence, diagnosis.get("sealed") or {}, after=_after(diagnosis)),
            _effects(effects, diagnosis.get("beside") or {}),
            _rivals(effects),
            score_bank(
                evidence.get("bank") or [], {(e.get("id"), (e.get("location") or {}).get("entry")) for e in effects}
            ),
            _where(diagnosis, effects, evidence),
            confusion(evidence.get("confusion") or {}),
            _not_excluded(diagnosis.get("not_excluded") or []),
            _next_experiment(diagnosis.get("next_experiment") or {}),
            _false_alarm(diagnosis.get("false_alarm") or {}),
            appendix(evidence),
        ]
    )


def verdict_sentence(diagnosis: Facts) -> str:
    """Return the one sentence that says the result: the diagnosis's own, else the best effect's, else the verdict's."""
    if diagnosis.get("statement"):
        return _sentence(diagnosis["statement"])
    effects = diagnosis.get("effects") or []
    verdict = diagnosis.get("verdict", "")
    if verdict in ("named", "parameter", "data_fault") and effects and effects[0].get("statement"):
        return _sentence(effects[0]["statement"])
    _, _, general = _VERDICTS.get(verdict, ("", "", ""))
    if verdict in ("multiple", "ambiguous") and effects:
        joined = "; ".join(str(e.get("statement") or e.get("id")).rstrip(".") for e in effects[:3])
        return f"{general} {_sentence(joined)}"
    return general


def _sentence(value: Any) -> str:
    text = str(value).strip()
    text = text[:1].upper() + text[1:]
    return text if not text or text[-1] in ".!?" else text + "."


def _verdict(diagnosis: Facts, effects: list[Facts]) -> Html:
    kind, word, _ = _VERDICTS.get(diagnosis.get("verdict", ""), ("open", str(diagnosis.get("verdict", "")), ""))
    named = f" · {', '.join(str(e.get('id')) for e in effects[:3])}" if effects else ""
    return tag(
        "div",
        tag("div", "Verdict: " + word + named, class_="word"),
        tag("div", verdict_sentence(diagnosis), class_="sentence"),
        tag("div", _proof(diagnosis.get("sealed") or {}, effects)),
        class_=f"verdict {kind}",
    )


def _proof(sealed: Facts, effects: list[Facts]) -> str:
    """Say in one line what the sealed data say, from whatever of it is known."""
    parts = []
    if effects and effects[0].get("parameters"):
        found = effects[0]["parameters"]
        parts.append("estimated " + ", ".join(f"{name} = {quantity(value)}" for name, value in found.items()))
    before, after = sealed.get("nrmse_before") or {}, sealed.get("nrmse_after") or {}
    if effects and after:
        worst = max(after, key=lambda y: (before.get(y) or 0.0) - (after.get(y) or 0.0))
        parts.append(
            f"on data never used before, the error of {worst} falls from {percent(before.get(worst))}"
            f" to {percent(after.get(worst))} of its standard deviation"
        )
    if effects and sealed.get("log_likelihood_gain"):
        interval = sealed.get("interval") or []
        between = f" (90 % interval {number(interval[0])} to {number(interval[1])})" if len(interval) == 2 else ""
        parts.append(f"log-likelihood gain {number(sealed['log_likelihood_gain'])} nats{between}")
    if effects and sealed.get("recovered_fraction") is not None:
        parts.append(f"{percent(sealed['recovered_fraction'], 2)} of what any model could gain")
    text = "; ".join(parts)
    return text[:1].upper() + text[1:] + "." if text else ""


def _effects(effects: list[Facts], beside: Facts) -> Html:
    parts: list[Html | None] = []
    for effect in effects:
        parts += _described(effect.get("id", ""), f"family {effect.get('family', '')}", effect)
    if beside:
        parts += _described(
            "without a name", "no entry of the catalogue has this form; the corrected model has it", beside
        )
    title = {0: "What comes nearest", 1: "The effect"}.get(len(effects), "The effects")
    return section(title if parts else "The effects", *parts)


def _described(name: str, kind: str, effect: Facts) -> list[Html | None]:
    rows = [
        [label, with_std(p.get("value"), p.get("std")), p.get("unit", "")]
        for label, p in (effect.get("parameters") or {}).items()
    ]
    return [
        tag("h3", f"{name} ", tag("span", kind, class_="soft")),
        tag("p", _sentence(effect.get("statement", ""))),
        tag("p", tag("code", effect["equation"])) if effect.get("equation") else None,
        table(["parameter", "#value ± std", "unit"], rows),
        table(["simulator", "what to set"], [[s["simulator"], s["set"]] for s in effect.get("settings") or []]),
    ]


def _rivals(effects: list[Facts]) -> Html:
    if not effects or not any(e.get("rivals") for e in effects):
        return Html("")
    first = effects[0]
    rows = [(first.get("id"), (first.get("location") or {}).get("entry", ""), number(first.get("weight"), 2))]
    rows += [
        (
            r.get("id") if e is first else f"{r.get('id')} in place of {e.get('id')}",
            r.get("entry", ""), number(r.get("weight"), 2),
        )
        for e in effects
        for r in e.get("rivals") or []
    ]  # fmt: skip
    return section(
        "Rivals",
        tag("p", "How the evidence is shared among the effects that could explain this recording (1 in all)."),
        table(["effect", "where", "#weight"], rows, marked=0),
    )


def _where(diagnosis: Facts, effects: list[Facts], evidence: Facts) -> Html:
    places = [(e.get("id"), e["location"]) for e in effects if e.get("location")]
    if diagnosis.get("location") and diagnosis["location"] not in [place for _, place in places]:
        places.append(("evidence, before any name", diagnosis["location"]))
    keys = ["entry", "outputs", "inputs", "frequency_hz", "azimuth_order", "region", "time_s", "recording"]
    used = [k for k in keys if any(place.get(k) not in (None, [], "") for _, place in places)]
    rows = [[name, *(_place(place.get(k)) for k in used)] for name, place in places]
    titles = {"frequency_hz": "frequency (Hz)", "time_s": "time (s)", "azimuth_order": "azimuth order"}
    return section("Where it sits", table(["", *(titles.get(k, k) for k in used)], rows), maps(evidence))


def _place(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, list):
        numeric = len(value) == 2 and all(isinstance(v, int | float) for v in value)
        return " to ".join(f"{v:.3g}" for v in value) if numeric else ", ".join(str(v) for v in value)
    return str(value)


def _not_excluded(entries: list[Facts]) -> Html:
    known = [e for e in entries if (e.get("minimum_detectable") or {}).get("value") is not None]
    rows = [(e.get("id"), e.get("entry", ""), quantity(e["minimum_detectable"], 2)) for e in known]
    silent = sorted({str(e.get("id")) for e in entries if e not in known})
    rest = f"These data say nothing about: {', '.join(silent)}." if silent else None
    return section(
        "What this recording cannot exclude",
        tag("p", "Effects of the catalogue that may be present below the size given here.") if rows else None,
        table(["effect", "where", "#smallest size that would have been found"], rows),
        tag("p", rest) if rest else None,
    )  # fmt: skip


def _next_experiment(entry: Facts) -> Html:
    if not entry.get("text"):
        return Html("")
    minutes = f"{number(entry['minutes'])} min" if entry.get("minutes") else ""
    minutes = f" ({minutes})" if minutes and minutes not in entry["text"] else ""
    separates = entry.get("separates") or []
    apart = f" It tells apart {' and '.join(map(str, separates))}." if len(separates) > 1 else ""
    return section("The next experiment", tag("p", _sentence(entry["text"] + minutes) + apart))


def _false_alarm(entry: Facts) -> Html:
    if not entry.get("sham_runs"):
        return Html("")
    return section(
        "False alarms",
        tag("p", f"The whole procedure was run on {number(entry['sham_runs'])} recordings generated from the model"
            f" itself, which lack nothing: it gave a name in {number(entry.get('false_names'))} of them. The threshold"
            f" of a score here is {number(entry.get('threshold'))}, and less where an effect's tick above is."),
    )  # fmt: skip
