"""Write the page of an identification: what was run, order, poles, modes, frequency response, fit, stream."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aeolid.report import charts
from aeolid.report.bode import bode_part
from aeolid.report.markup import Html, figure, join, section, table, tag, write_page
from aeolid.report.numbers import number, percent, quantity, with_std
from aeolid.report.response import poles
from aeolid.report.shapes import shapes_part

Facts = dict[str, Any]


def render_identification(facts: Facts, path: str | Path) -> None:
    """Write one page from the facts of an identification.

    Every key is optional. `title`, `command`, `recordings` [{file, samples, sample_time_s}], `settings` {name: value},
    `singular_values`, `order`, `order_reason`, `eigenvalues` and `true_eigenvalues` [[re, im]], `modes` and
    `true_modes` [{frequency_hz, damping, frequency_std_hz, damping_std, name}], `model` and `true_model` (the content
    of model.json), `frequency_response` (with its deviation, as in model.json), `spectral` (as there), `fit`
    {output: {measure: value}}, `stream` {name: value}.
    """
    title = str(facts.get("title") or "Identification")
    write_page(path, title, tag("h1", title), identification_parts(facts))


def identification_parts(facts: Facts) -> Html:
    """Build the parts of the page below its title."""
    return join(
        [
            tag("p", _summary(facts)),
            *map(_note, facts.get("notes") or []),
            _modes(facts),
            shapes_part(facts.get("modes") or [], _units(facts)),
            tag("div", join([_singular_values(facts), _poles(facts)]), class_="pair"),
            bode_part(facts),
            _fit(facts.get("fit") or {}),
            _run(facts),
            _stream(facts.get("stream") or {}),
        ]
    )


def _note(text: str) -> Html:
    """Show a note; a warning stands out."""
    loud, _, rest = str(text).partition("WARNING: ")
    if rest and not loud:
        return tag("p", f"Warning: {rest}", class_="warn")
    return tag("p", f"Note: {text}", class_="soft")


def _summary(facts: Facts) -> str:
    modes, true = facts.get("modes") or [], facts.get("true_modes") or []
    if not modes:
        return ""
    count = sum(map(_oscillates, modes))
    parts = [f"{count} oscillating mode{'s' if count != 1 else ''} identified"]
    if facts.get("order"):
        parts[0] += f" by a model of order {facts['order']}"
    pairs = [(m, t) for m, t in paired(modes, true) if t and _oscillates(t) and _oscillates(m)]
    errors = [abs(m["frequency_hz"] / t["frequency_hz"] - 1) for m, t in pairs]
    if errors:
        parts.append(f"the frequencies are within {percent(max(errors), 2)} of the true ones")
    return "; ".join(parts) + "."


def _run(facts: Facts) -> Html:
    rows: list[tuple[str, object]] = []
    if facts.get("command"):
        rows.append(("command", tag("code", facts["command"])))
    for entry in facts.get("recordings") or []:
        samples, step = entry.get("samples"), entry.get("sample_time_s")
        length = f", {samples * step:.4g} s at {1 / step:.4g} Hz" if samples and step else ""
        rows.append(("recording", Html(f"{tag('code', entry.get('file', ''))} {number(samples)} samples{length}")))
    for key, value in (facts.get("settings") or {}).items():
        if value is not None:
            rows.append((key.replace("_", " "), f"{value:.4g}" if isinstance(value, float) else str(value)))
    return section("What was run", table(["", ""], rows))


def _stream(stream: Facts) -> Html:
    rows = [(key.replace("_", " "), quantity(value)) for key, value in stream.items() if value is not None]
    return section("The stream from the controller", table(["", "#"], rows))


def _oscillates(mode: Facts) -> bool:
    return bool(mode.get("frequency_hz")) and abs(mode.get("damping") or 0.0) < 1


def _distance(mode: Facts, real: Facts) -> float:
    """Return how far apart two modes are: in the z-plane where both poles are known, else in Hz."""
    if mode.get("eigenvalue") and real.get("eigenvalue"):
        a, b = poles([mode["eigenvalue"], real["eigenvalue"]])
        return float(abs(a - b))
    return abs(float(mode.get("frequency_hz") or 0.0) - float(real.get("frequency_hz") or 0.0))


def paired(modes: list[Facts], true: list[Facts]) -> list[tuple[Facts, Facts | None]]:
    """Give each identified mode the nearest true one, every true one at most once."""
    left = list(range(len(true)))
    pairs: dict[int, int] = {}
    order = sorted((_distance(m, t), i, j) for i, m in enumerate(modes) for j, t in enumerate(true))
    for _, i, j in order:
        if i not in pairs and j in left:
            pairs[i] = j
            left.remove(j)
    return [(m, true[pairs[i]] if i in pairs else None) for i, m in enumerate(modes)]


def _modes(facts: Facts) -> Html:
    """Show what swings, the rotor's harmonics apart, real poles as time constants; nothing beyond Nyquist."""
    modes, true = facts.get("modes") or [], facts.get("true_modes") or []
    if not modes:
        return Html("")
    step = float((facts.get("model") or {}).get("sample_time_s") or 0.0)
    beyond = [m for m in modes if step and (m.get("frequency_hz") or 0.0) >= 0.5 / step * (1 - 1e-9)]
    pairs = [(m, t) for m, t in paired(modes, true) if m not in beyond]
    apart = [(m, t) for m, t in pairs if m.get("rotor_order")]
    tones = [(m, t) for m, t in pairs if m.get("tone") and not m.get("rotor_order")]
    listed = [(m, t) for m, t in pairs if not m.get("rotor_order") and not m.get("tone")]
    swinging = [(m, t) for m, t in listed if _oscillates(m)]
    real = [(m, t) for m, t in listed if not _oscillates(m)]
    notes = [_real_poles(real)] if real else []
    if beyond:
        many = "one pole" if len(beyond) == 1 else f"{len(beyond)} poles"
        notes.append(f"Left out: {many} beyond the Nyquist frequency of {number(0.5 / step, 3)} Hz.")
    if _has_std(modes):
        notes.append("± is one standard deviation.")
    parts: list[Html] = [mode_table(swinging, bool(true))] if swinging else []
    if apart:
        words = "On multiples of the rotor's speed, more likely its harmonics than modes:"
        parts += [tag("p", words), mode_table(apart, bool(true))]
    if tones:
        words = "Poles whose damping cannot be told from zero: a lightly damped mode or a periodic force;"
        words += " record longer, or record the azimuth:"
        parts += [tag("p", words), mode_table(tones, bool(true))]
    return section("Modes", *parts, *(tag("p", note, class_="soft") for note in notes))


