"""Draw where a mismatch sits: innovations by frequency, time, region, rotor angle, and which equation they accuse."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.report import charts
from aeolid.report.charts import DOT
from aeolid.report.markup import Html, figure, join, table, tag
from aeolid.report.numbers import number
from aeolid.wording import counted

Facts = dict[str, Any]
Array = NDArray[np.float64]
_LEAST, _MOST = 2.0, 5.0  # thresholds of chance at which colours end, at the least and at the most
_PALE = 0.25  # of the colours is for what chance gives: noise looks like noise
_MOST_SOURCES = 4  # recordings side by side in one map
_MOST_ROWS = 12
_SIGNED, _PLAIN = "PuOr_r", "Purples"
_CHANCE = "times the limit"
_COLOUR = " Colour: more (orange) or less (violet) than expected, in multiples of the limit of significance."
_DOT = "A dot marks what is significant (at 1 % for the whole map)." + _COLOUR
_DOT_OF_TENTH = _DOT.replace("map).", "map) and is a tenth of the power at least.")


def maps(evidence: Facts) -> Html:
    """Show every map that has data, and the table of equations and values."""
    cells = evidence.get("cells") or {}
    return join(
        [
            band_map(evidence.get("bands") or []),
            time_map(cells.get("time") or []),
            *region_maps(cells.get("region") or []),
            azimuth_map(cells.get("azimuth") or []),
            path_map(cells.get("path") or []),
            horizon_map(cells.get("horizon") or []),
            effort_map(cells.get("effort") or []),
            inferred_map(cells.get("inferred") or []),
            equations(evidence.get("equations") or []),
        ]
    )


def band_map(bands: list[Facts]) -> Html:
    """Show channel × frequency: how far the innovations of the model as it was are from white."""
    caption = (
        "What the model before correction leaves unexplained: power of its innovations (errors of the one-step"
        f" prediction) relative to white noise, by channel and third octave. {_DOT}"
    )
    return _over(bands, _outputs(bands), caption, "frequency_hz")


def time_map(cells: list[Facts]) -> Html:
    """Show channel × time: mean and power of the innovations in stretches of the fitted data."""
    outputs, sources = _outputs(cells), list(dict.fromkeys(str(c["source"]) for c in cells))
    if not outputs:
        return Html("")
    shown = _most_marked(cells, sources)
    spans = [[t for c in cells if c["source"] == s for t in c["time_s"]] for s in shown]
    widths = [max(max(t) - min(t), 1e-9) for t in spans]
    widths = [max(w, 0.15 * max(widths)) for w in widths]  # a short recording keeps room for its name
    size = charts.WIDE[0], 1.6 + 0.7 * len(outputs)
    with charts.sketch(size, 2, len(shown), sharex="col", gridspec_kw={"width_ratios": widths}) as drawing:
        for row, kind in enumerate(("mean", "power")):
            tiles = _tiles(cells, kind, outputs, "time_s")
            top = _reach(tiles)
            for column, source in enumerate(shown):
                axes, own = drawing.axes[row, column], [t for t in tiles if t[4]["source"] == source]
                image = _paint(axes, own, outputs, _SIGNED, top)
                axes.tick_params(axis="y", length=0 if column else 3.5, labelleft=not column)
            _scale(drawing, image, list(drawing.axes[row]), f"{kind}\n{_CHANCE}", top)
        for column, source in enumerate(shown):
            charts.titled(drawing.axes[0, column], source if len(shown) > 1 else "", 8.5)
            drawing.axes[1, column].set_xlabel("time (s)")
    rest = f" Shown: {len(shown)} of {counted(len(sources), 'recording')}." if len(shown) < len(sources) else ""
    caption = (
        "The same innovations by channel and stretch of time, over the data of the fit. Above: their mean less that of"
        " the whole, in standard deviations; below: their power relative to that of the whole. A dot marks a stretch"
        f" that differs significantly from the others (at 1 % for the whole map).{_COLOUR}{rest}"
    )
    return figure(drawing.svg, caption)


def _most_marked(cells: list[Facts], sources: list[str]) -> list[str]:
    """Return the recordings, at most so many, in which most is beyond chance, in their own order."""
    loudest = dict.fromkeys(sources, 0.0)
    for c in cells:
        loudest[str(c["source"])] = max(loudest[str(c["source"])], float(c["statistic"] / c["threshold"]))
    chosen = sorted(sources, key=lambda s: -loudest[s])[:_MOST_SOURCES]
    return [s for s in sources if s in chosen]


def region_maps(cells: list[Facts]) -> list[Html]:
    """Show channel × region: mean and power of the innovations in bins of what says the operating point."""
    figures = []
    for channel in dict.fromkeys(str(c["channel"]) for c in cells):
        own = [c for c in cells if c["channel"] == channel]
        outputs = _outputs(own)
        edges = sorted({float(v) for c in own for v in c["range"]})
        place = {v: float(i) for i, v in enumerate(edges)}
        with charts.sketch((charts.WIDE[0], 1.5 + 0.42 * len(outputs)), 1, 2) as drawing:
            for axes, kind in zip(drawing.axes[0], ("mean", "power"), strict=True):
                tiles = [(place[a], place[b], *rest) for a, b, *rest in _tiles(own, kind, outputs, "range")]
                top = _reach(tiles)
                image = _paint(axes, tiles, outputs, _SIGNED, top)
                axes.set_xticks(range(len(edges)), [f"{v:.3g}" for v in edges])
                axes.tick_params(axis="y", length=3.5 if kind == "mean" else 0, labelleft=kind == "mean")
                axes.set_xlabel(charts.label(channel, own[0].get("unit")).replace("\n", " "))
                _scale(drawing, image, axes, f"{kind}\n{_CHANCE}", top)
        caption = (
            f"By channel and by the value of {channel} shortly before, in bins with equal numbers of samples: mean and"
            " power of the innovations, relative to the whole. A dot marks what is significant (at 1 % for all"
            f" bins) beside the same innovations shifted in time against {channel}.{_COLOUR}"
        )
        figures.append(figure(drawing.svg, caption))
    return figures


def azimuth_map(cells: list[Facts]) -> Html:
    """Show channel × azimuth order: amplitude of the innovations at multiples of the rotor's angle."""
    outputs = _outputs(cells)
    if not outputs:
        return Html("")
    tiles = [(c["order"] - 0.5, c["order"] + 0.5, outputs.index(str(c["output"])), float(c["value"]), c) for c in cells]
    side = 6.4, 1.3 + 0.42 * len(outputs)
    with charts.sketch(side) as drawing:
        axes = drawing.axes[0, 0]
        top = _reach(tiles)
        image = _paint(axes, tiles, outputs, _PLAIN, top, low=0.0)
        axes.set_xticks(sorted({int(c["order"]) for c in cells}))
        axes.set_xlabel("multiple of the rotor's angle")
        _scale(drawing, image, axes, f"amplitude\n{_CHANCE}", top, low=0.0)
    caption = (
        "By channel and azimuth order: amplitude of the innovations at multiples of the recorded rotor angle, against"
        " the limit of significance. A dot marks a line: significantly more than at the orders 0.25 to 0.45 beside it,"
        " and with a constant phase (at 1 % for the whole map)."
    )
    return figure(tag("div", drawing.svg, style=f"max-width:{100 * side[0] / charts.WIDE[0]:.0f}%"), caption)


