"""Let a reader choose a stretch of lines over time: the lines' samples in the page, and the script that draws them.

The still picture stays in the page: it is what is printed, and what is seen where scripts do not run. The page's policy
names the script by its hash, so that no other one runs.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.display import visible_lines
from aeolid.report.markup import Html, figure
from aeolid.report.script import MARK

Array = NDArray[np.float64]
MOST_SAMPLES = 400_000  # of all lines of a page that has other pictures, too: some 1.1 MB
MOST_ALONE = 900_000  # of a page that has nothing else: some 2.4 MB
_MISSING = 65535  # the code of a missing sample; the others count steps from the line's least value
_EVEN = 1e-6  # of a step: what times written as decimals may differ from an even clock by, relative to the last one


@dataclass(frozen=True, eq=False)
class Line:
    """Hold one line: its name, what it is drawn like ("ink", "before", "after") and its samples (N,)."""

    name: str
    kind: str
    values: Array


@dataclass(frozen=True, eq=False)
class Panel:
    """Hold lines that share an axis: what is written above it, with the unit, and its height in px."""

    title: str
    lines: tuple[Line, ...]
    height: int = 180


def zoomed(
    drawing: Html, caption: str, time_s: Array, panels: Sequence[Panel], view: tuple[int, int], most: int
) -> Html:
    """Return a figure of lines over time that a script lets be looked into.

    drawing: the still picture; time_s (N,) rising, in s; view: the samples shown at first, from and to before; most:
    samples of each line at the most, those around the view. Samples are kept with 16 bits of each line's range. Fewer
    than four samples stay a still picture.
    """
    a, b = _kept(len(time_s), view, most)
    if b - a < 4:
        return figure(drawing, caption)
    first, last = max(view[0], a), min(view[1], b) - 1
    facts = {
        "title": visible_lines(caption),
        "clock": _clock(time_s[a:b]),
        "view": [float(time_s[first]), float(time_s[last])],
        "panels": [_panel(p, a, b) for p in panels],
    }
    text = json.dumps(facts, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return Html(figure(drawing, caption, data_lines=text) + MARK)


def _panel(panel: Panel, a: int, b: int) -> dict[str, Any]:
    lines = [_line(x, a, b) for x in panel.lines]
    return {"title": visible_lines(panel.title), "height": panel.height, "lines": lines}


def _kept(count: int, view: tuple[int, int], most: int) -> tuple[int, int]:
    """Return from and to of at most so many samples around those shown at first."""
    if count <= most:
        return 0, count
    start = int(np.clip((view[0] + view[1] - most) // 2, 0, count - most))
    return start, start + most


def _clock(time_s: Array) -> dict[str, Any]:
    step = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    even = time_s[0] + step * np.arange(len(time_s))
    if np.max(np.abs(even - time_s)) <= 1e-3 * step + _EVEN * step * len(time_s):
        return {"start": float(time_s[0]), "step": step, "count": len(time_s)}
    return {"data": base64.b64encode(np.asarray(time_s, dtype="<f8").tobytes()).decode()}


def _line(line: Line, a: int, b: int) -> dict[str, Any]:
    values = np.asarray(line.values[a:b], dtype=float)
    known = np.isfinite(values)
    low, high = (float(f(values[known])) if known.any() else 0.0 for f in (np.min, np.max))
    step = (high - low) / (_MISSING - 1) or 1.0
    codes = np.full(len(values), _MISSING, dtype="<u2")
    if np.isfinite(step):
        codes[known] = np.rint((values[known] - low) / step)
    else:  # a range beyond what numbers hold is no line
        step = 1.0
    data = base64.b64encode(codes.tobytes()).decode()
    return {"name": visible_lines(line.name), "kind": line.kind, "low": low, "step": step, "data": data}
