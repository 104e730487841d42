"""Draw frequency responses of an identified model, with 95 % bands, beside those from spectra and the true ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.report import charts
from aeolid.report.markup import Html, figure, section, tag
from aeolid.report.response import frequencies, response

Facts = dict[str, Any]
Array = NDArray[np.float64]
_FLOOR = 1e-6  # of the greatest identified gain: what lies below is no gain worth the axis
_MOST_PAIRS = 12  # frequency responses on one page; the others are named
_NORMAL = 1.96  # 95 %
_SPECTRA = (
    " Dots: the same from spectra, without a model, with 95 % of the gain; in a closed loop they lean towards the"
    " inverse of the controller. Coherence: the share of the output's power that all inputs explain."
)


def bode_part(facts: Facts) -> Html:
    """Build the section of the frequency responses, a row of figures an output; empty without a linear model."""
    model, true = facts.get("model"), facts.get("true_model")
    if not model or model.get("scheduling") or not model.get("inputs"):
        return Html("")
    inputs, outputs = model["inputs"], model["outputs"]
    columns = max(1, min(len(inputs), 3))
    shown = outputs[: max(1, _MOST_PAIRS // columns)]
    grid = frequencies(model)
    gains = response(model, grid)
    real = response(true, grid) if true else None
    bands, spectra = facts.get("frequency_response"), facts.get("spectral")
    told = (" Grey: 95 % at each frequency." if bands else "") + (" Dashed: the true system." if true else "")
    told += _SPECTRA if spectra else ""
    sources = ", ".join(_names(inputs[:columns]))
    figures = [
        figure(
            _bode_row(row, inputs[:columns], out, grid, gains, real, facts),
            f"From {sources} to {out['name']}: gain above, phase below.{told}",
        )
        for row, out in enumerate(shown)
    ]
    hidden = _names(outputs[len(shown) :]) + _names(inputs[columns:])
    note = tag("p", f"Not shown: {', '.join(hidden)}.", class_="soft") if hidden else None
    return section("Frequency response", *figures, note)


def _names(signals: list[Facts]) -> list[str]:
    return [str(s["name"]) for s in signals]


def _bode_row(row: int, inputs: list[Facts], out: Facts, grid: Any, gains: Any, real: Any, facts: Facts) -> Html:
    bands, spectra = facts.get("frequency_response"), facts.get("spectral")
    size, heights = ((charts.WIDE[0], 4.7), [3, 2, 1]) if spectra else ((charts.WIDE[0], 3.9), [3, 2])
    with charts.sketch(
        size, len(heights), len(inputs), sharex=True, gridspec_kw={"height_ratios": heights}
    ) as drawing:  # one column an input
        for column, signal in enumerate(inputs):
            gain_axes, phase_axes, *more = drawing.axes[:, column]
            lines = [(gains, {"color": charts.AFTER, "linewidth": 1.8, "label": "identified"})]
            if real is not None:
                lines.append((real, {"color": charts.TRUTH, "linestyle": (0, (4, 2)), "label": "true"}))
            for values, style in lines:
                g = values[:, row, column]
                gain = np.where(np.abs(g) > _FLOOR * np.max(np.abs(gains[:, row, column])), np.abs(g), np.nan)
                gain_axes.loglog(grid, gain, **style)
                phase_axes.semilogx(grid, _phase(g, gains[:, row, column], gain), **style)
            relative, turn = _deviation(bands, signal["name"], out["name"], grid)
            if relative is not None:
                _shade(gain_axes, phase_axes, grid, gains[:, row, column], relative, turn)
            if spectra:
                _dots([gain_axes, phase_axes, *more], spectra, signal["name"], out["name"], grid, gains[:, row, column])
            _label(drawing.axes[:, column], signal, out)
        if real is not None or bands or spectra:
            drawing.axes[0, 0].legend(loc="best")
    return drawing.svg


def _label(axes: Any, signal: Facts, out: Facts) -> None:
    charts.titled(axes[0], f"{signal['name']} → {out['name']}")
    axes[0].set_ylabel(f"gain ({out.get('unit') or '1'} / {signal.get('unit') or '1'})")
    axes[1].set_ylabel("phase (deg)")
    axes[-1].set_xlabel("frequency (Hz)")


def _dots(axes: list[Any], spectra: Facts, source: str, target: str, grid: Array, g: Any) -> None:
    """Draw what spectra say of one pair into axes of gain, phase and coherence, the phase by turns near the model's."""
    pair = next((p for p in spectra["pairs"] if (p["input"], p["output"]) == (source, target)), None)
    if pair is None:
        return
    at, gain, spread, turn = (
        np.asarray(v, dtype=float) for v in (spectra["frequency_hz"], pair["gain"], pair["gain_std"], pair["phase_deg"])
    )
    known = (gain > 0) & (gain > _NORMAL * spread)  # others are zero, as far as these data go
    style: dict[str, Any] = {"color": charts.GREY, "linestyle": "none", "markersize": 2.5}
    low, high = np.minimum(_NORMAL * spread, 0.999 * gain), _NORMAL * spread
    limits = charts.holding(axes[0].get_ylim(), gain[known])  # bars may reach beyond, no dot
    axes[0].errorbar(at[known], gain[known], [low[known], high[known]], marker="o", elinewidth=0.6,
                     label="from spectra", zorder=1, **style)  # fmt: skip
    axes[0].set_ylim(*limits)
    model = np.degrees(np.interp(np.log(at), np.log(grid), np.unwrap(np.angle(g))))
    axes[1].semilogx(at[known], (turn + 360 * np.round((model - turn) / 360))[known], marker="o", zorder=1, **style)
    axes[2].semilogx(at, spectra["coherence"][target], color=charts.GREY, linewidth=1.2)
    axes[2].set_ylim(0, 1.05)
    axes[2].set_ylabel("coherence")


