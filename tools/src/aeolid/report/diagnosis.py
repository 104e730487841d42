"""Write the page of a diagnosis: the verdict sentence first, then the proof on sealed data, then the evidence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.diagnose.hypotheses.catalogue import meaning_of, name_of
from aeolid.report.answer import answer, sentence_of, share_of
from aeolid.report.evidence import appendix, before_after, confusion, score_bank
from aeolid.report.markup import CONTENTS, Html, folded, join, section, table, tag, write_page
from aeolid.report.numbers import OPEN, is_open, number, quantity, unit_of, with_std
from aeolid.report.pair import sides
from aeolid.report.ranking import Named, called, label_of, ranking
from aeolid.report.turn import NOT_DRAWN, both_over_turn, errors_over_turn, turns_with_rotor
from aeolid.report.where import maps
from aeolid.wording import counted, place

Facts = dict[str, Any]


def render_diagnosis(diagnosis: Facts, evidence: Facts, path: str | Path) -> None:
    """Write one page from a diagnosis (the content of diagnosis.json) and the evidence behind it.

    Every key of `evidence` is optional: title, series, spectra, horizon, bank, bands, cells, equations, confusion,
    forensics, split, parameters, timing_s, turning, turning_errors.
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
    turns = turns_with_rotor(effects)
    errors = errors_over_turn(evidence.get("turning_errors") or {})
    over_turn = errors or both_over_turn(evidence.get("turning") or {}) or NOT_DRAWN
    found: Named = {(e.get("id"), (e.get("location") or {}).get("entry")) for e in effects}
    return join(
        [
            answer(diagnosis),
            *(tag("p", f"Warning: {text}", class_="verdict open") for text in diagnosis.get("warnings") or []),
            Html(CONTENTS),
            _next_experiment(diagnosis.get("next_experiment") or {}),
            before_after(evidence, diagnosis.get("sealed") or {}, after=_after(diagnosis)),
            _effects(effects, diagnosis.get("beside") or {}, over_turn if turns else None),
            ranking(evidence.get("candidates") or [], found),
            None if diagnosis.get("verdict") == "ambiguous" else _rivals(effects),
            sides(evidence, turning=not turns),
            _where(diagnosis, effects, evidence, None if turns else errors),
            score_bank(evidence.get("bank") or [], found),
            confusion(evidence.get("confusion") or {}),
            _not_excluded(diagnosis.get("not_excluded") or []),
            _false_alarm(diagnosis.get("false_alarm") or {}),
            appendix(evidence),
        ]
    )


def _effects(effects: list[Facts], beside: Facts, over_turn: Html | None) -> Html:
    parts: list[Html | None] = []
    for effect in effects:
        identifier = str(effect.get("id", ""))
        where = place(str((effect.get("location") or {}).get("entry") or ""))
        parts += _described(identifier, name_of(identifier), f"{where} · {identifier} in the catalogue", effect)
    if beside:
        parts += _described(
            "unlisted", "without a name", "no entry of the catalogue has this form; the corrected model has it", beside
        )
    parts.append(over_turn)
    title = {0: "What comes nearest", 1: "The effect"}.get(len(effects), "The effects")
    return section(title, *parts)


def _described(identifier: str, name: str, kind: str, effect: Facts) -> list[Html | None]:
    rows = [
        [_labelled(identifier, label), OPEN if is_open(p.get("value")) else with_std(p.get("value"), p.get("std")),
         unit_of(p)]
        for label, p in (effect.get("parameters") or {}).items()
    ]  # fmt: skip
    return [
        tag("h3", f"{name} ", tag("span", kind.strip(" ·"), class_="soft")),
        tag("p", sentence_of(effect.get("statement", ""))),
        tag("p", tag("code", effect["equation"])) if effect.get("equation") else None,
        table(["parameter", "#value ± std", "unit"], rows),
        table(["simulator", "what to set"], [[s["simulator"], s["set"]] for s in effect.get("settings") or []]),
    ]


def _labelled(identifier: str, symbol: str) -> str:
    """Return what a parameter means with its symbol; the symbol alone where the catalogue does not say."""
    meaning = meaning_of(identifier, symbol)
    return f"{meaning} ({symbol})" if meaning else symbol


