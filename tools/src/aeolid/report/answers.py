"""Draw how a rotor answers its pitch angle: the recording over the simulation, band by band."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.markup import Html, figure, join, tag

Facts = dict[str, Any]
_MOST = 3  # outputs beside each other
_NORMAL = 1.96  # 95 %
_SURE = 0.5  # deviation of a ratio's logarithm above which it is not drawn


def answers_part(answers: Facts) -> Html:
    """Draw the ratio of both sides' responses and of what wind does, an output a column; empty without any."""
    outputs = (answers.get("outputs") or [])[:_MOST]
    if not outputs:
        return Html("")
    orders = np.asarray(answers["orders"], dtype=float)
    with charts.sketch((charts.WIDE[0], 4.4), 3, len(outputs), sharex=True) as drawing:
        for column, facts in enumerate(outputs):
            _column(drawing.axes[:, column], orders, facts)
        drawing.axes[0, 0].set_ylabel("gain, ratio")
        drawing.axes[1, 0].set_ylabel("phase (deg)")
        drawing.axes[2, 0].set_ylabel("wind's power, ratio")
    what = (
        f"How the outputs answer {answers['input']}, recording over simulation, by the recorded excitation, with 95 %;"
        f" below, the power of what that leaves, which is the wind's. Multiples of the rotor's {answers['hz']:.3g} Hz."
    )
    return join([tag("h3", "Answers to the pitch angle"), figure(drawing.svg, what)])


def _column(axes: Any, orders: Any, facts: Facts) -> None:
    gain, phase, std, wind = (np.array(facts[k], dtype=float) for k in ("gain", "phase_deg", "std", "wind"))
    sure = np.isfinite(gain) & (std < _SURE)
    spread = np.exp(_NORMAL * std[sure])
    top, middle, bottom = axes
    style: Facts = {"fmt": "o", "markersize": 3.5, "color": charts.AFTER, "ecolor": charts.AFTER, "elinewidth": 1}
    errors = [gain[sure] * (1 - 1 / spread), gain[sure] * (spread - 1)]
    top.errorbar(orders[sure], gain[sure], yerr=errors, **style)
    middle.errorbar(orders[sure], phase[sure], yerr=np.degrees(_NORMAL * std[sure]), **style)
    bottom.plot(orders, wind, "o", markersize=3.5, color=charts.AFTER)
    for axis, same in ((top, 1.0), (middle, 0.0), (bottom, 1.0)):
        axis.axhline(same, color=charts.BEFORE, linestyle=(0, (4, 2)), linewidth=1)
        axis.set_xscale("log")
    top.set_yscale("log")
    bottom.set_yscale("log")
    charts.titled(top, facts["output"])
    bottom.set_xlabel("frequency (revolutions)")
