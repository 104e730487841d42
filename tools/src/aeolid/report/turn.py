"""Draw what turns with the rotor: means over its angle, with the size and the place of the wave they hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.markup import Html, figure, folded, join, table, tag
from aeolid.report.numbers import number, unit_of

Facts = dict[str, Any]
_MOST = 8  # outputs that are drawn
_ORDERS = (1, 2, 3)  # waves a turn in the table
_FAMILIES = ("rotor_1p", "rotor_3p")
_READ = (
    " One wave a turn is an imbalance of masses or blade pitch, in blade loads shear, yaw or gravity; three waves are"
    " the blades passing the tower."
)
NOT_DRAWN = tag(
    "p",
    "Nothing can be drawn over the rotor's turn: no channel with the role azimuth is recorded, or the rotor goes round"
    " too few times.",
    class_="soft",
)


def turns_with_rotor(effects: Sequence[Facts]) -> bool:
    """Tell whether one of the effects of a diagnosis acts at the rotor's angle."""
    return any(
        e.get("family") in _FAMILIES or (e.get("location") or {}).get("azimuth_order") is not None for e in effects
    )


def both_over_turn(turning: Facts) -> Html:
    """Draw the mean of each output over the rotor's angle as recorded and as simulated; turning: by output."""
    caption = (
        "Mean of each output over the rotor's angle, less its mean over the turn: gusts average out, what turns with"
        f" the rotor stays.{_READ}"
    )
    styles: Mapping[str, Facts] = {
        "recorded": {"color": charts.INK, "linewidth": 2},
        "simulated": {"color": charts.BEFORE, "linestyle": (0, (4, 2)), "linewidth": 1.8},
    }
    both = {name: {**data, "difference": _less(data["recorded"], data["simulated"])} for name, data in turning.items()}
    return _over_turn(both, styles, caption, ("difference",))


def _less(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [x - y for x, y in zip(a, b, strict=True)]


def errors_over_turn(errors: Facts) -> Html:
    """Draw what the model leaves over of each output, before and after, averaged over the rotor's angle."""
    caption = (
        "What the predictions on the sealed data leave over (measured less predicted), averaged over the rotor's angle:"
        " dashed the model before correction, blue the corrected one; a flat line shows no dependence on the angle."
        f"{_READ}"
    )
    styles: Mapping[str, Facts] = {
        "before": {"color": charts.BEFORE, "linestyle": (0, (4, 2)), "linewidth": 1.8},
        "after": {"color": charts.AFTER, "linewidth": 1.8},
    }
    return _over_turn(errors, styles, caption)


def wave(azimuth_deg: Sequence[float], values: Sequence[float], order: int) -> tuple[float, float]:
    """Return amplitude of the wave with `order` periods a turn, and the first azimuth in degrees where it peaks.

    azimuth_deg: even over the turn. The wave is a cos(k ψ − φ) with a e^(iφ) = 2/N Σ y e^(ikψ); it peaks at φ/k.

    >>> a, at = wave([0.0, 90.0, 180.0, 270.0], [0.0, 2.0, 0.0, -2.0], 1)
    >>> round(a, 9), round(at, 9)
    (2.0, 90.0)
    """
    angle = np.radians(np.asarray(azimuth_deg, dtype=float))
    total = 2.0 * np.mean(np.asarray(values, dtype=float) * np.exp(1j * order * angle))
    return float(abs(total)), float(np.degrees(np.angle(total)) % 360.0) / order


def _over_turn(turning: Facts, styles: Mapping[str, Facts], caption: str, listed: Sequence[str] = ()) -> Html:
    """Draw what has a style, and list its waves and those of what is listed alone."""
    names = list(turning)[:_MOST]
    if not names:
        return Html("")
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    with charts.sketch((charts.WIDE[0], max(2.3 * rows, 2.6)), rows, columns, sharex=True) as drawing:
        for axes, name in zip(drawing.axes.flat, names, strict=False):
            data = turning[name]
            for key, style in styles.items():
                axes.plot(data["azimuth_deg"], data[key], label=key, **style)
            charts.titled(axes, charts.label(name, data.get("unit")).replace("\n", " "), 8.5)
            axes.set_xticks([0, 90, 180, 270, 360])
        for place, axes in enumerate(drawing.axes.flat):
            axes.set_visible(place < len(names))
            if place + columns >= len(names):  # nothing is drawn below it
                axes.tick_params(labelbottom=True)
                axes.set_xlabel("rotor azimuth (deg)")
        drawing.axes[0, 0].legend(loc="best", fontsize=8)
    waves = folded("Size and place of the waves", _waves(turning, [*styles, *listed]))
    return join([tag("h3", "Over the rotor's turn"), figure(drawing.svg, caption), waves])


def _waves(turning: Facts, keys: Sequence[str]) -> Html:
    """List of each output the waves a turn on either side, with the azimuth of their first peak."""
    rows = []
    for name, data in turning.items():
        for order in _ORDERS:
            found = [wave(data["azimuth_deg"], data[key], order) for key in keys]
            cells = [text for size, at in found for text in (number(size), str(round(at) % (360 // order)))]
            rows.append((name, f"{order}P", *cells, unit_of(data)))
    head = ["output", "wave", *(f"#{t}" for key in keys for t in (f"{key}", "peak at (deg)")), "unit"]
    note = "Amplitude, and the first azimuth at which the wave peaks; a wave of 3P peaks again every 120 degrees."
    return join([tag("p", note, class_="soft"), table(head, rows)])