def path_map(cells: list[Facts]) -> Html:
    """Show output and channel × frequency: which recorded channel's past the innovations follow."""
    pairs = list(dict.fromkeys((str(c["output"]), str(c["channel"])) for c in cells))
    if not pairs:
        return Html("")
    loudest = dict.fromkeys(pairs, 0.0)
    for c in cells:
        pair = str(c["output"]), str(c["channel"])
        loudest[pair] = max(loudest[pair], float(c["statistic"]))
    kept = sorted(pairs, key=lambda p: -loudest[p])[:_MOST_ROWS]
    shown = [p for p in pairs if p in kept]
    rest = f" Shown: {len(shown)} of {len(pairs)} pairs." if len(shown) < len(pairs) else ""
    caption = (
        "Which recorded channel the innovations depend on: power that can be predicted from a channel's past, by third"
        " octave; only the past counts, so that a controller's reaction is not taken for a cause. A dot marks a"
        f" significant dependence (at 1 % for the whole map).{_COLOUR}{rest}"
    )
    rows = [f"{output} ← {channel}" for output, channel in shown]
    named = [c | {"output": f"{c['output']} ← {c['channel']}"} for c in cells]
    return _over([c for c in named if c["output"] in rows], rows, caption, "frequency_hz", 0.34)


def horizon_map(cells: list[Facts]) -> Html:
    """Show channel × horizon: errors of longer predictions against those that the model itself foretells."""
    times = sorted({float(c["horizon_s"]) for c in cells})
    ends = dict(zip(times, pairwise(_between(times)), strict=True)) if len(times) > 1 else {}
    caption = (
        "How far ahead the model before correction predicts: squared error by prediction horizon, the inputs known,"
        " relative to the error expected from the model's own noise in the same control loop if nothing were missing."
        f" {_DOT_OF_TENTH}"
    )
    tiles = [c | {"ends": ends[float(c["horizon_s"])]} for c in cells] if ends else []
    return _over(tiles, _outputs(tiles), caption, "ends", xlabel="horizon (s)")


