"""Put samples that come without a file on a uniform clock, by the rules of those that come from one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError
from aeolid.formats.table import Table, to_numbers
from aeolid.formats.timebase import Grid, uniform_grid

Array = NDArray[np.float64]


def clock_of(index: Any, source: str) -> Array:
    """Return the time (N,) in seconds that an index of pandas holds.

    Raises UsageError where it only counts rows, DataError where it is no time.
    """
    import pandas as pd

    if isinstance(index, pd.RangeIndex):
        raise UsageError("sample_time is missing: the index counts rows; give the seconds between them")
    if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
        seconds: Array = np.asarray((index - index[0]).total_seconds(), dtype=np.float64)
        return seconds
    return to_numbers(source, "index", index.to_numpy())


def placed(
    values: Mapping[str, Array], time: Array | None, sample_time: float | None, source: str
) -> tuple[Grid, Array]:  # fmt: skip
    """Return the uniform clock and the samples (N, channels) on it; raises UsageError and DataError."""
    if sample_time is not None and not (isinstance(sample_time, int | float) and 0 < sample_time < 1e6):
        raise UsageError(f"sample_time = {sample_time!r} is not a time above 0 s")
    table = Table(source, tuple(values), dict(values))
    if table.samples == 0:
        raise DataError(f"{source}: no sample; at least one row is needed")
    for name, column in values.items():
        infinite = np.flatnonzero(np.isinf(column))
        if len(infinite):
            raise DataError(
                f"{source}: channel {name!r} is infinite at {table.place(int(infinite[0]))}"
                f" ({len(infinite)} in all); set it to NaN if the sample is missing"
            )
        if np.isnan(column).all():
            raise DataError(f"{source}: channel {name!r} holds no value at all; leave it out")
    grid = uniform_grid(table, time, sample_time)
    return grid, grid.place(np.column_stack(list(values.values())))
