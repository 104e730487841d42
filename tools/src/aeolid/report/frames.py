"""Draw mode shapes on the wire frame of the sensors, moving in the page without a script.

Each state of a frame is one path, and the moving one is animated by SVG itself through the states of a period. Printed,
and where motion is not wanted, the still picture stands: at rest, at the largest real part, and half a period later.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.geometry import Geometry
from aeolid.models.projections import AXES, placed, views_of
from aeolid.models.wire_frame import DISPLACEMENT, REACH, Frame, Motion, frame_of, mode_motions
from aeolid.report.markup import Html, figure, folded, join, section, table, tag
from aeolid.report.numbers import number, percent
from aeolid.wording import counted

Facts = dict[str, Any]
Array = NDArray[np.float64]
_MOST = 12  # modes that are drawn
_MOST_EDGES = 40_000  # of all pictures of a page in one state: some 3 MB
_MOST_MOVING = 2_500  # edges that move: 16 states of each, some 1 MB
_STATES, _SECONDS = 16, 2.4  # of a period as it is shown
_WIDTH, _HIGHEST, _GAP, _FOOT = 520, 320, 30, 30  # of a drawing in its units, its views, between and below them
_ROOM = 0.03  # of the extent, around all
_RULES = """
.frame path { fill: none; stroke-linecap: round; stroke-linejoin: round; }
.frame .line { stroke-width: 2; } .frame .dot { stroke-width: 7; } .frame .fixed { stroke-width: 7; }
.frame .rest path { stroke: var(--grey); } .frame .rest .line { stroke-width: 1.3; }
.frame .rest .dot { stroke-width: 4; } .frame .back path { stroke: var(--before); opacity: .45; }
.frame .front path, .frame .moving path { stroke: var(--after); } .frame .back .line { stroke-dasharray: 5 4; }
.frame .arrow { stroke: var(--before); stroke-width: 1.6; } .frame text { fill: var(--ink); font-size: 12px; }
.frame .axis { stroke: var(--soft); } .frame .moving { display: none; }
@media screen and (prefers-reduced-motion: no-preference) {
  #frames-move:checked ~ .pair .moving { display: inline; }
  #frames-move:checked ~ .pair .moves .front { opacity: .3; }
  #frames-move:checked ~ .pair .moves .back { opacity: .7; }
}
@media print { #frames-move, #frames-move + label { display: none; } }
"""


def frames_part(facts: Facts) -> Html:
    """Build the section of the modes on the geometry of JSON facts ("geometry", "modes"); empty where there is none."""
    if not facts.get("geometry"):
        return Html("")
    frame = frame_of(Geometry.from_json(facts["geometry"]))
    modes = [(m, motion) for m in facts["modes"] for motion in mode_motions(frame, m)]
    if not modes:
        return Html("")
    window = _Window(frame, [motion for _, motion in modes])
    each = max(len(window.views) * (len(frame.edges) + len(frame.positions)), 1)
    shown = modes[: max(min(_MOST, _MOST_EDGES // each), 1)]
    moves = each * len(shown) <= _MOST_MOVING
    drawings = [tag("div", _geometry(frame, window)), *(tag("div", _mode(frame, window, *one, moves)) for one in shown)]
    switch = [Html('<input type="checkbox" id="frames-move" checked>'), tag("label", " moving", for_="frames-move")]
    notes = [_EXPLAINED, *_notes(frame, modes, len(shown))]
    if not moves:
        notes.append("The frame has too many lines to be shown moving in a page of a size that can be sent.")
    return section(
        "Modes on the structure", tag("style", Html(_RULES)), *(switch if moves else []),
        tag("div", join(drawings), class_="pair"), folded("Sensors", _table(frame)),
        *(tag("p", note, class_="soft") for note in notes),
    )  # fmt: skip


_EXPLAINED = (
    f"Grey: at rest. The point that moves most is drawn {percent(REACH, 2)} of the structure's extent from its place; "
    "blue is the phase at which the shape is largest, dashed orange half a period later. Phase collinearity is 100 % "
    "and the mean phase deviation 0° where all sensors move in phase or against it; a wave that travels has 0 % and "
    "some 45°. Points without a sensor are interpolated along the lines that pass them, or stay; a direction in which "
    "a point has no sensor is drawn at rest."
)


def _notes(frame: Frame, modes: Sequence[tuple[Facts, Motion]], shown: int) -> list[str]:
    notes = []
    if any(m.derived for _, m in modes):
        notes.append(
            "Velocities are divided by s and accelerations by s², s the pole of the mode, so that all sensors show "
            "displacements."
        )
    others = sorted({m.unit for _, m in modes} - {DISPLACEMENT})
    if others:
        notes.append(
            f"What is recorded in {', '.join(u or 'no unit' for u in others)} is no displacement: it is drawn by "
            "itself, each amplitude along its sensor's direction."
        )
    if len(modes) > shown:
        notes.append(f"{len(modes) - shown} more are not drawn; all shapes are in the table and the JSON.")
    return notes


def told_of(mode: Facts, motion: Motion) -> str:
    """Return the sentence below a drawing: which mode, in what, and how complex its shape is."""
    what = "" if motion.unit == DISPLACEMENT else f", in {motion.unit or 'no unit'}"
    name = str(mode.get("name") or "")
    title = f"{name[:1].upper()}{name[1:]}," if name else "Mode at"
    return (
        f"{title} {number(mode['frequency_hz'], 4)} Hz{what}: phase collinearity "
        f"{percent(motion.collinearity, 3)}, mean phase deviation {number(round(motion.phase_deviation_deg, 2), 2)}°."
    )


class _Window:
    """Place the views of a frame beside each other in one drawing, all to one scale."""

    def __init__(self, frame: Frame, motions: Sequence[Motion]) -> None:
        self.views = views = views_of(frame, motions)
        sizes = [abs(m.displacement) for m in motions] + [abs(np.array([d for *_, d in frame.sensors]))]
        reach = frame.extent * (_ROOM + REACH * np.max(np.vstack(sizes), axis=0))  # of shapes and of arrows
        low, span = frame.positions.min(axis=0) - reach, np.ptp(frame.positions, axis=0) + 2 * reach
        wide, high = sum(span[a] for a, _ in views), max(span[b] for _, b in views)
        self.scale = float(min((_WIDTH - _GAP * (len(views) + 1)) / wide, _HIGHEST / high))
        self.low, self.span = low, span
        gap = (_WIDTH - self.scale * wide) / (len(views) + 1)
        self.lefts, left = [], gap
        for a, _ in views:
            self.lefts.append(left)
            left += gap + float(span[a]) * self.scale
        self.bottom = float(high) * self.scale
        self.height = self.bottom + _FOOT

    def flat(self, points: Array, i: int) -> Array:
        """Return points (P, 3) as (P, 2) in the drawing's units in view i."""
        a, b = self.views[i]
        x = self.lefts[i] + self.scale * (points[:, a] - self.low[a])
        y = self.bottom - self.scale * (points[:, b] - self.low[b])
        return np.column_stack([x, y])

    def names(self) -> list[Html]:
        """Return which axes each view has: the one to the right and the one upwards."""
        out = []
        for i, (a, b) in enumerate(self.views):
            middle = self.lefts[i] + self.scale * float(self.span[a]) / 2
            words = f"{AXES[a]} \N{RIGHTWARDS ARROW}\u2002{AXES[b]} \N{UPWARDS ARROW}"
            out.append(Html(f'<text x="{middle:.1f}" y="{self.height - 8:.1f}" text-anchor="middle">{words}</text>'))
        return out


def _paths(frame: Frame, flats: Sequence[Array], moving: Sequence[Sequence[Array]] | None = None) -> list[Html]:
    """Return the lines and the sensors' dots of one state, a path each; moving: of each view the states of a period."""
    dots = sorted({point for _, _, point, _ in frame.sensors})
    parts = []
    for kind in ("line", "dot"):
        still = "".join(_path(frame, flat, kind, dots) for flat in flats)
        if not still:
            continue
        inner = ""
        if moving is not None:
            states = ["".join(_path(frame, view[k], kind, dots) for view in moving) for k in range(_STATES)]
            values = ";".join([*states, states[0]])
            inner = f'<animate attributeName="d" dur="{_SECONDS}s" repeatCount="indefinite" values="{values}"/>'
        parts.append(Html(f'<path class="{kind}" d="{still}">{inner}</path>'))
    return parts


def _path(frame: Frame, flat: Array, kind: str, dots: Sequence[int]) -> str:
    if kind == "dot":
        return "".join(f"M{flat[i, 0]:.1f} {flat[i, 1]:.1f}h0" for i in dots)
    return "".join(f"M{flat[a, 0]:.1f} {flat[a, 1]:.1f}L{flat[b, 0]:.1f} {flat[b, 1]:.1f}" for a, b in frame.edges)


def _drawing(window: _Window, parts: Sequence[object], moves: bool, title: str) -> Html:
    head = f'xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {window.height:.0f}" role="img"'
    inside = join([tag("title", title), *parts, *window.names()])
    return Html(f'<svg class="frame{" moves" if moves else ""}" {head}>{inside}</svg>')


def _state(window: _Window, points: Array) -> list[Array]:
    return [window.flat(points, i) for i in range(len(window.views))]


def _mode(frame: Frame, window: _Window, mode: Facts, motion: Motion, moves: bool) -> Html:
    text = told_of(mode, motion)
    rest = _state(window, frame.positions)
    front, back = (_state(window, placed(frame, motion, phase)) for phase in (0.0, np.pi))
    parts = [
        tag("g", *_paths(frame, rest), class_="rest"), tag("g", *_paths(frame, back), class_="back"),
        tag("g", *_paths(frame, front), class_="front"),
    ]  # fmt: skip
    if moves:
        steps = [placed(frame, motion, 2 * np.pi * k / _STATES) for k in range(_STATES)]
        moving = [[window.flat(points, i) for points in steps] for i in range(len(window.views))]
        parts.append(tag("g", *_paths(frame, front, moving), class_="moving"))
    return figure(_drawing(window, parts, moves, text), text)


def _geometry(frame: Frame, window: _Window) -> Html:
    """Draw the frame at rest with an arrow along each sensor's direction, which says its name when pointed at."""
    parts: list[object] = [tag("g", *_paths(frame, _state(window, frame.positions)), class_="rest")]
    for name, unit, point, direction in frame.sensors:
        ends = frame.positions[point] + REACH * frame.extent * np.array([[0.0] * 3, direction])
        arrows = "".join(_arrow(window.flat(ends, i)) for i in range(len(window.views)))
        if arrows:
            parts.append(tag("g", tag("title", f"{name} ({unit or '1'})"), Html(f'<path class="arrow" d="{arrows}"/>')))
    text = (
        f"{counted(len(frame.sensors), 'sensor')} and the directions they measure along; point at an arrow "
        "for its name."
    )
    return figure(_drawing(window, parts, False, text), text)


def _table(frame: Frame) -> Html:
    rows = [
        [name, unit or "1", *(number(v, 4) for v in frame.positions[point]), *(number(v, 3) for v in direction)]
        for name, unit, point, direction in frame.sensors
    ]
    heads = ["sensor", "unit", *(f"#{a} (m)" for a in AXES), *(f"#along {a}" for a in AXES)]
    return table(heads, rows)


def _arrow(ends: Array) -> str:
    """Return an arrow from one point to another as a path; empty where it is seen from its end."""
    way = ends[1] - ends[0]
    length = float(np.hypot(*way))
    if length < 4:
        return ""
    along, aside = 5 * way / length, 3 * np.array([-way[1], way[0]]) / length
    tip, left, right = ends[1], ends[1] - along + aside, ends[1] - along - aside
    (x0, y0), (x1, y1) = ends[0], tip
    return (
        f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}M{left[0]:.1f} {left[1]:.1f}L{x1:.1f} {y1:.1f}L{right[0]:.1f} "
        f"{right[1]:.1f}"
    )
