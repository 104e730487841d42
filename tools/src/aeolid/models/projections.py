"""Choose the planes that a moving wire frame is drawn in, and where its points are there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.models.wire_frame import REACH, Frame, Motion

Array = NDArray[np.float64]
VIEWS = ((0, 2), (1, 2), (0, 1))  # x–z, y–z, x–y: the axis to the right, and the one upwards
AXES = "xyz"
_FLAT = 1e-3  # of the extent: what is smaller is seen as a point
_STILL = 0.02  # of the largest motion: what is smaller cannot be seen


def views_of(frame: Frame, motions: Sequence[Motion]) -> list[tuple[int, int]]:
    """Return the views in which the frame is more than a point and some of the motions can be seen.

    All of them where that leaves none: a frame of one point.
    """
    span = np.ptp(frame.positions, axis=0)
    moved = np.max([abs(m.displacement).max(axis=0) for m in motions], axis=0, initial=0.0)
    found = [
        view for view in VIEWS
        if span[list(view)].max() > _FLAT * frame.extent and np.max(moved[list(view)]) > _STILL
    ]  # fmt: skip
    return found or list(VIEWS)


def placed(frame: Frame, motion: Motion, phase: float) -> Array:
    """Return the points (P, 3) in m at a phase in rad: x + c Re(u exp(i phase)), drawn REACH of the extent far."""
    moved = np.real(motion.displacement * np.exp(1j * phase))
    out: Array = frame.positions + REACH * frame.extent * moved
    return out
