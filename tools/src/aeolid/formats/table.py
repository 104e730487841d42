"""Hold the columns of one file before they are a recording, and guard against what does not fit in memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.display import token
from aeolid.errors import DataError

Array = NDArray[np.float64]
Choose = Callable[[tuple[str, ...], str | None], tuple[str, ...]]
"""Given the headings a file holds and the one its format marks as time, say which of them are wanted."""


@dataclass(frozen=True, eq=False)
class Table:
    """Hold named columns of one length; a missing sample is NaN.

    names: every heading of the file, in its order; columns: the wanted ones, (N,) each; units: those the file
    carries itself; time: the column the format itself marks as time; first_line: line of sample 1 in a text file.
    """

    source: str
    names: tuple[str, ...]
    columns: dict[str, Array]
    units: dict[str, str] = field(default_factory=dict)
    time: str | None = None
    first_line: int | None = None

    @property
    def samples(self) -> int:
        """Return the number of rows N."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def place(self, index: int) -> str:
        """Name the row `index` (from 0) for a message: samples count from 1, lines as an editor shows them."""
        line = "" if self.first_line is None else f" (line {self.first_line + index})"
        return f"sample {index + 1}{line}"


def want_all(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
    """Choose every named column of a file."""
    return tuple(name for name in names if name)


def memory_limit() -> int:
    """Return how many bytes one table may take: half the machine's memory."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
    except (ValueError, OSError, AttributeError):
        return 4 << 30


def guard_size(source: str | Path, needed: int) -> None:
    """Refuse a table of `needed` bytes when it does not fit; the sentence says what to do."""
    if needed > memory_limit():
        raise DataError(
            f"{source}: the wanted channels take {needed / 2**30:.1f} GiB, this machine can hold"
            f" {memory_limit() / 2**30:.1f} GiB; split the recording into several files and give them together"
        )


def require_one_length(source: str | Path, columns: dict[str, Array]) -> None:
    """Refuse columns of different lengths."""
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in lengths.items())
        raise DataError(f"{source}: channels differ in their number of samples ({listed}); resample them to one clock")


def to_numbers(source: str | Path, name: str, values: object) -> Array:
    """Return values as a float column (N,); text, complex or nested data are refused by sample."""
    array = np.asarray(values)
    if isinstance(values, np.ma.MaskedArray):
        array = np.ma.filled(values.astype(float), np.nan) if values.dtype.kind in "biuf" else np.asarray(values)
    if array.dtype.kind in "biuf":
        return np.ascontiguousarray(array, dtype=np.float64)
    if array.dtype.kind == "c":
        raise DataError(f"{source}: channel {name!r} is complex; give real samples, one channel a signal")
    return _numbers_from_objects(source, name, array)


def _numbers_from_objects(source: str | Path, name: str, array: NDArray[np.generic]) -> Array:
    out = np.full(len(array), np.nan)
    for index, value in enumerate(array.tolist()):
        if value is None or value == "":
            continue
        try:
            out[index] = float(value)
        except (TypeError, ValueError, OverflowError):
            raise text_error(source, name, f"sample {index + 1}", value) from None
    return out


def text_error(source: str | Path, name: str, place: str, value: object) -> DataError:
    """Build the refusal of a cell that is not a number."""
    shown = str(value) if len(str(value)) <= 40 else str(value)[:37] + "..."
    return DataError(
        f"{source}: channel {name!r}, {place}: {shown!r} is not a number; correct the cell or leave it empty"
    )


def listed(names: Sequence[str], most: int = 12) -> str:
    """Join names for a message, the first `most` of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(token(name) for name in names[:most]) + more
