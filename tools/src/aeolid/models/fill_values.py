"""Take samples that read a fill value, such as −9999, for missing: what a logger writes where it has no measurement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, NotIdentifiable
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
FILL_VALUES = (-999.0, -9999.0, -99999.0, 999.0, 9999.0, 99999.0, 32767.0, -32768.0, 65535.0, 1e30, -1e30)
SPREADS = 30.0  # robust deviations from the median: no signal of a machine goes there for single samples


def far_off(values: Array, spreads: float = SPREADS) -> Flags:
    """Tell which samples (N,) lie more than so many robust deviations from the median; none that is missing.

    The robust deviation is 1.4826 times the median distance from the median, which is σ of normal samples; where more
    than half of the samples are alike it is the standard deviation.
    """
    good = values[np.isfinite(values)]
    if not len(good):
        return np.zeros(len(values), dtype=bool)
    centre = float(np.median(good))
    size = float(np.median(np.abs(good - centre))) * 1.4826 or float(np.std(good))
    with np.errstate(invalid="ignore"):
        found: Flags = np.abs(values - centre) > spreads * size
    return found


def fill_values_in(values: Array, spreads: float = SPREADS) -> Flags:
    """Tell which samples (N,) read one of FILL_VALUES and lie far off everything else, see `far_off`.

    >>> values = np.append(np.sin(np.arange(50.0)), [-9999.0, 1.0])
    >>> np.flatnonzero(fill_values_in(values)).tolist()
    [50]
    """
    coded: Flags = np.isin(values, FILL_VALUES)
    return coded & far_off(values, spreads) if coded.any() else coded


def without_fill_values(records: Sequence[Record]) -> tuple[list[Record], tuple[str, ...]]:
    """Return recordings whose samples that read a fill value are missing (NaN), and a sentence for each such value.

    A recording without any is returned as it is. A sentence tells recording, channel, value and count.
    """
    out, notes = [], []
    for record in records:
        values = record.values
        for column, channel in enumerate(record.channels):
            found = fill_values_in(record.values[:, column])
            if not found.any():
                continue
            values = values.copy() if values is record.values else values
            values[found, column] = np.nan
            read, counts = np.unique(record.values[found, column], return_counts=True)
            notes += [_say(record, channel.name, float(v), int(n)) for v, n in zip(read, counts, strict=True)]
        out.append(record if values is record.values else replace(record, values=values))
    return out, tuple(notes)


@contextmanager
def told_with(notes: Sequence[str]) -> Iterator[None]:
    """Add these sentences to the text of a refusal: what is missing may be a fill value in the file."""
    try:
        yield
    except (DataError, NotIdentifiable) as error:
        if notes:
            raise type(error)("; ".join([str(error), *notes])) from error
        raise


def _say(record: Record, name: str, value: float, count: int) -> str:
    return f"WARNING: {sentence(record.source, name, value, count)}"


def sentence(source: str, name: str, value: float, count: int) -> str:
    """Return the sentence on the samples of a channel that read a fill value."""
    return (
        f"{source}: {counted(count, 'sample')} of {name} {'reads' if count == 1 else 'read'} {value:g}, which "
        "loggers write where they "
        "have no measurement, far from all others: taken for missing"
    )
