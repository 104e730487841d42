"""Write the page of a fleet: modes over time with their bands, what drifts, what was left out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.fleet.onset import conclusions
from aeolid.report.fleet_charts import (
    Colours,
    clock_of,
    colours_of,
    draw_changes,
    draw_modes,
    draw_park,
    label_of,
    newest,
)
from aeolid.report.markup import Html, figure, folded, join, section, table, tag, write_page
from aeolid.report.numbers import number, with_std
from aeolid.wording import counted

Facts = dict[str, Any]
_MOST_ROWS = 30  # of a table that stands open
_MOST_TURBINES = 60  # drawn on one page; the table holds all


def render_fleet(facts: Facts, path: str | Path) -> None:
    """Write the page; facts as of `run_fleet`. Raises UsageError where the file cannot be written."""
    turbines = list(dict.fromkeys(p["turbine"] for p in facts["periods"]))
    title = f"Fleet of {len(turbines)} turbine{'s' if len(turbines) != 1 else ''}"
    left = len(turbines) - _MOST_TURBINES
    colours = colours_of(facts["periods"])
    more = tag("p", f"{left} more turbines are in modes.parquet.", class_="soft") if left > 0 else None
    turned = [_turbine(facts, name, colours) for name in turbines[:_MOST_TURBINES]]
    notes = [tag("p", f"Note: {note}.", class_="soft") for note in facts.get("notes", [])]
    write_page(
        path, title, tag("h1", title), tag("p", _summary(facts)), *notes, _drifts(facts), _overview(facts, colours),
        *turned, more, _skipped(facts), _settings(facts),
    )  # fmt: skip


def _summary(facts: Facts) -> str:
    count, usable = facts["recordings"], facts["usable"]
    parts = [f"{usable} of {counted(count, 'recording')} used, {counted(len(facts['periods']), 'period')} modelled"]
    if facts["skipped"]:
        parts.append(f"{len(facts['skipped'])} entries left out, each with its reason below")
    return "; ".join(parts) + "."


def _significance(track: Facts, key: str) -> float:
    drift = track[key]["drift"]
    return abs(drift["slope"]) / drift["slope_std"] if drift and drift["slope_std"] > 0 else 0.0


def _oscillates(track: Facts) -> bool:
    return bool(abs(track["damping"]["last"]) < 1)


def _drifts(facts: Facts) -> Html:
    rows = []
    for track in facts["tracks"]:
        if not _oscillates(track):
            continue
        cells = [track["turbine"], label_of(track, facts["periods"]), track["periods"]]
        for key, unit in (("frequency_hz", 1e3), ("damping", 100.0)):
            drift = track[key]["drift"]
            cells += [number(track[key]["last"] * (1 if unit == 1e3 else unit), 4)]
            cells += [with_std(unit * drift["change"], unit * drift["change_std"]) if drift else "–"]
            cells += [number(_significance(track, key), 2) if drift else "–"]
        rows.append(cells)
    told = [tag("p", text.replace("no mode moved", "No mode moved") + ".") for text in conclusions(facts)]
    head = ["turbine", "mode", "#periods", "#frequency (Hz)", "#change (mHz)", "#|z|",
            "#damping (%)", "#change (points)", "#|z|"]  # fmt: skip
    note = "Change in the table: of a weighted straight line over all periods; |z|: its standard deviations."
    shown = join([tag("p", note, class_="soft"), table(head, rows)])
    return section(
        "Drift of modes", *told, shown if len(rows) <= _MOST_ROWS else folded(counted(len(rows), "mode"), shown)
    )


def _turbine(facts: Facts, name: str, colours: Colours) -> Html:
    periods = [p for p in facts["periods"] if p["turbine"] == name]
    reason = facts["order_reasons"].get(name)
    clock = clock_of(periods)
    caption = "Oscillating modes found in each period, with bands of two standard deviations."
    told = tag("p", reason, class_="soft") if reason else None
    drawn = figure(draw_modes(periods, clock, colours), caption)
    changed = draw_changes(periods, clock, colours)
    below = "Modes found in most periods with less than 20 % damping, about their own means."
    return section(f"Turbine {name}", told, drawn, None if changed is None else figure(changed, below))


def _overview(facts: Facts, colours: Colours) -> Html:
    """Show the whole park in one picture and one table: where each mode is now in each turbine, and how it moved."""
    last, names = newest(facts["tracks"], facts["periods"])
    turbines = list(dict.fromkeys(t for t, _ in last))
    if len(turbines) < 2 or not names:
        return Html("")
    rows = [
        (t, *(_now(last[t, n]) if (t, n) in last else "–" for n in names)) for t in turbines
    ]  # fmt: skip
    caption = (
        "Each lightly damped mode of each turbine in its newest period, against the median of the park; bars are two"
        " standard deviations. Turbines of one type lie on one line: what lies apart has another tower, drive train or"
        " foundation, or has changed."
    )
    note = "Frequency in Hz, its change over all periods in brackets where it is more than chance."
    head = ["turbine", *(f"#{n}" for n in names)]
    return section(
        "The park",
        figure(draw_park(last, turbines, names, colours), caption),
        tag("p", note, class_="soft"),
        table(head, rows),
    )


def _now(track: Facts) -> str:
    moved = _significance(track, "frequency_hz") > 3.0
    drift = track["frequency_hz"]["drift"]
    change = f" ({1e3 * drift['change']:+.1f} mHz)".replace("-", "−") if moved else ""
    return number(track["frequency_hz"]["last"], 4) + change


def _skipped(facts: Facts) -> Html:
    rows = [(row["kind"], row["name"], row["reason"]) for row in facts["skipped"]]
    left = table(["", "which", "reason"], rows)
    return section("Left out", left if len(rows) <= _MOST_ROWS else folded(f"{len(rows)} entries", left))


def _settings(facts: Facts) -> Html:
    rows = [(key.replace("_", " "), ", ".join(value) if isinstance(value, list) else str(value))
            for key, value in facts["settings"].items() if value not in (None, [])]  # fmt: skip
    used = ("recordings reused from an earlier run", str(facts["reused"]))
    return section("What was run", join([table(["", ""], [*rows, used])]))
