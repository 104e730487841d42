"""Put samples that come without a file on a uniform clock, by the rules of those that come from one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, OpenUnit, UsageError
from aeolid.formats.clock import clock_of as in_seconds
from aeolid.formats.clock import is_time_heading
from aeolid.formats.headings import split_heading
from aeolid.formats.table import Table, require_of_size, to_numbers
from aeolid.formats.timebase import Grid, uniform_grid

Array = NDArray[np.float64]


def clock_of(index: Any, source: str, sample_time: float | None) -> Array | None:
    """Return the time (N,) in seconds that an index of pandas holds; None where `sample_time` alone is the clock.

    Dates and spans of time are a clock, and so is an index that is named as one, its unit behind the name as in files.
    One without a name that only counts rows, or whose rows were counted before some were dropped, is none; numbers with
    a fraction are seconds. Raises UsageError where there is no clock or its unit is open, DataError where it is none.
    """
    import pandas as pd

    if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex):
        seconds: Array = np.asarray((index - index[0]).total_seconds() if len(index) else [], dtype=np.float64)
        return seconds
    named = index.name is not None and is_time_heading(str(index.name))
    if sample_time is not None and not named:
        return None
    if index.name is None and (isinstance(index, pd.RangeIndex) or pd.api.types.is_integer_dtype(index.dtype)):
        raise UsageError("sample_time is missing: the index counts rows; give the seconds between them")
    heading = "index" if index.name is None else str(index.name)
    values = to_numbers(source, heading, index.to_numpy())
    if index.name is None:
        return values
    try:
        unit = split_heading(heading)[1]
        return in_seconds(Table(source, (heading,), {heading: values}), heading, unit, None, sample_time).seconds
    except OpenUnit:
        raise UsageError(
            f"{source}: the index {heading!r} does not say its unit; name it with one, for example"
            f" 'time [ms]' (s, ms, us, ns, min, h), or make it a TimedeltaIndex"
        ) from None


def placed(
    values: Mapping[str, Array], time: Array | None, sample_time: float | None, source: str
) -> tuple[Grid, Array]:  # fmt: skip
    """Return the uniform clock and the samples (N, channels) on it; raises UsageError and DataError."""
    if sample_time is not None and not 0 < sample_time < 1e6:
        raise UsageError(f"sample_time = {sample_time!r} is not a time above 0 s")
    table = Table(source, tuple(values), dict(values))
    if table.samples == 0:
        raise DataError(f"{source}: no sample; at least one row is needed")
    for name, column in values.items():
        require_of_size(table, name, column, "set it to NaN if the sample is missing")
        if np.isnan(column).all():
            raise DataError(f"{source}: channel {name!r} holds no value at all; leave it out")
    grid = uniform_grid(table, time, sample_time)
    return grid, grid.place(np.column_stack(list(values.values())))
