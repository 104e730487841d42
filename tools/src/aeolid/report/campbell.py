"""Write the page of a Campbell diagram: the picture, the modes of each recording, what is no mode, the recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.report import charts
from aeolid.report.campbell_chart import draw, has_wind
from aeolid.report.markup import Html, figure, notes_part, section, table, tag, write_page
from aeolid.report.numbers import number, with_std
from aeolid.wording import counted

Facts = dict[str, Any]


def render_campbell(facts: Facts, path: str | Path, title: str) -> None:
    """Write one page from the facts of a Campbell diagram (`Campbell.to_json`)."""
    runs, tracks = facts["runs"], facts["tracks"]
    found = f"{counted(len(tracks), 'mode')} followed over {len(runs)} recordings, by their outputs alone."
    write_page(
        path, title, tag("h1", title), tag("p", found), _picture(facts),
        section("Modes", _table(facts, _hertz, "frequency (Hz)"), _table(facts, _damping, "damping (%)"), _note()),
        section("On the blades", _on_blades(facts)), _others(facts),
        notes_part([note for r in runs for note in r["notes"]]), _recordings(runs),
    )  # fmt: skip


def _picture(facts: Facts) -> Html:
    columns = 2 if has_wind(facts) else 1
    with charts.sketch((10.6, 5.2), 1, columns, sharey=True) as drawing:
        draw(facts, drawing.axes)
    caption = (
        "Natural frequencies of the modes of each recording, seen from the tower; bars are 95 % bands. Dashed lines "
        "are multiples of the rotor's speed. Grey dots were found in one recording only."
    )
    return figure(drawing.svg, caption)


def _heads(runs: list[Facts]) -> list[str]:
    return [
        f"#{number(60 * r['rotor_hz'], 3)} rpm" + ("" if r["wind_m_s"] is None else f", {number(r['wind_m_s'], 3)} m/s")
        for r in runs
    ]


def _table(facts: Facts, cell: Any, what: str) -> Html:
    rows = [[t["name"] or "–", *(cell(m) for m in t["modes"])] for t in facts["tracks"]]
    return table([f"mode: {what}", *_heads(facts["runs"])], rows)


def _hertz(mode: Facts | None) -> str:
    return "–" if mode is None else with_std(mode["frequency_hz"], mode["frequency_std_hz"], 4)


def _damping(mode: Facts | None) -> str:
    return "–" if mode is None else with_std(100 * mode["damping"], 100 * (mode["damping_std"] or 0.0))


def _note() -> Html:
    text = (
        "± is one standard deviation. A dash: not found there, or not told from a multiple of the rotor's speed. Modes "
        "are those of the loop, the controller included."
    )
    return tag("p", text, class_="soft")


def _on_blades(facts: Facts) -> Html:
    rows = [
        [t["name"] or "–", *(_blade(m) for m in t["modes"])] for t in facts["tracks"]
        if any(m and (m.get("whirl") or {}).get("direction") in ("forward", "backward") for m in t["modes"])
        and t["name"].partition(",")[0].removeprefix("2nd ").startswith("blade")
    ]  # fmt: skip
    note = "Frequency in Hz in the frame that turns with the blades: a forward whirl's less 1P, a backward one's plus."
    return Html(table(["mode", *_heads(facts["runs"])], rows) + tag("p", note, class_="soft")) if rows else Html("")


def _blade(mode: Facts | None) -> str:
    whirl = (mode or {}).get("whirl") or {}
    return number(whirl.get("blade_frequency_hz"), 4)


def _others(facts: Facts) -> Html:
    rows = [
        [why, t["name"] or "–", number(m["frequency_hz"], 4), _head(r)]
        for why, some in (("in one recording only", facts["single"]), ("on a line of the rotor", facts["lines"]))
        for t in some for m, r in zip(t["modes"], facts["runs"], strict=True) if m
    ]  # fmt: skip
    rows += [
        ["harmonic", m["name"] or "steady sine", number(m["frequency_hz"], 4), _head(r)]
        for r in facts["runs"] for m in r["harmonics"]
    ]  # fmt: skip
    return section("What is not followed", table(["why", "", "#frequency (Hz)", "recording"], rows))


def _head(run: Facts) -> str:
    return Path(run["source"]).name


def _recordings(runs: list[Facts]) -> Html:
    rows = [
        [r["source"], number(r["samples"]), number(r["sample_time_s"], 3), number(r["past"]), number(r["order"]),
         with_std(60 * r["rotor_hz"], 60 * r["rotor_deviation_hz"]), number(r["wind_m_s"], 3)]
        for r in runs
    ]  # fmt: skip
    heads = ["recording", "#samples", "#sample time used (s)", "#window", "#order", "#rotor (rpm)", "#wind (m/s)"]
    return section("Recordings", table(heads, rows))
