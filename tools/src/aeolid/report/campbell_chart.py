"""Draw a Campbell diagram: modes over the rotor's speed and over the wind, with the lines of the rotor."""

from __future__ import annotations

from typing import Any

import numpy as np

Facts = dict[str, Any]
_PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#1b1f24")
_MARKERS = "osD^vPX"
_GREY = "#9aa4b0"
_NORMAL = 1.96  # 95 %
_MOST_NAMED = 14  # tracks with an entry in the key
PER_MINUTE = 60.0


def has_wind(facts: Facts) -> bool:
    """Tell whether every recording has its wind, so that there is a second panel."""
    return all(r["wind_m_s"] is not None for r in facts["runs"])


def draw(facts: Facts, panels: Any) -> None:
    """Draw on axes: over the rotor's speed, and on a second one over the wind, which share their frequencies."""
    panels = list(np.ravel(panels))
    speed = np.array([PER_MINUTE * r["rotor_hz"] for r in facts["runs"]])
    _panel(panels[0], facts, speed, "rotor speed (rpm)")
    if len(panels) > 1:
        _panel(panels[1], facts, np.array([r["wind_m_s"] for r in facts["runs"]]), "wind speed (m/s)")
    top = _top(facts)
    for panel in panels:
        panel.set_ylim(0.0, top)
        panel.set_ylabel("frequency (Hz)" if panel is panels[0] else "")
    place = panels[-1]
    place.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize="small", borderaxespad=0.0)


def _top(facts: Facts) -> float:
    """Return the highest frequency shown: an eighth above the fastest mode and the last line of the rotor."""
    modes = [m["frequency_hz"] for t in (*facts["tracks"], *facts["single"]) for m in t["modes"] if m]
    fastest = max(r["rotor_hz"] for r in facts["runs"])
    return float(1.125 * max([*modes, fastest * min(facts["orders"][-1], 6)]))


def _panel(panel: Any, facts: Facts, x: Any, label: str) -> None:
    over_speed = label.startswith("rotor")
    _lines(panel, facts, x, over_speed)
    for track in facts["single"]:
        points = [(at, m["frequency_hz"]) for at, m in zip(x, track["modes"], strict=True) if m]
        panel.plot(*zip(*points, strict=True), ".", color=_GREY, markersize=4)
    for i, track in enumerate(facts["tracks"]):
        here = [(at, m["frequency_hz"], m["frequency_std_hz"] or 0.0)
                for at, m in zip(x, track["modes"], strict=True) if m]  # fmt: skip
        at, hertz, spread = (np.array(v) for v in zip(*here, strict=True))
        name = track["name"] or f"near {hertz.mean():.3g} Hz"
        panel.errorbar(
            at, hertz, yerr=_NORMAL * spread, fmt=f"{_MARKERS[i % len(_MARKERS)]}-", markersize=4.5, linewidth=1.0,
            elinewidth=0.8, capsize=2, color=_PALETTE[i % len(_PALETTE)], label=name if i < _MOST_NAMED else None,
        )  # fmt: skip
    panel.set_xlabel(label)


def _lines(panel: Any, facts: Facts, x: Any, over_speed: bool) -> None:
    """Draw the multiples of the rotor's speed: rays over the speed, what they were in each recording over the wind."""
    hertz = np.array([r["rotor_hz"] for r in facts["runs"]])
    if over_speed:
        low, high = max(0.0, 0.85 * x.min()), 1.08 * x.max()
        x = np.linspace(low, high, 60)
        hertz = x / PER_MINUTE
        panel.set_xlim(low, high)
    top = _top(facts)
    for order in facts["orders"]:
        inside = np.flatnonzero(order * hertz <= 0.98 * top)
        if not len(inside):
            continue
        panel.plot(x, order * hertz, "--", color=_GREY, linewidth=0.9, zorder=1)
        at, height = float(x[inside[-1]]), float(order * hertz[inside[-1]])
        panel.annotate(
            f"{order}P", (at, height), xytext=(-2, 2), textcoords="offset points", fontsize=8, ha="right",
            color="#5a6470",
        )  # fmt: skip