def _deviation(bands: Facts | None, source: str, target: str, grid: Array) -> tuple[Any, Any]:
    """Return the relative deviation of the gain and that of the phase in degrees on another grid, or None.

    Unknown phases are NaN. Both are interpolated over the logarithm of the frequency.
    """
    for pair in (bands or {}).get("pairs", []):
        if (pair["input"], pair["output"]) == (source, target):
            at = np.log(np.asarray((bands or {})["frequency_hz"], dtype=float))
            gain, spread, turn = (np.array(pair[k], dtype=float) for k in ("gain", "gain_std", "phase_std_deg"))
            relative = spread / np.maximum(gain, 1e-300)
            return np.interp(np.log(grid), at, relative), np.interp(np.log(grid), at, turn)
    return None, None


def _shade(gain_axes: Any, phase_axes: Any, grid: Array, g: Any, relative: Array, turn: Array) -> None:
    """Draw both bands behind the lines; a gain that may be zero is shaded to the bottom, an unknown phase not."""
    size, bottom = np.abs(g), gain_axes.get_ylim()[0]
    low = np.where(np.isfinite(turn), np.maximum(size * (1 - _NORMAL * relative), bottom), bottom)
    style = {"color": charts.GREY, "alpha": 0.45, "linewidth": 0}
    gain_axes.fill_between(grid, low, size * (1 + _NORMAL * relative), label="95 %", **style)
    gain_axes.set_ylim(bottom=bottom)
    phase = np.degrees(np.unwrap(np.angle(g)))
    phase_axes.fill_between(grid, phase - _NORMAL * turn, phase + _NORMAL * turn, where=np.isfinite(turn), **style)


def _phase(g: Any, reference: Any, gain: Any) -> Any:
    """Return the unwrapped phase in degrees, by whole turns as near as can be to that of a reference."""
    turns = (np.unwrap(np.angle(g)) - np.unwrap(np.angle(reference))) / (2 * np.pi)
    phase = np.degrees(np.unwrap(np.angle(g)) - 2 * np.pi * np.round(np.median(turns)))
    return np.where(np.isnan(gain), np.nan, phase)
