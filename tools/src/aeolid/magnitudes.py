"""Refuse channels whose size no arithmetic in double precision can square: named, with the remedy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError

Array = NDArray[np.float64]
# Covariances of covariances are fourth powers of a channel: (1e70)⁴ · 1e9 samples stays below the largest double,
# 1.8e308, and (1e-70)⁴ above the smallest, 2.2e-308.
LARGEST = 1e70
SMALLEST = 1 / LARGEST


def require_magnitude(source: str, name: str, values: Array, place: Callable[[int], str] | None = None) -> None:
    """Refuse a channel that reaches beyond LARGEST, or that never reaches SMALLEST and is not zero throughout.

    values (N,) in the channel's unit, NaN where missing; place: how the sample of an index is named, default by its
    number from 1. Raises DataError that names file, channel and sample.
    """
    size = np.abs(values)
    known = np.isfinite(size)
    if not known.any():
        return
    top = int(np.argmax(np.where(known, size, -1.0)))
    where = f"sample {top + 1}" if place is None else place(top)
    if size[top] > LARGEST:
        raise DataError(
            f"{source}: channel {name!r} is {values[top]:.3g} at {where}, the square of its square is beyond double "
            "precision; leave the cell empty if the value stands for a missing sample, or give the channel in a larger "
            "unit"
        )
    if 0 < size[top] < SMALLEST:
        raise DataError(
            f"{source}: channel {name!r} is at most {size[top]:.3g}, at {where}; the square of its square is below "
            "double precision; give the channel in a smaller unit"
        )
