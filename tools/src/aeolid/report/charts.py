"""Draw the figures of the pages as SVG text.

Colours are Okabe and Ito's, told apart in every colour vision and, with dashes and markers, on grey paper too.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from textwrap import shorten, wrap
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from aeolid.display import visible_lines
from aeolid.report.markup import Html
from aeolid.report.numbers import number, unit_of

Array = NDArray[np.float64]
INK, BEFORE, AFTER, TRUTH, GREY = "#1b1f24", "#d55e00", "#0072b2", "#d55e00", "#9aa4b0"
WIDE, HALF = (10.6, 3.2), (5.6, 3.6)  # inches: the full width of the page, and one of two columns
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DOT = "#1b1f25"  # ink on a coloured ground, which stays as it is
_THEME = {  # what a page's scheme changes: the colour drawn, and the page's name of it
    INK: "ink", "#5a6470": "soft", "#e3e7eb": "grid", GREY: "grey", BEFORE: "before", AFTER: "after",
}  # fmt: skip
_OF_WIDTH, _SHORTEST = 0.85, 12  # share of a figure that plots take; letters of the shortest line of a title
_LETTER = 0.0085  # inches that a letter of DejaVu Sans is wide on the average, for each point of its size
_POINTS = 1500  # per line: more cannot be told apart on the width of a page

# A matplotlibrc in the current folder and the style of a caller have no say in a page, nor a page in theirs.
_RC: dict[Any, Any] = {key: value for key, value in matplotlib.rcParamsDefault.items() if key != "backend"}
_RC |= {
    "svg.fonttype": "none", "svg.hashsalt": "aeolid", "font.family": "DejaVu Sans", "font.size": 9.5,
    "figure.facecolor": "none", "axes.facecolor": "none", "text.color": INK,
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": "#5a6470", "axes.labelcolor": INK,
    "axes.grid": True, "grid.color": "#e3e7eb", "grid.linewidth": 0.7, "axes.axisbelow": True, "axes.titlesize": 10,
    "axes.titlelocation": "left", "xtick.color": "#5a6470", "ytick.color": "#5a6470", "legend.frameon": False,
    "lines.linewidth": 1.3, "figure.constrained_layout.use": True, "axes.unicode_minus": True,
    "text.parse_math": False,  # names come from files
    "axes.formatter.useoffset": False, "axes.formatter.limits": (-4, 6),
}  # fmt: skip


def holding(limits: tuple[float, float], values: Array) -> tuple[float, float]:
    """Return the limits of a logarithmic axis, wide enough for these values; none of them needs to be finite.

    >>> holding((1.0, 10.0), np.array([0.5, 8.0]))
    (0.4, 10.0)
    """
    shown = values[np.isfinite(values) & (values > 0)]
    if not len(shown):
        return limits
    return min(limits[0], 0.8 * float(np.min(shown))), max(limits[1], 1.25 * float(np.max(shown)))


class Sketch:
    """Collect one figure: `axes` to draw on (rows, columns), then `svg`, its markup, once the drawing is done."""

    def __init__(self, figure: Any, axes: Any) -> None:
        self.figure, self.axes = figure, axes
        self.svg = Html("")


@contextmanager
def sketch(size: tuple[float, float], rows: int = 1, columns: int = 1, **options: Any) -> Iterator[Sketch]:
    """Open a figure of a size in inches; leaving the block turns it into markup."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    with matplotlib.rc_context(_RC):
        figure = Figure(figsize=size)
        drawing = Sketch(figure, figure.subplots(rows, columns, squeeze=False, **options))
        yield drawing
        _write_decades(figure)
        for written in figure.findobj(Text):
            written.set_text(visible_lines(written.get_text()))
        text = io.StringIO()
        # straight to the canvas: savefig draws all once more only to lay it out, which drawing does anyway
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(text, metadata={"Date": None, "Creator": None})
    markup = text.getvalue()
    fonts = "'DejaVu Sans', Verdana, Arial, sans-serif"  # the first is the widest: others fit where it does
    markup = markup[markup.index("<svg") :].replace("'DejaVu Sans'", fonts).rstrip()
    for colour, name in _THEME.items():
        markup = markup.replace(f": {colour}", f": var(--{name}, {colour})")
    drawing.svg = Html(markup.replace("<svg ", '<svg class="wide" ', 1) if size[0] > HALF[0] + 1 else markup)