def effort_map(cells: list[Facts]) -> Html:
    """Show input × frequency: control effort against what the model in this loop would call for."""
    caption = (
        "Control effort: power of the inputs that a controller computes, by third octave, relative to what the same"
        f" controller and excitation would need with the model before correction. {_DOT_OF_TENTH}"
    )
    return _over(cells, _outputs(cells), caption, "frequency_hz")


def inferred_map(cells: list[Facts]) -> Html:
    """Show unmeasured input × frequency: whether what the model infers is what it takes such an input to be."""
    caption = (
        "Inferred inputs: power of the wind and other unmeasured forces as the model estimates them, by third octave,"
        " relative to what the model assumes of them. An effect that is missing from the model is easily attributed to"
        f" the wind, which then has an implausible spectrum. {_DOT_OF_TENTH}"
    )
    return _over(cells, _outputs(cells), caption, "frequency_hz")


def _between(values: Sequence[float]) -> list[float]:
    """Return edges around ascending values on a logarithmic axis."""
    inner = [float(np.sqrt(a * b)) for a, b in pairwise(values)]
    return [values[0] ** 2 / inner[0], *inner, values[-1] ** 2 / inner[-1]]


def _over(
    cells: Sequence[Facts], rows: Sequence[str], caption: str, ends: str, height: float = 0.45,
    xlabel: str = "frequency (Hz)",
) -> Html:  # fmt: skip
    """Draw the cells' power against chance, a row an output, over a logarithmic axis; nothing where there are none."""
    if not rows:
        return Html("")
    tiles = [(*c[ends], rows.index(str(c["output"])), _db(c.get("value", c.get("ratio"))), c) for c in cells]
    with charts.sketch((charts.WIDE[0], 1.2 + height * len(rows))) as drawing:
        axes = drawing.axes[0, 0]
        axes.set_xscale("log")
        top = _reach(tiles)
        image = _paint(axes, tiles, rows, _SIGNED, top, logarithmic=True)
        axes.set_xlabel(xlabel)
        _scale(drawing, image, axes, _CHANCE.replace(" ", "\n", 1), top)
    return figure(drawing.svg, caption)


def equations(rows: list[Facts]) -> Html:
    """List which equations need noise and which declared values wander, what is furthest beyond chance first."""
    if not rows:
        return Html("")
    shown = [
        (r.get("name"), r.get("asked"), _scaled(r), _scaled(r | {"statistic": r.get("threshold")}),
         "significant" if r.get("significant") else "")
        for r in rows[:_MOST_ROWS]
    ]  # fmt: skip
    text = (
        "Which equation and which declared value the innovations point to. Noise an equation needs: the log-likelihood,"
        " in nats, that the fit loses without process noise in this equation; unmeasured inputs or a missing effect act"
        " there. Wanders in time: score test of a slow change of a declared value, with what the fitted parameters"
        " could explain projected out."
    )
    head = ["equation or value", "asked", "#statistic", "#threshold", ""]
    return join([tag("p", text), table(head, shown)])


