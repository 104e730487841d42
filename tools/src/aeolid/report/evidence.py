"""Draw the evidence behind a diagnosis: sealed data before and after, score bank, confusion, appendix."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.charts import DOT, INK
from aeolid.report.markup import Html, figure, folded, join, section, table, tag
from aeolid.report.numbers import is_open, number, percent, unit_of, with_std
from aeolid.report.ranking import called, label_of
from aeolid.report.zoom import MOST_SAMPLES, Line, Panel, zoomed
from aeolid.wording import counted, spoken

Facts = dict[str, Any]
_ZOOM_SAMPLES = 400  # what can be followed by eye on the width of a page
_LINES = ("measured", "before", "after")
_ROWS = ("time_s", *_LINES)  # what a series has a value of for each sealed row
_MOST_OUTPUTS = 6
_OPEN_OUTPUTS = 2  # drawn without being asked for
_MOST_BARS = 24
_MOST_CONFUSED = 12  # the best scored come first


def before_after(evidence: Facts, sealed: Facts, *, after: str) -> Html:
    """Show every output on sealed data: a stretch in time, its error spectrum, and the numbers.

    after: what the second model has, in words.
    """
    series, spectra = evidence.get("series") or {}, evidence.get("spectra") or {}
    parts: list[Html] = [_numbers(sealed)]
    most = MOST_SAMPLES // (5 * max(min(len(series), _MOST_OUTPUTS), 1))  # of three lines and two errors
    for place, name in enumerate(_by_gain(list(dict.fromkeys([*series, *spectra])), sealed)[:_MOST_OUTPUTS]):
        drawn = []
        if name in series:
            drawn.append(_time_figure(name, series[name], after, sealed.get("horizon_s"), most))
        if name in spectra:
            drawn.append(_spectrum_figure(name, spectra[name], (series.get(name) or {}).get("unit")))
        parts += drawn if place < _OPEN_OUTPUTS else [folded(f"{name}: in time and by frequency", *drawn)]
    data = tag("p", f"Sealed data: {sealed['data']}.") if sealed.get("data") and any(parts) else None
    return section("Before and after, on data never used for the fit", data if any(parts) else None, *parts)


def _by_gain(names: list[str], sealed: Facts) -> list[str]:
    """Return the outputs, those first whose error falls most."""
    before, after = sealed.get("nrmse_before") or {}, sealed.get("nrmse_after") or {}
    return sorted(names, key=lambda n: (after.get(n) or 1.0) / (before.get(n) or 1.0))


def _numbers(sealed: Facts) -> Html:
    before, after = sealed.get("nrmse_before") or {}, sealed.get("nrmse_after") or {}
    rows = [(name, percent(before.get(name)), percent(after.get(name))) for name in dict.fromkeys([*before, *after])]
    return table(["output", "#error before (NRMSE)", "#error after (NRMSE)"], rows)


def _time_figure(name: str, data: Facts, after: str, horizon_s: float | None, most: int) -> Html:
    data, place = _one_stretch(data)
    time = np.asarray(data["time_s"], dtype=float)
    lines = {k: np.asarray(data[k], dtype=float) for k in _LINES if k in data and len(data[k])}
    start = _busiest(lines)[0]
    window = slice(start, start + _ZOOM_SAMPLES)
    with charts.sketch((charts.WIDE[0], 4.2), 2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]}) as drawing:
        top, bottom = drawing.axes[:, 0]
        styles: dict[str, Facts] = {
            "measured": {"color": INK, "linewidth": 2.2, "alpha": 0.55},
            "before": {"color": charts.BEFORE, "linestyle": (0, (4, 2))},
            "after": {"color": charts.AFTER},
        }
        for key, values in lines.items():
            top.plot(time[window], values[window], label=key, **styles[key])
            if key != "measured" and "measured" in lines:
                bottom.plot(time[window], (values - lines["measured"])[window], label=f"{key}: error", **styles[key])
        top.set_ylabel(charts.label(name, data.get("unit")))
        bottom.set_ylabel(charts.label("error", data.get("unit")))
        bottom.set_xlabel("time (s)")
        bottom.axhline(0, color=charts.GREY, linewidth=0.8)
        top.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    means = f", in means over {number(data['mean_of_s'])} s" if data.get("mean_of_s") else ""
    caption = (
        f"{name}: {_shown_part(time, window, place)}. Grey: measured{means}; dashed: the model before"
        f" correction; blue: {after}. Below: model minus measured.{_restart(time, horizon_s)}"
    )
    view = (start, min(start + _ZOOM_SAMPLES, len(time)))
    return zoomed(drawing.svg, caption, time, _panels(name, lines, data.get("unit")), view, most)


def _one_stretch(data: Facts) -> tuple[Facts, str]:
    """Return the sealed stretch in which the two models differ most, and which one that is, "" where there is one."""
    numbers = np.asarray(data.get("stretch") or np.ones(len(data["time_s"])))
    every = np.unique(numbers)
    if len(every) < 2:
        return data, ""
    parts = [{k: np.asarray(v)[numbers == n] if k in _ROWS else v for k, v in data.items()} for n in every]
    chosen = max(range(len(parts)), key=lambda i: _busiest(parts[i])[1])
    return parts[chosen], f" of stretch {int(every[chosen])} of {int(every[-1])}"


def _shown_part(time: Any, window: slice, place: str) -> str:
    """Say which part of the sealed data a figure begins with; place: of which stretch, where there are several."""
    whole, part = (number(float(t[-1] - t[0])) for t in (time, time[window]))
    if len(time) <= _ZOOM_SAMPLES:
        return f"all {whole} s{place}"
    return f"the {part} s, of {whole} s{place}, in which the two models differ most"


def _panels(name: str, lines: dict[str, Any], unit: str | None) -> list[Panel]:
    """Return values above and errors below, as the script draws them."""
    kinds = {"measured": "ink"}
    told = f" ({unit})" if unit and unit_of(unit) else ""
    panels = [Panel(f"{name}{told}", tuple(Line(k, kinds.get(k, k), v) for k, v in lines.items()), 200)]
    if "measured" in lines:
        errors = [Line(k, k, v - lines["measured"]) for k, v in lines.items() if k != "measured"]
        panels.append(Panel(f"error{told}", tuple(errors), 130))
    return [p for p in panels if p.lines]


def _restart(time: Any, horizon_s: float | None) -> str:
    """Say how far ahead the lines predict; one sample ahead nothing restarts."""
    if not horizon_s or len(time) < 2:
        return ""
    if horizon_s < 1.5 * (time[1] - time[0]):
        return " The lines predict one step ahead."
    return (
        f" Every {number(float(horizon_s))} s the prediction starts again from the measured past; its error is small"
        " there and grows until the next start. The jumps at the starts are no error of the model."
    )


def _busiest(lines: Facts) -> tuple[int, float]:
    """Return the start of the window in which the two models differ most, and the sum of their squared differences."""
    if "before" not in lines or "after" not in lines:
        return 0, 0.0
    square = np.nan_to_num((np.asarray(lines["before"], dtype=float) - np.asarray(lines["after"], dtype=float)) ** 2)
    total = np.concatenate([[0.0], np.cumsum(square)])
    if len(square) <= _ZOOM_SAMPLES:
        return 0, float(total[-1])
    windows = total[_ZOOM_SAMPLES:] - total[:-_ZOOM_SAMPLES]
    return int(np.argmax(windows)), float(np.max(windows))


def _spectrum_figure(name: str, data: Facts, unit: str | None) -> Html:
    with charts.sketch((charts.WIDE[0], 2.7)) as drawing:
        axes = drawing.axes[0, 0]
        for key, style in (
            ("before", {"color": charts.BEFORE, "linestyle": (0, (4, 2))}),
            ("after", {"color": charts.AFTER}),
        ):
            axes.loglog(*charts.smooth_spectrum(data["frequency_hz"], data[key]), label=key, **style)
        axes.set_xlabel("frequency (Hz)")
        axes.set_ylabel(
            f"error spectrum\n({_squared(unit)}/Hz)" if unit and unit_of(unit) else "error spectrum (per Hz)"
        )
        axes.legend(loc="best")
    return figure(
        drawing.svg,
        f"{name}: spectrum of the error before and after (averaged over twelfths of an octave, and computed within"
        " stretches between two starts of the prediction, so that the starts do not show).",
    )


def _squared(unit: str) -> str:
    return f"{unit}²" if unit.isalpha() else f"({unit})²"


def score_bank(bank: list[Facts], found: set[tuple[Any, Any]]) -> Html:
    """Show the statistic of every effect tried against its threshold; found: (id, entry) of those named."""
    if not bank:
        return Html("")
    ranked = sorted(bank, key=lambda e: -(e.get("statistic") or 0.0))
    shown = [e for i, e in enumerate(ranked) if i < _MOST_BARS or (e.get("id"), e.get("entry")) in found]
    names = [charts.short(called(e.get("id"), e.get("entry"))) for e in shown]
    with charts.sketch((charts.WIDE[0], 0.9 + 0.27 * len(shown))) as drawing:
        marked = {i for i, e in enumerate(shown) if (e.get("id"), e.get("entry")) in found}
        values = [float(e.get("statistic") or 0.0) for e in shown]
        charts.bars(drawing.axes[0, 0], names, values, [e.get("threshold") for e in shown], marked)
        drawing.axes[0, 0].set_xlabel("score statistic")
    rows = [
        (called(e.get("id"), e.get("entry")), number(e.get("statistic")), number(e.get("p_value"), 2),
         _sized(e.get("estimate")), _sized(e.get("minimum_detectable")), unit_of(e), str(e.get("id")))
        for e in shown
    ]  # fmt: skip
    head = ["effect", "#statistic", "#p value", "#one-step estimate", "#smallest found", "unit", "in the catalogue"]
    caption = (
        f"{len(bank)} {'hypothesis' if len(bank) == 1 else 'hypotheses'}, each an effect at a place. A score test says"
        " without a fit whether an effect is worth one; what is named is decided by the gain of the fits. A score to"
        " the right of its orange tick is significant; blue: named above. Errors that the model's own parameters could"
        " explain are projected out."
    )
    if len(shown) < len(bank):
        caption += f" Shown: the {_MOST_BARS} with the largest scores, and what is named."
    numbers = folded(f"The numbers of {counted(len(rows), 'effect')}", table(head, rows))
    return section("Score test of every effect", figure(drawing.svg, caption), numbers)


def _sized(value: Any) -> str:
    return "–" if is_open(value) else number(value, 2)


def confusion(data: Facts) -> Html:
    """Show which effects these data cannot tell apart: cos² of the angle between their scores."""
    names, values = data.get("ids") or [], np.asarray(data.get("cos2") or [], dtype=float)
    if len(names) < 2 or values.shape != (len(names), len(names)):
        return Html("")
    names, values = (
        [charts.short(label_of(n), 50) for n in names[:_MOST_CONFUSED]],
        values[:_MOST_CONFUSED, :_MOST_CONFUSED],
    )
    side = 2.2 + 0.34 * len(names)
    with charts.sketch((side + 1.6, side)) as drawing:
        axes = drawing.axes[0, 0]
        image = axes.pcolormesh(values, cmap="Blues", vmin=0, vmax=1, edgecolors="#e3e7eb", linewidth=0.5)
        axes.invert_yaxis()
        axes.set_aspect("equal")
        centres = np.arange(len(names)) + 0.5
        axes.set_xticks(centres, names, rotation=45, ha="right", fontsize=8)
        axes.set_yticks(centres, names, fontsize=8)
        axes.grid(visible=False)
        style: Facts = {"ha": "center", "va": "center", "fontsize": 6.5}
        for i, j in np.argwhere(values >= 0.5):
            if i != j:
                axes.text(j + 0.5, i + 0.5, f"{values[i, j]:.2f}", color="#fff" if values[i, j] > 0.6 else DOT, **style)
        drawing.figure.colorbar(image, ax=axes, label="cos²", shrink=0.8)
    drawn = tag("div", drawing.svg, style=f"max-width:{100 * (side + 1.6):.0f}px")
    caption = "cos² of the angle between the scores of two effects. Near 1: these data cannot tell the two apart."
    return section("Which effects these data tell apart", figure(drawn, caption))


def appendix(evidence: Facts) -> Html:
    """Show forensics, split, parameters with their pulls, prediction horizon and times."""
    return section(
        "Evidence",
        section("Checks of the recording", _forensics(evidence.get("forensics") or []), level="h3"),
        section("Values of the corrected model", *_free_run(evidence.get("free_run") or {}), level="h3"),
        folded("Parameters of the model, refitted", _parameters(evidence.get("parameters") or [])),
        folded("Error by prediction horizon", *_horizon(evidence.get("horizon") or {})),
        folded("Use of the data", _split(evidence.get("split") or [])),
        folded("Computing times", _timing(evidence.get("timing_s") or {})),
    )


def _forensics(entries: list[Facts]) -> Html:
    rows = [(e.get("check"), e.get("channel") or "", spoken(str(e.get("finding"))), e.get("severity")) for e in entries]
    return table(["check", "channel", "finding", "severity"], rows)


def _split(entries: list[Facts]) -> Html:
    rows = [(e.get("file"), number(e.get("start_s"), 4), number(e.get("stop_s"), 4), e.get("use")) for e in entries]
    return table(["file", "#from (s)", "#to (s)", "use"], rows)


def _parameters(entries: list[Facts]) -> Html:
    rows = [
        (e.get("name"), number(e.get("prior")), with_std(e.get("fitted"), e.get("std")), e.get("unit", ""),
         number(e.get("pull"), 2))
        for e in entries
    ]  # fmt: skip
    note = tag(
        "p",
        "Pull: fitted less declared value, in standard deviations of the fit and of the declared value (prior_std,"
        " where it has one) together.",
        class_="soft",
    )
    return join([table(["parameter", "#declared", "#fitted ± std", "unit", "#pull"], rows), note]) if rows else Html("")


def _free_run(facts: Facts) -> Sequence[Html]:
    """Show where the file's values are other than those told, and what that is worth."""
    if not facts:
        return ()
    said = (
        "The file of the corrected model has the values with which the model simulates best, run free on the inputs"
        " alone; the values told above are those that predict best one step ahead. Error of the free run on the"
        " selection data, to which only the values told above had been fitted:"
    )
    errors = [(o["name"], number(o["one_step"]), number(o["free_run"]), o["unit"]) for o in facts["outputs"]]
    values = [(p["name"], number(p["one_step"]), number(p["free_run"]), p["unit"]) for p in facts["parameters"]]
    return (
        tag("p", said), table(["output", "#values told above", "#values in the file", "unit"], errors),
        table(["parameter", "#one step ahead", "#run free, in the file", "unit"], values),
    )  # fmt: skip


def _horizon(horizon: dict[str, Facts]) -> Sequence[Html]:
    figures = []
    for name, data in list(horizon.items())[:_MOST_OUTPUTS]:
        with charts.sketch((charts.WIDE[0], 2.4)) as drawing:
            axes = drawing.axes[0, 0]
            axes.plot(data["steps"], data["before"], "s--", color=charts.BEFORE, markersize=4, label="before")
            axes.plot(data["steps"], data["after"], "o-", color=charts.AFTER, markersize=4, label="after")
            axes.set_xlabel("prediction horizon (samples)")
            axes.set_ylabel("error (NRMSE)")
            axes.set_ylim(bottom=0)
            axes.legend(loc="best")
        figures.append(
            figure(drawing.svg, f"{name}: error of the prediction over the number of samples that it looks ahead.")
        )
    return figures


def _timing(times: dict[str, float]) -> Html:
    return table(["part", "#seconds"], [(name.replace("_", " "), number(value)) for name, value in times.items()])