def _units(facts: Facts) -> dict[str, str]:
    return {str(s["name"]): str(s.get("unit") or "") for s in (facts.get("model") or {}).get("outputs") or []}


def mode_table(pairs: list[tuple[Facts, Facts | None]], true: bool) -> Html:
    """Build a table of modes, each beside the true one where it is known; true: whether any is."""
    shares = any(m.get("outputs") for m, _ in pairs)
    rows = []
    for mode, real in pairs:
        row = [mode.get("name") or (real or {}).get("name") or ""]
        row += [_mostly(mode.get("outputs") or {})] if shares else []
        row += [with_std(mode.get("frequency_hz"), mode.get("frequency_std_hz"), 4), _damping(mode)]
        if true:
            row += [number((real or {}).get("frequency_hz"), 4), _damping(real or {}), _signed_error(mode, real)]
        rows.append(row)
    head = ["mode", *(["mostly in"] if shares else []), "#frequency (Hz)", "#damping (%)"]
    head += ["#true frequency (Hz)", "#true damping (%)", "#frequency error"] if true else []
    return table(head, rows)


def _real_poles(pairs: list[tuple[Facts, Facts | None]]) -> str:
    """Say the time constants of real poles."""
    told = []
    for mode, true in pairs:
        rate = 2 * np.pi * float(mode.get("frequency_hz") or 0.0)
        shares = mode.get("outputs") or {}
        place = f" in {max(shares, key=lambda key: float(shares[key]))}" if shares else ""
        place += f" ({true['name']})" if true and true.get("name") else ""
        told.append((_time_constant(mode, rate) if rate else "an integrator") + place)
    return f"Real poles, by their time constants: {'; '.join(told)}."


def _time_constant(mode: Facts, rate: float) -> str:
    """Return 1/rate in s with its deviation, where that is below the value, and whether the pole grows."""
    std, hertz = mode.get("frequency_std_hz"), float(mode["frequency_hz"])
    spread = float(std) / hertz / rate if std is not None and float(std) < hertz else None
    growing = "grows with " if float(mode.get("damping") or 0.0) < 0 else ""
    return f"{growing}{with_std(1 / rate, spread, 3)} s"


def _mostly(shares: Facts) -> str:
    if not shares:
        return ""
    name = max(shares, key=lambda key: float(shares[key]))
    return f"{name} ({percent(shares[name], 2)})"


