"""Write the page of a fleet: modes over time with their bands, what drifts, what was left out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aeolid.fleet.onset import LIGHT
from aeolid.fleet.plan import DAY
from aeolid.report import charts
from aeolid.report.markup import Html, figure, join, section, table, tag, write_page
from aeolid.report.numbers import number, with_std

Facts = dict[str, Any]
_MOST_TURBINES = 60  # drawn on one page; the table holds all
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#1b1f24")
_MARKERS = "osD^vPX"


def render_fleet(facts: Facts, path: str | Path) -> None:
    """Write the page; facts as of `run_fleet`. Raises UsageError where the file cannot be written."""
    turbines = list(dict.fromkeys(p["turbine"] for p in facts["periods"]))
    title = f"Fleet of {len(turbines)} turbine{'s' if len(turbines) != 1 else ''}"
    left = len(turbines) - _MOST_TURBINES
    more = tag("p", f"{left} more turbines are in modes.parquet.", class_="soft") if left > 0 else None
    write_page(
        path, title, tag("h1", title), tag("p", _summary(facts)),
        *(tag("p", f"Note: {note}.", class_="soft") for note in facts.get("notes", [])), _drifts(facts),
        *(_turbine(facts, name) for name in turbines[:_MOST_TURBINES]), more, _skipped(facts), _settings(facts),
    )  # fmt: skip


def _summary(facts: Facts) -> str:
    count, usable = facts["recordings"], facts["usable"]
    parts = [f"{usable} of {count} recordings used, {len(facts['periods'])} periods modelled"]
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
        harmonic = f"{track['rotor_order']}P" if track["rotor_order"] else ""
        cells = [track["turbine"], track["track"], harmonic, track["periods"]]
        for key, unit in (("frequency_hz", 1e3), ("damping", 100.0)):
            drift = track[key]["drift"]
            cells += [number(track[key]["last"] * (1 if unit == 1e3 else unit), 4)]
            cells += [with_std(unit * drift["change"], unit * drift["change_std"]) if drift else "–"]
            cells += [number(_significance(track, key), 2) if drift else "–"]
        rows.append(cells)
    moved = facts.get("moved", [])
    told = [tag("p", text + ".") for text in moved] or [tag("p", "No mode moved by more than chance.")]
    head = ["turbine", "#mode", "harmonic", "#periods", "#frequency (Hz)", "#change (mHz)", "#|z|",
            "#damping (%)", "#change (points)", "#|z|"]  # fmt: skip
    note = "Change in the table: of a weighted straight line over all periods; |z|: its standard deviations."
    return section("Drift of modes", *told, tag("p", note, class_="soft"), table(head, rows))


def _turbine(facts: Facts, name: str) -> Html:
    periods = [p for p in facts["periods"] if p["turbine"] == name]
    reason = facts["order_reasons"].get(name)
    starts = np.array([p["start_s"] for p in periods])
    clocked = len(set(starts.tolist())) > 1
    times = (starts - starts[0]) / DAY if clocked else np.arange(float(len(periods)))
    with charts.sketch(charts.WIDE, 1, 2) as drawing:
        for axes, key, unit, text in zip(
            drawing.axes[0], ("frequency_hz", "damping"), (1.0, 100.0), ("frequency (Hz)", "damping (%)"), strict=True
        ):
            _lines(axes, periods, times, key, unit)
            axes.set_ylabel(text)
            axes.set_xlabel(f"days since {periods[0]['period']}" if clocked else "period")
        if drawing.axes[0, 0].get_legend_handles_labels()[1]:
            drawing.axes[0, 0].legend(fontsize=8, ncols=2)
    caption = "Oscillating modes found in each period, with bands of two standard deviations."
    told = tag("p", reason, class_="soft") if reason else None
    label = f"days since {periods[0]['period']}" if clocked else "period"
    return section(f"Turbine {name}", told, figure(drawing.svg, caption), _changes(periods, times, label))


def _changes(periods: list[Facts], times: Any, label: str) -> Html | None:
    """Draw how far the frequency of each lasting, lightly damped mode is from its mean: 3 % is nothing in Hz."""
    tracks: dict[int, list[tuple[float, float, float]]] = {}
    for time, period in zip(times, periods, strict=True):
        for mode in period["modes"]:
            if abs(mode["damping"]) < LIGHT:
                point = (float(time), mode["frequency_hz"], mode["frequency_std_hz"] or 0.0)
                tracks.setdefault(mode["track"], []).append(point)
    lasting = {number: np.array(points).T for number, points in tracks.items() if 2 * len(points) > len(periods) > 2}
    if not lasting:
        return None
    with charts.sketch(charts.WIDE) as drawing:
        axes = drawing.axes[0, 0]
        for place, (number, (t, y, s)) in enumerate(sorted(lasting.items())):
            colour, mean = _COLOURS[place % len(_COLOURS)], float(y.mean())
            change, band = 100 * (y / mean - 1), 200 * s / mean
            marker = _MARKERS[place % len(_MARKERS)]
            label_of = f"mode {number}, {mean:.4g} Hz"
            axes.plot(t, change, color=colour, marker=marker, markersize=3, label=label_of)
            axes.fill_between(t, change - band, change + band, color=colour, alpha=0.2, linewidth=0)
        axes.set_ylabel("frequency, from its mean (%)")
        axes.set_xlabel(label)
        axes.legend(fontsize=8, ncols=3)
    return figure(drawing.svg, "Modes found in most periods with less than 20 % damping, about their own means.")


def _lines(axes: Any, periods: list[Facts], times: Any, key: str, unit: float) -> None:
    """Draw a line and its band for each track that oscillates in some period."""
    std = "frequency_std_hz" if key == "frequency_hz" else "damping_std"
    tracks: dict[int, list[tuple[float, float, float]]] = {}
    for time, period in zip(times, periods, strict=True):
        for mode in period["modes"]:
            if abs(mode["damping"]) < 1:
                point = (float(time), unit * mode[key], unit * (mode[std] or 0.0))
                tracks.setdefault(mode["track"], []).append(point)
    for place, (track, points) in enumerate(sorted(tracks.items())):
        t, y, s = np.array(points).T
        colour, marker = _COLOURS[place % len(_COLOURS)], _MARKERS[place % len(_MARKERS)]
        axes.plot(t, y, color=colour, marker=marker, markersize=3, label=f"mode {track}")
        if len(t) > 1:
            axes.fill_between(t, y - 2 * s, y + 2 * s, color=colour, alpha=0.2, linewidth=0)
        else:
            axes.errorbar(t, y, 2 * s, color=colour, capsize=3)


def _skipped(facts: Facts) -> Html:
    rows = [(row["kind"], row["name"], row["reason"]) for row in facts["skipped"]]
    return section("Left out", table(["", "which", "reason"], rows))


def _settings(facts: Facts) -> Html:
    rows = [(key.replace("_", " "), ", ".join(value) if isinstance(value, list) else str(value))
            for key, value in facts["settings"].items() if value not in (None, [])]  # fmt: skip
    used = ("recordings reused from an earlier run", str(facts["reused"]))
    return section("What was run", join([table(["", ""], [*rows, used])]))
