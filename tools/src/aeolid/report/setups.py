"""Write the page of merged set-ups: the modes with their shapes, what each set-up says, and its diagram."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.report.frames import frames_part
from aeolid.report.identification import mode_table
from aeolid.report.markup import Html, folded, notes_part, section, table, tag, write_page
from aeolid.report.numbers import number, with_std
from aeolid.report.shapes import shapes_part
from aeolid.report.stabilisation import criteria_table, diagram_part
from aeolid.wording import counted

Facts = dict[str, Any]


def render_setups(facts: Facts, path: str | Path, title: str) -> None:
    """Write one page from the facts of merged set-ups (`MergedModal.to_json`)."""
    modes, setups = facts["modes"], facts["setups"]
    found = f"{counted(len(modes), 'mode')} of {counted(len(facts['outputs']), 'sensor')} in {len(setups)} "
    found += f"set-ups, merged by the references {', '.join(facts['references'])}"
    order = facts["order"]
    found += ", mode by mode (PoSER)." if order is None else f", to one realisation of {order} states (PreGER)."
    notes = [*(note for m in modes for note in m["notes"]), *facts["notes"]]
    write_page(
        path, title, tag("h1", title), tag("p", found),
        section("Modes", mode_table([(m, None) for m in modes], False)) if modes else None,
        notes_part(notes),
        frames_part(facts), shapes_part(modes, dict.fromkeys(facts["outputs"], "")),
        section("What each set-up says", _by_setup(modes, len(setups)), tag("p", _SAYS, class_="soft")),
        *(_setup(i, setup, facts["references"]) for i, setup in enumerate(setups)),
    )  # fmt: skip


_SAYS = (
    "Frequency in Hz and damping in percent, each with one standard deviation. The last column is the least modal "
    "assurance criterion of two set-ups on the references: 1 for the same shape."
)


def _by_setup(modes: list[Facts], count: int) -> Html:
    rows = []
    for mode in modes:
        told = {s["setup"]: s for s in mode["setups"]}
        rows.append([
            mode.get("name") or "", number(mode["frequency_hz"], 4),
            *(_seen(told.get(i + 1)) for i in range(count)), number(mode["lowest_assurance"], 4),
        ])  # fmt: skip
    heads = ["mode", "#merged (Hz)", *(f"#set-up {i + 1}" for i in range(count)), "#assurance"]
    return table(heads, rows)


def _seen(told: Facts | None) -> str:
    if told is None:
        return "not found"
    hertz = with_std(told["frequency_hz"], told["frequency_std_hz"])
    node = "" if told["joined"] else ", node"
    return f"{hertz}; {with_std(100 * told['damping'], 100 * told['damping_std'])}{node}"


def _setup(i: int, setup: Facts, references: list[str]) -> Html:
    others = ", ".join(n for n in setup["outputs"] if n not in references) or "none besides the references"
    source = ", ".join(str(d["source"]) for d in setup["data"])
    told = f"Sensors: {others}. The references move {number(setup['level'], 3)} times as much as in set-up 1."
    return section(
        f"Set-up {i + 1}: {source}", tag("p", told), diagram_part(setup, f"u{i}s"),
        folded("Criteria", criteria_table(setup)),
    )  # fmt: skip
