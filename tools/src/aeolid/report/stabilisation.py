"""Write the page of a modal analysis: the stabilisation diagram, the modes with their shapes, harmonics, criteria.

The diagram is drawn here as SVG, a mark a pole that says its numbers when pointed at; what is shown is chosen by
check-boxes that style sheets alone obey, so that the page needs no script.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.report.frames import frames_part
from aeolid.report.identification import mode_table
from aeolid.report.markup import Html, figure, join, notes_part, section, table, tag, write_page
from aeolid.report.numbers import number, percent, with_std
from aeolid.report.shapes import shapes_part
from aeolid.wording import counted

Facts = dict[str, Any]
_NORMAL = 1.96  # 95 %
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 1060, 460, 56, 12, 10, 44
_KINDS = {"mode": "after", "line": "before", "spurious": "grey"}  # colours of the page, in its dark scheme too
_RULES = [
    *(f".kind-{kind} {{ fill: var(--{name}); stroke: var(--{name}); }}" for kind, name in _KINDS.items()),
    "figure svg.wide text { fill: var(--ink); }", ".axis { fill: none; stroke: var(--soft); }",
    ".grid { stroke: var(--grid); }", ".curve { fill: none; stroke: var(--grey); opacity: .6; }",
]  # fmt: skip
_WORDS = {"mode": "modes", "line": "harmonics and steady sines", "spurious": "spurious poles"}


def render_modal(facts: Facts, path: str | Path, title: str) -> None:
    """Write one page from the facts of a modal analysis (`Modal.to_json`)."""
    modes, lines = facts["modes"], facts["harmonics"]
    step = facts["sample_time_s"]
    found = f"{counted(len(modes), 'mode')}, {len(lines)} harmonics and steady sines, from "
    found += f"{counted(len(facts['outputs']), 'output')} at {number(1 / step, 3)} samples a second."
    write_page(
        path, title, tag("h1", title), tag("p", found), diagram_part(facts),
        section("Modes", mode_table([(m, None) for m in modes], False), _stability(modes)) if modes else None,
        section("On the blades", _whirls(modes)), frames_part(facts),
        shapes_part(modes, dict.fromkeys(facts["outputs"], "")),
        section("Harmonics and steady sines", mode_table([(m, None) for m in lines], False)) if lines else None,
        notes_part(facts.get("notes") or []), section("Criteria", criteria_table(facts)),
    )  # fmt: skip


def _stability(modes: list[Facts]) -> Html:
    rows = [
        [m.get("name") or "", number(m["frequency_hz"], 4), percent(m["stability"]["share"], 3),
         _range(m["stability"]["frequency_hz"], 1.0), _range(m["stability"]["damping"], 100.0)]
        for m in modes
    ]  # fmt: skip
    heads = ["mode", "#frequency (Hz)", "#in models that count", "#poles between (Hz)", "#damping between (%)"]
    return table(heads, rows)


def _whirls(modes: list[Facts]) -> Html:
    """Build the table of how modes move the blades; empty where no set of them is in the fixed frame."""
    told = [(m, m["whirl"]) for m in modes if m.get("whirl")]
    rows = [
        [m.get("name") or "", number(m["frequency_hz"], 4), w["blades"], w["direction"], percent(w["collective"], 2),
         number(w["blade_frequency_hz"], 4)]
        for m, w in told
    ]  # fmt: skip
    heads = ["mode", "#frequency (Hz)", "blades", "whirling", "#of it all blades alike", "#on the blade (Hz)"]
    return table(heads, rows)


def _range(ends: list[float], factor: float) -> str:
    return f"{number(factor * ends[0], 4)} … {number(factor * ends[1], 4)}"


def criteria_table(facts: Facts) -> Html:
    """Build the table of what decided, and of the recordings."""
    c = facts["criteria"]
    told = [
        ("windows (samples)", ", ".join(map(str, facts["windows"]))),
        ("orders", f"{facts['orders'][0]} … {facts['orders'][1]}; {facts['order']} predicts held-out samples"),
        ("a pole is looked at", f"damping up to {percent(c['most_damping'])}, deviations of frequency and damping "
         f"below {c['width']:g} times those of a mode that stands alone above the noise"),
        ("poles are one mode", f"frequency within {percent(c['frequency'])} or {c['deviations']:g} deviations, damping "
         f"within {c['deviations']:g} deviations and {percent(c['damping'])}, assurance above {c['assurance']:g}"),
        ("a mode is physical", f"in {percent(c['share'])} of the models that count and in half of each window's"),
    ]  # fmt: skip
    if facts.get("rotor_hz"):
        told.insert(0, ("rotor (Hz)", with_std(facts["rotor_hz"], facts["rotor_deviation_hz"])))
    told += [("recording", f"{d['source']}, {number(d['samples'])} samples") for d in facts["data"]]
    return table(["", ""], told)


def diagram_part(facts: Facts, prefix: str = "s") -> Html:
    """Build the check-boxes and the drawing they act on; prefix: of their names, one a diagram of a page."""
    switches = [("kind", k, _WORDS[k], k != "spurious" or len(facts["poles"]["order"]) < 4000) for k in _KINDS]
    switches += [("window", str(w), f"window {w}", True) for w in facts["windows"]]
    boxes, rules = [], [*_RULES]
    for i, (what, value, text, on) in enumerate(switches):
        name = f"{prefix}{i}"
        rules.append(f"#{name}:not(:checked) ~ figure .{what}-{value} {{ display: none; }}")
        boxes.append(Html(f'<input type="checkbox" id="{name}"{" checked" if on else ""}>'))
        boxes.append(tag("label", f" {text} \u2003", for_=name))
    caption = (
        "Poles over frequency and order. Lines through modes are 95 % bands; the grey curve is the sum of the outputs' "
        "spectra, each in its own scale, in decibels. Point at a mark for its numbers."
    )
    style = tag("style", Html("\n".join(rules)))
    return tag("section", style, *boxes, figure(_drawing(facts), caption))


def _drawing(facts: Facts) -> Html:
    top_hz = _highest(facts)
    orders = facts["orders"]

    def across(hertz: float) -> float:
        return float(_LEFT + (_WIDTH - _LEFT - _RIGHT) * hertz / top_hz)

    def up(order: float) -> float:
        span = float(orders[1] - orders[0] + 2)
        return _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * (order - float(orders[0]) + 1) / span

    parts = [_curve(facts.get("spectrum") or {}, across, top_hz), *_axes(across, up, top_hz, orders)]
    parts += sorted(_marks(facts, across, up, top_hz), key=lambda mark: "spurious" not in mark[:40])
    head = f'xmlns="http://www.w3.org/2000/svg" class="wide" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" font-size="12"'
    return Html(f"<svg {head}>{join(parts)}</svg>")


def _highest(facts: Facts) -> float:
    """Return the right end of the axis in Hz: a third beyond the last mode, at most the Nyquist frequency."""
    last = max((m["frequency_hz"] for m in [*facts["modes"], *facts["harmonics"]]), default=np.inf)
    return float(min(4 / 3 * last, 0.5 / facts["sample_time_s"]))


def _marks(facts: Facts, across: Any, up: Any, top_hz: float) -> Iterable[Html]:
    lines = {m["frequency_hz"] for m in facts["harmonics"]}
    columns = facts["poles"]
    names = ("past", "order", "frequency_hz", "damping", "frequency_std_hz", "damping_std", "mode_hz")
    for past, order, hertz, damping, width, loose, mode in zip(*(columns[n] for n in names), strict=True):
        if hertz > top_hz:
            continue
        kind = "spurious" if mode is None else "line" if mode in lines else "mode"
        x, y = across(hertz), up(order)
        words = f"{with_std(hertz, width)} Hz, damping {with_std(100 * damping, 100 * (loose or 0.0))} %, order {order}"
        shape = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{2 if kind == "spurious" else 3}" stroke="none"/>'
        if kind != "spurious" and width:
            left, right = across(max(hertz - _NORMAL * width, 0.0)), across(min(hertz + _NORMAL * width, top_hz))
            shape += f'<path d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
        title = tag("title", f"{words}, window {past}")
        yield Html(f'<g class="kind-{kind} window-{past}">{shape}{title}</g>')


def _axes(across: Any, up: Any, top_hz: float, orders: list[int]) -> list[Html]:
    low, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    out = [Html(f'<path d="M{_LEFT} {_TOP}V{low}H{right}" class="axis"/>')]
    for hertz in _ticks(top_hz):
        x = across(hertz)
        out.append(Html(f'<path d="M{x:.1f} {low}v5" class="axis"/>'))
        out.append(Html(f'<text x="{x:.1f}" y="{low + 18}" text-anchor="middle">{hertz:g}</text>'))
    for order in range(-(-orders[0] // 10) * 10, orders[1] + 1, 10):
        out.append(Html(f'<path d="M{_LEFT} {up(order):.1f}H{right}" class="grid"/>'))
        out.append(Html(f'<text x="{_LEFT - 8}" y="{up(order) + 4:.1f}" text-anchor="end">{order}</text>'))
    out.append(
        Html(f'<text x="{(_LEFT + right) / 2:.0f}" y="{_HEIGHT - 6}" text-anchor="middle">frequency (Hz)</text>')
    )
    middle = (_TOP + low) / 2
    turned = f'transform="rotate(-90 14 {middle:.0f})"'
    out.append(Html(f'<text x="14" y="{middle:.0f}" text-anchor="middle" {turned}>order</text>'))
    return out


def _ticks(top: float) -> list[float]:
    """Return some eight round values from 0 to `top`."""
    raw = top / 8
    size = 10.0 ** np.floor(np.log10(raw))
    step = float(next(k * size for k in (1, 2, 5, 10) if k * size >= raw))
    return [float(f"{k * step:.6g}") for k in range(int(top / step + 1e-9) + 1)]


def _curve(spectrum: Facts, across: Any, top_hz: float) -> Html:
    hertz = np.array(spectrum.get("frequency_hz") or [], dtype=float)
    shown = (hertz > 0) & (hertz <= top_hz)
    if np.count_nonzero(shown) < 2:
        return Html("")
    power = np.log10(np.maximum(np.array(spectrum["power"], dtype=float)[shown], 1e-300))
    share = (power - power.min()) / max(float(np.ptp(power)), 1e-12)
    low = _HEIGHT - _BOTTOM
    points = " ".join(f"{across(f):.1f},{low - (low - _TOP) * s:.1f}" for f, s in zip(hertz[shown], share, strict=True))
    return Html(f'<polyline points="{points}" class="curve"/>')