def _write_decades(figure: Any) -> None:
    """Label logarithmic axes in plain text: the formulas that Matplotlib writes there cost a third of a page's time."""
    from matplotlib.ticker import LogFormatter, LogFormatterSciNotation

    class Plain(LogFormatter):
        """Label what LogFormatter labels, in decimals or, where the axis reaches far, in powers of ten."""

        def __call__(self, x: float, pos: int | None = None) -> str:
            assert self.axis is not None
            low, high = self.axis.get_view_interval()
            return decade(x, low >= 1e-3 and high < 1e5) if super().__call__(x, pos) else ""

    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatterSciNotation):
            axis.set_major_formatter(Plain())
        if isinstance(axis.get_minor_formatter(), LogFormatterSciNotation):
            axis.set_minor_formatter(Plain())


def decade(x: float, plain: bool) -> str:
    """Write a positive value of a logarithmic axis, `plain` or as a power of ten: 0.02, 300; 2·10⁻², 10⁻⁷."""
    if plain:
        return f"{x:g}"
    digits, exponent = f"{x:.3e}".split("e")
    raised = str(int(exponent)).translate(_RAISED)
    return f"10{raised}" if float(digits) == 1 else f"{float(digits):g}·10{raised}"


def thin(x: Sequence[float] | Array, y: Sequence[float] | Array) -> tuple[Array, Array]:
    """Reduce a line to what the page can show: least and greatest value of each stretch of samples."""
    a, b = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if len(a) <= _POINTS:
        return a, b
    stretches = np.array_split(np.arange(len(a)), _POINTS // 2)
    keep: list[int] = []
    for part in stretches:
        values = b[part]
        if np.isnan(values).all():
            keep.append(int(part[0]))
            continue
        keep += sorted({int(part[np.nanargmin(values)]), int(part[np.nanargmax(values)])})
    return a[keep], b[keep]


def smooth_spectrum(frequency_hz: Sequence[float], power: Sequence[float], per_octave: int = 12) -> tuple[Array, Array]:
    """Average a spectrum over equal parts of an octave; returns centre frequencies and means of the parts in use."""
    f, p = np.asarray(frequency_hz, dtype=float), np.asarray(power, dtype=float)
    use = (f > 0) & np.isfinite(p)
    part = np.floor(per_octave * np.log2(f[use])).astype(int)
    _, group = np.unique(part, return_inverse=True)
    count = np.bincount(group)
    return np.bincount(group, f[use]) / count, np.bincount(group, p[use]) / count


def label(name: str, unit: str | None) -> str:
    """Write an axis label: name and unit, the unit on a line of its own under a long name."""
    return f"{name}{chr(10) if len(name) > 16 else ' '}({unit})" if unit_of(unit) else name


def titled(axes: Any, text: str, size: float = 10) -> None:
    """Write the title of a plot, on several lines where it is wider than the plot."""
    spec, figure = axes.get_subplotspec(), axes.get_figure()
    widths = spec.get_gridspec().get_width_ratios()
    inches = _OF_WIDTH * figure.get_figwidth() * widths[spec.colspan.start] / sum(widths)
    axes.set_title("\n".join(wrap(text, max(_SHORTEST, int(inches / (_LETTER * size))))), fontsize=size)


def short(text: str, most: int = 70) -> str:
    """Return a text of at most so many characters, cut behind a word and marked where it is longer."""
    return shorten(text, most, placeholder=" …")


def bars(
    axes: Any, names: Sequence[str], values: Sequence[float], threshold: Sequence[float | None], marked: set[int]
) -> None:
    """Draw horizontal bars, best first, each with its own threshold as a tick; numbers stand at their ends."""
    place = np.arange(len(names))[::-1]
    colours = [AFTER if i in marked else GREY for i in range(len(names))]
    axes.barh(place, values, color=colours, height=0.62)
    known = [(p, t) for p, t in zip(place, threshold, strict=True) if t is not None]
    for p, t in known:
        axes.plot([t, t], [p - 0.42, p + 0.42], color=BEFORE, linewidth=2)
    reach = max([*values, *(t for _, t in known), 1e-12])
    for p, value, tick in zip(place, values, threshold, strict=True):
        end = max(value, 0.0)  # a statistic below zero has no bar, its number stands at the axis
        if tick is not None and value < tick < value + 0.1 * reach:  # the number would lie on the tick
            end = tick
        axes.text(end + 0.01 * reach, p, number(float(value)), va="center", fontsize=8.5)
    axes.set_yticks(place, names)
    axes.set_xlim(0, 1.12 * reach)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
