"""Draw what a case was understood as: every channel over time, the recording above the run it is held against."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.record import Channel, Record
from aeolid.report import charts
from aeolid.report.markup import Html, figure, section, table, tag, write_page
from aeolid.report.zoom import MOST_ALONE, Line, Panel, zoomed

Array = NDArray[np.float64]
_MOST = 40  # channels that are drawn
_KINDS = ("after", "ink")  # how the first recording is drawn, and the others


def render_recordings(
    title: str, records: Sequence[Record], run: Record | None, tables: Sequence[tuple[str, list[list[str]]]],
    doubts: Sequence[str], path: str | Path,
) -> None:  # fmt: skip
    """Write one page: what looks odd, a table a file (heading, rows) and each channel over time."""
    heading = ["channel", "unit", "role", "between samples", "#missing", "#least", "#mean", "#greatest"]
    parts = [section(name, table(heading, rows)) for name, rows in tables]
    odd = [tag("p", f"Look at this: {text}.") for text in doubts] or [tag("p", "Nothing looks odd.")]
    write_page(path, title, tag("h1", title), *odd, *parts, section("Over time", _drawn(records, run)))


def _drawn(records: Sequence[Record], run: Record | None) -> Html:
    channels = records[0].channels[:_MOST]
    with charts.sketch((charts.WIDE[0], 1.15 * len(channels) + 0.6), rows=len(channels)) as drawing:
        for i, channel in enumerate(channels):
            axes = drawing.axes[i, 0]
            for k, record in enumerate(records):
                _line(axes, record, channel.name, charts.AFTER, "recording" if k == 0 else None, 1.0 - 0.4 * (k > 0))
            if run is not None and any(c.name == channel.name for c in run.channels):
                _line(axes, run, channel.name, charts.BEFORE, "baseline run", 0.8)
            axes.set_ylabel(f"{channel.name}\n({channel.unit or '1'})", rotation=0, ha="right", va="center")
            if i == 0 and run is not None:
                axes.legend(loc="upper right")
        drawing.axes[-1, 0].set_xlabel("time from the first sample (s)")
    caption = "Each channel in its unit. Breaks in a line are missing samples."
    step, sides = records[0].sample_time_s, [*records, *([run] if run is not None else [])]
    count = max(len(r) * r.sample_time_s for r in sides) / step
    if count * len(channels) * len(sides) > MOST_ALONE:
        return figure(drawing.svg, caption)
    clock: Array = step * np.arange(round(count), dtype=np.float64)
    panels = [_panel(c, clock, records, run) for c in channels]
    return zoomed(drawing.svg, caption, clock, panels, (0, len(clock)), len(clock))


def _panel(channel: Channel, clock: Array, records: Sequence[Record], run: Record | None) -> Panel:
    """Return a channel of all recordings and of the run at the times (N,) of a clock, s from the first sample."""
    one, lines = len(records) == 1, []
    for k, record in enumerate(records):
        name = "recording" if one else record.source
        lines.append(Line(name, _KINDS[min(k, 1)], _at(clock, record, channel.name)))
    if run is not None and any(c.name == channel.name for c in run.channels):
        lines.append(Line("baseline run", "before", _at(clock, run, channel.name)))
    return Panel(f"{channel.name} ({channel.unit or '1'})", tuple(lines), 90)


def _at(clock: Array, record: Record, name: str) -> Array:
    """Return the sample nearest to each time (N,) after the first one; NaN beyond the last."""
    place = np.rint(clock / record.sample_time_s).astype(int)
    values = np.asarray(record.column(name), dtype=float)
    found: Array = np.where(place < len(values), values[np.minimum(place, len(values) - 1)], np.nan)
    return found


def _line(axes: object, record: Record, name: str, color: str, label: str | None, alpha: float) -> None:
    x, y = charts.thin(record.time_s - record.time_s[0], np.asarray(record.column(name)))
    axes.plot(x, y, color=color, label=label, linewidth=0.8, alpha=alpha)  # type: ignore[attr-defined]