def _scaled(row: Facts) -> str:
    value = row.get("statistic")
    text = "no fit without" if value is None else number(value)
    return f"{text} nats" if row.get("scale") == "nats" and value is not None else text


_Tile = tuple[float, float, int, float, Facts]  # from, to, row, value, the cell


def _tiles(cells: Sequence[Facts], kind: str, outputs: Sequence[str], ends: str) -> list[Any]:
    return [
        (*c[ends], outputs.index(str(c["output"])), float(c["value"]) if kind == "mean" else _db(c["value"]), c)
        for c in cells
        if c["kind"] == kind
    ]


def _paint(
    axes: Any, tiles: Sequence[Any], outputs: Sequence[str], colours: str, reach: float, *, low: float | None = None,
    logarithmic: bool = False,
) -> Any:  # fmt: skip
    """Fill tiles with colours, dot those that are significant; returns what a colour bar needs."""
    from matplotlib.collections import PolyCollection

    corners = [[(a, row), (b, row), (b, row + 1), (a, row + 1)] for a, b, row, *_ in tiles]
    image = PolyCollection(corners, cmap=colours, edgecolors="face", linewidths=0.3, norm=_norm(reach, low))
    image.set_array(np.array([_strength(t) for t in tiles]))
    axes.add_collection(image)
    for a, b, row, _, cell in tiles:
        if cell.get("significant"):
            middle = float(np.sqrt(a * b)) if logarithmic else 0.5 * (a + b)
            axes.plot(middle, row + 0.5, "o", color=DOT, markersize=4.5, markeredgecolor="white", markeredgewidth=0.8)
    axes.set_xlim(min(t[0] for t in tiles), max(t[1] for t in tiles))
    axes.set_ylim(len(outputs), 0)
    axes.set_yticks(np.arange(len(outputs)) + 0.5, outputs)
    axes.grid(visible=False)
    return image


def _strength(tile: Any) -> float:
    """Return how far a tile is beyond chance, in limits of chance, with the sign of its value.

    A cell that does not say its statistic (of a file from before it was written) is beyond by half or within by half.
    """
    value, cell = float(tile[3]), tile[4]
    if cell.get("statistic") is None or not cell.get("threshold"):
        return float(np.copysign(1.5 if cell.get("significant") else 0.5, value))
    return float(np.copysign(min(cell["statistic"] / cell["threshold"], 1e3), value))


def _reach(tiles: Sequence[Any]) -> float:
    """Return where the colours end, in limits of chance."""
    return float(np.clip(max((abs(_strength(t)) for t in tiles), default=0.0), _LEAST, _MOST))


def _norm(top: float, low: float | None) -> Any:
    """Return the scale of colours: a quarter of them for what chance gives, the rest for what is beyond, to `top`."""
    from matplotlib.colors import FuncNorm

    at, to = [0.0, 1.0, top], [0.0, _PALE, 1.0]

    def forward(x: Any) -> Any:
        return np.copysign(np.interp(np.abs(x), at, to), x)

    def back(x: Any) -> Any:
        return np.copysign(np.interp(np.abs(x), to, at), x)

    return FuncNorm((forward, back), vmin=-top if low is None else low, vmax=top, clip=True)


def _scale(drawing: charts.Sketch, image: Any, axes: Any, label: str, top: float, low: float | None = None) -> None:
    """Draw the bar of colours: nothing, the limit of chance, the end."""
    bar = drawing.figure.colorbar(image, ax=axes, pad=0.01)
    ends = [0.0, 1.0, top] if low is not None else [-top, -1.0, 0.0, 1.0, top]
    bar.set_ticks(ends, labels=[f"{abs(v):.2g}" for v in ends])
    bar.set_label(label, fontsize=8)


def _db(ratio: Any) -> float:
    return float(10 * np.log10(max(float(ratio), 1e-3)))


def _outputs(cells: Sequence[Facts]) -> list[str]:
    return list(dict.fromkeys(str(c["output"]) for c in cells))
