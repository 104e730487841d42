"""Write the page of a diagnosis: the verdict sentence first, then the proof on sealed data, then the evidence."""

from __future__ import annotations

from collections.abc import Sequence
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
_DEVIATION = "± is one standard deviation."
_ALLOWED = (  # candidates.form_share and constant_share of the rules, as they are by default
    " Beside the uncertainty of the fit it allows 1 % of an effect's size for its form, 2 % for each constant of the"
    " model that is not fitted, and 1/√3 of a sample for delays and lags that all inputs or the only output share."
)
_SIZES = "smallest size that would have been found"


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
            _effects(effects, diagnosis.get("beside") or {}, over_turn if turns else None, "run" in diagnosis),
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


def _effects(effects: list[Facts], beside: Facts, over_turn: Html | None, is_run: bool) -> Html:
    parts: list[Html | None] = []
    for effect in effects:
        identifier = str(effect.get("id", ""))
        where = place(str((effect.get("location") or {}).get("entry") or ""))
        parts += _described(identifier, name_of(identifier), f"{where} · {identifier} in the catalogue", effect)
    if beside:
        parts += _described(
            "unlisted", "without a name", "no entry of the catalogue has this form; the corrected model has it", beside
        )
    if any(e.get("parameters") for e in (*effects, beside)):
        parts.append(tag("p", _DEVIATION if is_run else _DEVIATION + _ALLOWED, class_="soft"))
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
    """List the effects that may be there below a size, each once at each place, and those that the data cannot test."""
    sizes: dict[tuple[str, str], dict[str, list[Facts]]] = {}
    silent: set[tuple[str, str]] = set()
    for e in entries:
        least, where = e.get("minimum_detectable") or {}, (str(e.get("id")), str(e.get("entry") or ""))
        if is_open(least.get("value")):
            silent.add(where)
        else:
            sizes.setdefault(where, {}).setdefault(_symbol(e), []).append(least)
    tested = {identifier for identifier, _ in sizes}
    untold = {called(*w) if w[0] in tested else name_of(w[0]) for w in silent - sizes.keys()}
    rows = [
        (name_of(identifier), place(entry), "; ".join(f"{what} {_range(least)}" for what, least in found.items()),
         identifier)
        for (identifier, entry), found in sizes.items()
    ]  # fmt: skip
    rest = f"These data say nothing about: {'; '.join(sorted(untold))}." if untold else None
    many = counted(len(tested), "effect")
    return section(
        "What this recording cannot exclude",
        tag("p", f"{many} may be present below the size that would have been found.") if rows else None,
        folded("The sizes", table(["effect", "where", _SIZES, "in the catalogue"], rows)),
        tag("p", rest) if rest else None,
    )  # fmt: skip


def _range(sizes: Sequence[Facts]) -> str:
    """Return the size of an effect; from the least to the greatest where it depends on the form of the effect."""
    ordered = sorted(sizes, key=lambda s: float(s["value"]))
    least, most = quantity(ordered[0], 2), quantity(ordered[-1], 2)
    return least if least == most else f"{least} to {most}, by its form"


def _symbol(entry: Facts) -> str:
    symbol = str(entry["minimum_detectable"].get("parameter") or "")
    return meaning_of(str(entry.get("id")), symbol) or symbol.replace("_", " ")


def _next_experiment(entry: Facts) -> Html:
    if not entry.get("text"):
        return Html("")
    minutes = f"{number(entry['minutes'])} min" if entry.get("minutes") else ""
    told = minutes in entry["text"] or f"{entry.get('minutes') or 0:.3g} min" in entry["text"]
    minutes = "" if not minutes or told else f" ({minutes})"
    separates = [label_of(str(s)) for s in entry.get("separates") or []]
    new = len(separates) > 1 and not all(s in entry["text"] for s in separates)
    apart = f" It tells apart {' and '.join(separates)}." if new else ""
    return section("What to record next", tag("p", sentence_of(entry["text"] + minutes) + apart))


def _false_alarm(entry: Facts) -> Html:
    if entry.get("text"):
        return section("False alarms", tag("p", entry["text"]))
    if not entry.get("sham_runs"):
        return Html("")
    return section(
        "False alarms",
        tag("p", f"The whole procedure was run on {number(entry['sham_runs'])} recordings generated from the model"
            f" itself, in which nothing is missing: it named an effect in {number(entry.get('false_names'))} of them."
            f" The threshold of significance of the scores is {number(entry.get('threshold'))}; orange ticks above mark"
            " lower ones."),
    )  # fmt: skip
