"""Take or make the matplotlib axes that a picture is drawn on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aeolid.display import visible_lines
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def one(axes: Axes | None, *, size: tuple[float, float] = (7.0, 3.5)) -> Axes:
    """Return the axes given, or those of a new figure of this size in inches."""
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    made: Axes = plt.subplots(figsize=size, layout="constrained")[1]
    return made


def grid(axes: Any, rows: int, columns: int, *, size: tuple[float, float], **settings: Any) -> Any:
    """Return axes (rows, columns): those given, or new ones; size is in inches, of one of them.

    Raises UsageError where what is given has another shape.
    """
    import matplotlib.pyplot as plt
    import numpy as np

    if axes is None:
        whole = (size[0] * columns, size[1] * rows)
        return plt.subplots(rows, columns, figsize=whole, squeeze=False, layout="constrained", **settings)[1]
    found = np.asarray(axes, dtype=object)
    if found.size != rows * columns:
        raise UsageError(
            f"axes: {rows} x {columns} are needed here, {found.size} given; plt.subplots({rows}, {columns})"
        )
    return found.reshape(rows, columns)


def label(text: str) -> str:
    """Return a text for a picture as it is: names come from files, and dollar signs would make them formulas."""
    return visible_lines(text).replace("$", r"\$")
