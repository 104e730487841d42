"""Hold a recording against a simulation: modes side by side, frequency responses, means over the rotor's angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.answers import answers_part
from aeolid.report.markup import Html, figure, folded, join, section, table, tag
from aeolid.report.numbers import with_std
from aeolid.report.turn import both_over_turn

Facts = dict[str, Any]
_LIGHT = 0.3  # damping below which a mode swings for long enough to be worth a row
_NEAR = 0.15  # relative distance of two modes that may be one
_ALIKE = 0.6  # cosine between the outputs' shares of modes that are one
_CLEAR, _OPEN = 2.0, 4.0  # deviations over a lone mode's: it is one, and it may be one where the other side has it
_MOST_ROWS, _MOST_COLUMNS = 8, 3  # outputs and inputs of the frequency responses
_OPEN_ROWS = 2  # of them that are not folded
_NORMAL = 1.96  # 95 %


def sides(evidence: Facts, *, turning: bool = True) -> Html:
    """Show what is known of both sides; nothing where there is only one.

    turning: with the means over the rotor's angle; False where they stand beside the effect already.
    """
    modes = evidence.get("modes") or {}
    return section(
        "The recording against the simulation",
        _modes(modes.get("recorded") or [], modes.get("simulated") or []),
        both_over_turn(evidence.get("turning") or {}) if turning else None,
        answers_part(evidence.get("answers") or {}),
        _responses(evidence.get("responses") or {}),
    )


def matched(recorded: list[Facts], simulated: list[Facts]) -> list[tuple[Facts | None, Facts | None]]:
    """Pair the modes of both sides that are near in frequency and move the same outputs; each at most once.

    The best known choose first. A pole whose deviations are far above those of a mode that stands alone above the noise
    is left out, unless the other side has a better known one for it.
    """
    left = {id(m): m for m in simulated}
    pairs: list[tuple[Facts | None, Facts | None]] = []
    for mode in sorted(recorded, key=_width):
        near = [m for m in left.values() if _apart(mode, m) < _NEAR and _alike(mode, m) > _ALIKE]
        other = min(near, key=lambda m: _apart(mode, m), default=None)
        pairs.append((mode, left.pop(id(other)) if other is not None else None))
    pairs += [(None, m) for m in left.values()]
    pairs = [p for p in pairs if min(_width(m) for m in p if m is not None) <= _CLEAR]
    return sorted(pairs, key=lambda p: float((p[0] or p[1] or {})["frequency_hz"]))


def _width(mode: Facts) -> float:
    """Return the deviations over those of a lone mode: infinite where not known, 0 in a file that says nothing."""
    width = mode.get("width", 0.0)
    return float("inf") if width is None else float(width)


def _apart(a: Facts, b: Facts) -> float:
    return abs(float(a["frequency_hz"]) / float(b["frequency_hz"]) - 1)


def _alike(a: Facts, b: Facts) -> float:
    x, y = a.get("outputs") or {}, b.get("outputs") or {}
    names = list(dict.fromkeys([*x, *y]))
    p, q = (np.array([float(m.get(n) or 0.0) for n in names]) for m in (x, y))
    size = float(np.linalg.norm(p) * np.linalg.norm(q))
    return float(p @ q) / size if size > 0 else 1.0


def _shown(modes: list[Facts]) -> list[Facts]:
    swinging = [m for m in modes if not m.get("rotor_order") and m["frequency_hz"] > 0 and abs(m["damping"]) < _LIGHT]
    return [m for m in swinging if _width(m) <= _OPEN]


def _modes(recorded: list[Facts], simulated: list[Facts]) -> Html:
    rows = []
    for mine, other in matched(_shown(recorded), _shown(simulated)):
        known = mine or other or {}
        most = max(known.get("outputs") or {"": 0.0}, key=lambda n: known["outputs"][n] if known.get("outputs") else 0)
        name = str(known.get("name") or "") or f"in {most}"
        rows.append((name, _frequency(mine), _frequency(other), _damping(mine), _damping(other), _moved(mine, other)))
    head = ["mode", "#recorded (Hz)", "#simulated (Hz)", "#damping recorded (%)", "#simulated (%)", "difference"]
    note = "Modes with less than 30 % damping; the rotor's harmonics and poles with bands too wide for a mode left out."
    note += " ± is one standard deviation."
    return join([tag("h3", "Modes"), tag("p", note, class_="soft"), table(head, rows)]) if rows else Html("")


def _frequency(mode: Facts | None) -> str:
    return "–" if mode is None else with_std(mode["frequency_hz"], mode.get("frequency_std_hz"), 4)


def _damping(mode: Facts | None) -> str:
    spread = None if mode is None else mode.get("damping_std")
    return "–" if mode is None else with_std(100 * mode["damping"], None if spread is None else 100 * spread)


def _moved(mine: Facts | None, other: Facts | None) -> str:
    """Say whether two modes differ by more than their deviations allow (99 % of a Gaussian)."""
    if mine is None or other is None:
        return "not simulated" if other is None else "not recorded"
    said = []
    for key, std, word in (("frequency_hz", "frequency_std_hz", "frequency"), ("damping", "damping_std", "damping")):
        spread = float(np.hypot(mine.get(std) or 0.0, other.get(std) or 0.0))
        change = float(mine[key]) - float(other[key])
        if spread > 0 and abs(change) > 2.58 * spread:
            said.append(f"{word} {'higher' if change > 0 else 'lower'} in the recording")
    return ", ".join(said)


def _responses(both: Facts) -> Html:
    """Draw from each input to each output what was identified of either side, on one pair of axes."""
    recorded, simulated = both.get("recorded") or {}, both.get("simulated") or {}
    pairs, units = recorded.get("pairs") or [], both.get("units") or {}
    outputs = list(dict.fromkeys(p["output"] for p in pairs))[:_MOST_ROWS]
    if not outputs or not simulated.get("pairs"):
        return Html("")
    figures = []
    for output in outputs:
        own = [p for p in pairs if p["output"] == output][:_MOST_COLUMNS]
        sources = ", ".join(p["input"] for p in own)
        figures.append(
            figure(
                _row(own, recorded["frequency_hz"], simulated, units),
                f"From {sources} to {output}: gain above, phase below. Line: identified from the recording, with 95 %;"
                " dashed: identified from the simulation in the same way.",
            )
        )
    rest = folded(f"{len(figures) - _OPEN_ROWS} more outputs", *figures[_OPEN_ROWS:])
    return join([tag("h3", "Frequency responses"), *figures[:_OPEN_ROWS], rest])


def _row(own: list[Facts], frequency_hz: list[float], simulated: Facts, units: Facts) -> Html:
    options: Facts = {"sharex": True, "gridspec_kw": {"height_ratios": [3, 2]}}
    others = {(p["input"], p["output"]): p for p in simulated["pairs"]}
    with charts.sketch((charts.WIDE[0], 3.6), 2, len(own), **options) as drawing:
        for column, pair in enumerate(own):
            top, bottom = drawing.axes[:, column]
            gain = np.array(pair["gain"], dtype=float)
            spread = _NORMAL * np.nan_to_num(np.array(pair["gain_std"], dtype=float), nan=np.inf)
            low = np.maximum(gain - spread, 1e-3 * gain)
            top.fill_between(frequency_hz, low, gain + np.minimum(spread, 1e3 * gain), color=charts.GREY, alpha=0.4)
            line: Facts = {"color": charts.AFTER, "label": "recorded"}
            dash: Facts = {"color": charts.BEFORE, "linestyle": (0, (4, 2)), "label": "simulated"}
            other = others.get((pair["input"], pair["output"]))
            for at, entry, style in ((frequency_hz, pair, line), (simulated["frequency_hz"], other, dash)):
                if entry is not None:
                    top.loglog(at, entry["gain"], **style)
                    bottom.semilogx(at, entry["phase_deg"], **style)
            top.set_ylim(0.3 * np.nanmin(gain[gain > 0], initial=1e9), 3 * np.nanmax(gain, initial=1e-9))
            charts.titled(top, f"{pair['input']} → {pair['output']}")
            top.set_ylabel(f"gain ({units.get(pair['output']) or '1'} / {units.get(pair['input']) or '1'})")
            bottom.set_yticks([-180, -90, 0, 90, 180])
            bottom.set_ylabel("phase (deg)")
            bottom.set_xlabel("frequency (Hz)")
        drawing.axes[0, 0].legend(loc="best")
    return drawing.svg