def _rivals(effects: list[Facts]) -> Html:
    if not effects or not any(e.get("rivals") for e in effects):
        return Html("")
    first = effects[0]
    entry = (first.get("location") or {}).get("entry")
    rows = [(called(first.get("id"), entry), str(first.get("id")), share_of(first))]
    rows += [
        (
            called(r.get("id"), r.get("entry")) + ("" if e is first else f" in place of {name_of(str(e.get('id')))}"),
            str(r.get("id")), share_of(r),
        )
        for e in effects
        for r in e.get("rivals") or []
    ]  # fmt: skip
    return section(
        "Rivals",
        tag("p", "How the evidence is shared among the effects that could explain this recording."),
        table(["effect", "in the catalogue", "#share"], rows, marked=0),
    )


def _where(diagnosis: Facts, effects: list[Facts], evidence: Facts, over_turn: Html | None) -> Html:
    places = [(name_of(str(e.get("id"))), e["location"]) for e in effects if e.get("location")]
    if diagnosis.get("location") and diagnosis["location"] not in [where for _, where in places]:
        places.append(("evidence, before any name", diagnosis["location"]))
    keys = ["entry", "outputs", "inputs", "frequency_hz", "azimuth_order", "region", "time_s", "recording"]
    used = [k for k in keys if any(where.get(k) not in (None, [], "") for _, where in places)]
    rows = [[name, *(_place(where.get(k), k) for k in used)] for name, where in places]
    titles = {
        "entry": "place",
        "frequency_hz": "frequency (Hz)",
        "time_s": "time (s)",
        "azimuth_order": "azimuth order",
    }
    return section("Where it sits", table(["", *(titles.get(k, k) for k in used)], rows), maps(evidence), over_turn)


def _place(value: Any, key: str) -> str:
    if value is None:
        return "–"
    if key == "entry":
        return place(str(value)) or "–"
    if isinstance(value, list):
        numeric = len(value) == 2 and all(isinstance(v, int | float) for v in value)
        return " to ".join(f"{v:.3g}" for v in value) if numeric else ", ".join(str(v) for v in value)
    return str(value)


def _not_excluded(entries: list[Facts]) -> Html:
    known = [e for e in entries if (e.get("minimum_detectable") or {}).get("value") is not None]
    known = [e for e in known if not is_open(e["minimum_detectable"]["value"])]
    rows = [
        (name_of(str(e.get("id"))), place(str(e.get("entry") or "")), _symbol(e), quantity(e["minimum_detectable"], 2))
        for e in known
    ]
    silent = sorted({name_of(str(e.get("id"))) for e in entries if e not in known})
    rest = f"These data say nothing about: {', '.join(silent)}." if silent else None
    return section(
        "What this recording cannot exclude",
        tag("p", f"{counted(len(rows), 'effect')} may be present below a size that would have been "
            "found.") if rows else None,
        folded("The sizes", table(["effect", "where", "of", "#smallest size that would have been found"], rows)),
        tag("p", rest) if rest else None,
    )  # fmt: skip


def _symbol(entry: Facts) -> str:
    symbol = str(entry["minimum_detectable"].get("parameter") or "")
    return meaning_of(str(entry.get("id")), symbol) or symbol.replace("_", " ")


def _next_experiment(entry: Facts) -> Html:
    if not entry.get("text"):
        return Html("")
    minutes = f"{number(entry['minutes'])} min" if entry.get("minutes") else ""
    minutes = f" ({minutes})" if minutes and minutes not in entry["text"] else ""
    separates = entry.get("separates") or []
    apart = f" It tells apart {' and '.join(map(label_of, map(str, separates)))}." if len(separates) > 1 else ""
    return section("What to record next", tag("p", sentence_of(entry["text"] + minutes) + apart))


def _false_alarm(entry: Facts) -> Html:
    if not entry.get("sham_runs"):
        return Html("")
    return section(
        "False alarms",
        tag("p", f"The whole procedure was run on {number(entry['sham_runs'])} recordings generated from the model"
            f" itself, which lack nothing: it gave a name in {number(entry.get('false_names'))} of them. The threshold"
            f" of a score here is {number(entry.get('threshold'))}, and less where an effect's tick above is."),
    )  # fmt: skip
