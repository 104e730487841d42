"""Write what a command draws as a picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".svg", ".png", ".pdf")


def write_picture(path: Path, size: tuple[float, float], draw: Callable[[Figure], object]) -> None:
    """Write a picture of a size in inches, whole or not at all; draw: puts it on the figure it is given."""
    import io

    from matplotlib.figure import Figure

    from aeolid import output

    figure = Figure(figsize=size, layout="constrained")
    draw(figure)
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix.lower().lstrip("."), dpi=150)
    with output.replacing(path) as handle:
        handle.write(drawn.getvalue())
