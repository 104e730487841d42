"""Write the page of the modes of a periodic model, and draw at which frequencies they are seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aeolid.report import charts
from aeolid.report.floquet_text import SHOWN, growth, harmonics_of, order_text, stability
from aeolid.report.markup import Html, figure, section, table, tag, write_page
from aeolid.report.numbers import number, with_std

Facts = dict[str, Any]
_LARGEST = 180.0  # points² of the dot of a participation of 1
_MOST = 40  # modes on a page


def render_floquet(facts: Facts, path: str | Path, title: str) -> None:
    """Write one page from the facts of an analysis (`Floquet.to_json`)."""
    speed = 60 * abs(facts["rotor_hz"])
    found = (
        f"{number(speed, 4)} rpm by {facts['angle']}, {number(facts['samples_per_revolution'], 4)} samples a "
        f"revolution, {facts['harmonics']} harmonics. {stability(facts).capitalize()}."
    )
    write_page(
        path, title, tag("h1", title), tag("p", found), *(tag("p", n, class_="warn") for n in facts["notes"]),
        _picture(facts), section("Modes", _modes(facts), tag("p", _SAID, class_="soft")),
        section("Harmonics", _harmonics(facts)),
    )  # fmt: skip


_SAID = (
    "Frequency and damping are those of the harmonic that moves the outputs most. ± is one standard deviation; without "
    "one it is not known. The exponent is that of the family nearest to the real axis; a revolution multiplies the "
    "motion with what the last column says, above 1 where it grows."
)


def draw(facts: Facts, axes: Any) -> None:
    """Draw a row a mode: dots where it is seen, their area the largest participation over the outputs.

    What turns against the others, at a negative frequency, has its order below the dot.
    """
    modes = facts["modes"][:_MOST]
    for i, mode in enumerate(modes):
        for h in mode["harmonics"]:
            share = max(h["participation"].values(), default=0.0)
            if share < SHOWN:
                continue
            hertz, colour = abs(h["frequency_hz"]), charts.AFTER if h["order"] == 0 else charts.GREY
            axes.scatter([hertz], [i], s=_LARGEST * share + 4, color=colour, zorder=3)
            axes.annotate(
                order_text(h["order"]),
                (hertz, i),
                xytext=(0, 9 if h["frequency_hz"] >= 0 else -15),
                textcoords="offset points",
                fontsize=7,
                ha="center",
            )
    axes.set_yticks(range(len(modes)), [f"{m['frequency_hz']:.4g} Hz, {100 * m['damping']:.3g} %" for m in modes])
    axes.set_ylim(len(modes) - 0.4, -0.8)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("frequency at which it is seen (Hz)")


def _picture(facts: Facts) -> Html:
    if not facts["modes"]:
        return Html("")
    with charts.sketch((10.6, 1.2 + 0.45 * min(len(facts["modes"]), _MOST))) as drawing:
        draw(facts, drawing.axes[0, 0])
    caption = (
        "Each row is a mode. Blue is the frequency that names it; grey dots are where it is seen besides, multiples of "
        "the rotor's speed away. The area is the participation in the output where it is largest."
    )
    return figure(drawing.svg, caption)


def _modes(facts: Facts) -> Html:
    rows = [
        [number(i), with_std(m["frequency_hz"], m["frequency_std_hz"], 4),
         with_std(100 * m["damping"], None if m["damping_std"] is None else 100 * m["damping_std"]),
         "–" if m["principal_exponent"] is None else _complex(m["principal_exponent"]), growth(m["multiplier"])]
        for i, m in enumerate(facts["modes"], 1)
    ]  # fmt: skip
    return table(["#mode", "#frequency (Hz)", "#damping (%)", "#exponent (1/s)", "#after a revolution"], rows)


def _complex(pair: list[float]) -> str:
    return f"{number(pair[0], 3)} {'−' if pair[1] < 0 else '+'} {number(abs(pair[1]), 3)}i"


def _harmonics(facts: Facts) -> Html:
    rows = [
        [f"{number(mode['frequency_hz'], 4)} Hz", *(harmonics_of(mode, name) for name in facts["outputs"])]
        for mode in facts["modes"][:_MOST]
    ]
    return table(["mode", *facts["outputs"]], rows)