def _damping(mode: Facts) -> str:
    """Return the damping in percent; a real pole has none to speak of."""
    return with_std(_hundred(mode.get("damping")), _hundred(mode.get("damping_std"))) if _oscillates(mode) else "–"


def _has_std(modes: list[Facts]) -> bool:
    return any(mode.get("frequency_std_hz") for mode in modes)


def _hundred(value: Any) -> Any:
    return 100.0 * value if isinstance(value, int | float) else value


def _signed_error(mode: Facts, real: Facts | None) -> str:
    if real is None or not _oscillates(real) or not _oscillates(mode):
        return "–"
    error = mode["frequency_hz"] / real["frequency_hz"] - 1
    return ("+" if error > 0 else "") + percent(error, 2)


def _singular_values(facts: Facts) -> Html:
    values = np.asarray(facts.get("singular_values") or [], dtype=float)
    if not len(values):
        return Html("")
    order = facts.get("order")
    shown = values[: max(30, 2 * (order or 0))]
    with charts.sketch(charts.HALF) as drawing:
        axes = drawing.axes[0, 0]
        index = np.arange(1, len(shown) + 1)
        kept = index <= (order or 0)
        axes.semilogy(index[kept], shown[kept], "o", color=charts.AFTER, label="kept")
        axes.semilogy(index[~kept], shown[~kept], "o", color=charts.GREY, fillstyle="none", label="left out")
        if order:
            axes.axvline(order + 0.5, color=charts.BEFORE, linestyle="--", linewidth=1)
            axes.legend(loc="upper right")
        axes.set_xlabel("index")
        axes.set_ylabel("singular value")
    reason = str(facts.get("order_reason") or "Singular values.")
    reason = reason[:1].upper() + reason[1:]
    return tag("section", tag("h3", "Order"), figure(drawing.svg, reason))


def _poles(facts: Facts) -> Html:
    found = poles(facts.get("eigenvalues") or [])
    true = poles(facts.get("true_eigenvalues") or [])
    if not len(found):
        return Html("")
    everything = np.concatenate([found, true])
    with charts.sketch(charts.HALF) as drawing:
        axes = drawing.axes[0, 0]
        angle = np.linspace(-np.pi, np.pi, 721)
        axes.plot(np.cos(angle), np.sin(angle), color=charts.GREY, linewidth=1, label="unit circle")
        if len(true):
            axes.plot(true.real, true.imag, "o", color=charts.TRUTH, fillstyle="none", markersize=10, label="true")
        cross: Facts = {"color": charts.AFTER, "markersize": 7, "markeredgewidth": 1.8, "label": "identified"}
        axes.plot(found.real, found.imag, "x", **cross)
        _frame_square(axes, everything)
        axes.set_xlabel("real part")
        axes.set_ylabel("imaginary part")
        axes.legend(loc="best", fontsize=8.5)
    caption = "Eigenvalues in the z plane"
    if len(true):
        caption += f"; no true one is farther than {number(poles_apart(facts), 2)} from an identified one"
    return tag("section", tag("h3", "Poles"), figure(drawing.svg, caption + "."))


def poles_apart(facts: Facts) -> float:
    """Return the largest distance, in the z-plane, from a true eigenvalue to the nearest identified one."""
    found, true = poles(facts["eigenvalues"]), poles(facts["true_eigenvalues"])
    return max(float(np.min(np.abs(found - t))) for t in true)


def _frame_square(axes: Any, points: Any) -> None:
    """Show all poles with equal scales on both axes, filling the drawing's width-to-height ratio."""
    centre = complex(points.real.min() + points.real.max(), points.imag.min() + points.imag.max()) / 2
    half = 0.6 * max(np.ptp(points.imag), np.ptp(points.real) / 1.6, 0.05)
    axes.set_xlim(centre.real - 1.6 * half, centre.real + 1.6 * half)
    axes.set_ylim(centre.imag - half, centre.imag + half)
    axes.set_aspect("equal", adjustable="box")


def _fit(fit: Facts) -> Html:
    rows = {name: entry for name, entry in fit.items() if isinstance(entry, dict)}
    measures = list(dict.fromkeys(key for entry in rows.values() for key in entry))
    body = [[name, *(number(entry.get(m)) for m in measures)] for name, entry in rows.items()]
    return section("Fit", table(["output", *(f"#{m.replace('_', ' ')}" for m in measures)], body))
