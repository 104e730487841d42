"""Draw mode shapes on the wire frame of the sensors on matplotlib axes: a row a view, a column a mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from aeolid.api import axes as places
from aeolid.errors import UsageError
from aeolid.geometry import Geometry
from aeolid.models.projections import AXES, placed, views_of
from aeolid.models.wire_frame import DISPLACEMENT, REACH, Frame, Motion, frame_of, mode_motions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Facts = dict[str, Any]
_IN_PICTURE = 6  # modes beside each other in a picture of a page's width
_VIEW_HEIGHT = 2.6  # inches
_STATES = (  # colour, style, width and phase in half turns; None at rest
    ("0.6", "-", 1.0, None), ("#d55e00", "--", 1.0, 1.0), ("#0072b2", "-", 1.6, 0.0),
)  # fmt: skip


def _moving(facts: Facts, modes: Sequence[int] | None) -> tuple[Frame, list[tuple[Facts, Motion]]]:
    if not facts.get("geometry"):
        raise UsageError("no channel has a position and a direction; write them into the roles file")
    listed = facts["modes"]
    wanted = range(len(listed)) if modes is None else modes
    wrong = next((i for i in wanted if not -len(listed) <= i < len(listed)), None)
    if wrong is not None:
        raise UsageError(f"modes: there is no mode {wrong}; they are 0 to {len(listed) - 1}")
    frame = frame_of(Geometry.from_json(facts["geometry"]))
    found = [(listed[i], motion) for i in wanted for motion in mode_motions(frame, listed[i])]
    if not found:
        raise UsageError("no mode has a shape on sensors with a position")
    return frame, found


def draw_frames(facts: Facts, axes: Any, modes: Sequence[int] | None = None, most: int | None = None) -> Any:
    """Draw modes of JSON facts at rest (grey), at their largest real part (blue) and half a period later (dashed).

    axes: (views, modes) of them, None for a new figure; most: how many are drawn, None for all.
    Raises UsageError where no sensor has a position, or no mode has a shape there.
    """
    frame, found = _moving(facts, modes)
    found = found[:most]
    views = views_of(frame, [motion for _, motion in found])
    grid = places.grid(axes, len(views), len(found), size=(2.4, 2.8))
    for column, (mode, motion) in zip(grid.T, found, strict=True):
        column[0].set_title(places.label(_title(mode, motion)), fontsize="small")
        for place, view in zip(column, views, strict=True):
            _draw(place, frame, motion, view)
    return grid


def _title(mode: Facts, motion: Motion) -> str:
    what = "" if motion.unit == DISPLACEMENT else f", {motion.unit or 'no unit'}"
    lines = [f"{mode['frequency_hz']:.4g} Hz{what}", f"collinearity {100 * motion.collinearity:.3g} %"]
    return "\n".join([mode["name"], *lines] if mode.get("name") else lines)


def _draw(place: Any, frame: Frame, motion: Motion, view: tuple[int, int]) -> None:
    a, b = view
    dots = sorted({point for _, _, point, _ in frame.sensors})
    for colour, style, width, turn in _STATES:
        points = frame.positions if turn is None else placed(frame, motion, turn * 3.141592653589793)
        x, y = points[:, a], points[:, b]
        if len(frame.edges):
            place.plot(x[frame.edges.T], y[frame.edges.T], style, color=colour, linewidth=width)
        place.plot(x[dots], y[dots], "o", color=colour, markersize=2.0 if turn is None else 3.5)
    reach = 1.25 * REACH * frame.extent
    for axis, limit in ((a, place.set_xlim), (b, place.set_ylim)):
        limit(frame.positions[:, axis].min() - reach, frame.positions[:, axis].max() + reach)
    place.set_aspect("equal")
    place.locator_params(nbins=4)
    place.tick_params(labelsize="x-small")
    place.set_xlabel(f"{AXES[a]} (m)", fontsize="small")
    place.set_ylabel(f"{AXES[b]} (m)", fontsize="small")


def _room(facts: Facts) -> tuple[int, int]:
    """Return how many views and modes a picture shows; zeros where nothing is drawn on a geometry."""
    if not facts.get("geometry"):
        return 0, 0
    frame = frame_of(Geometry.from_json(facts["geometry"]))
    found = [motion for mode in facts["modes"] for motion in mode_motions(frame, mode)][:_IN_PICTURE]
    return (len(views_of(frame, found)), len(found)) if found else (0, 0)


def height_of(facts: Facts) -> float:
    """Return the height in inches that the modes on the geometry take below a picture's diagram; 0 without one."""
    return _VIEW_HEIGHT * _room(facts)[0]


def draw_below(facts: Facts, figure: Figure, diagram: Callable[[Any], object]) -> None:
    """Draw a diagram on a figure, and below it the first modes on the geometry where there is one."""
    views, count = _room(facts)
    if not views:
        diagram(figure)
        return
    lower = _VIEW_HEIGHT * views
    parts: Any = figure.subfigures(2, 1, height_ratios=[figure.get_figheight() - lower, lower])
    diagram(parts[0])
    draw_frames(facts, parts[1].subplots(views, count, squeeze=False), most=count)
