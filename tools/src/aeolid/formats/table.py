"""Hold the columns of one file before they are a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.display import token, without_quotes
from aeolid.errors import DataError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
LARGEST = 1e100  # of a sample: products of three, and their sums, stay below 1e308, where numbers end
Choose = Callable[[tuple[str, ...], str | None], tuple[str, ...]]
"""Given the headings a file holds and the one its format marks as time, say which of them are wanted."""


@dataclass(frozen=True, eq=False)
class Table:
    """Hold named columns of one length; a missing sample is NaN.

    names: every heading of the file, in its order; columns: the wanted ones, (N,) each; units: those the file
    carries itself; time: the column the format itself marks as time; first_line: line below the headings of a text
    file; empty_lines: how many samples stand above empty lines of it, and how many empty ones up to there, rising,
    (M, 2); begins: columns that were dates, now seconds since this instant (ISO 8601); clocks: seconds (n,) of columns
    that have a clock of their own, whose length may differ from the others'.
    """

    source: str
    names: tuple[str, ...]
    columns: dict[str, Array]
    units: dict[str, str] = field(default_factory=dict)
    time: str | None = None
    first_line: int | None = None
    begins: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, Array] = field(default_factory=dict)
    empty_lines: Integers = field(default_factory=lambda: np.empty((0, 2), np.int64))

    @property
    def samples(self) -> int:
        """Return the number of rows N."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def place(self, index: int) -> str:
        """Name the row `index` (from 0) for a message: samples count from 1, lines as an editor shows them."""
        if self.first_line is None:
            return f"sample {index + 1}"
        return place_in_text(index, self.first_line, self.empty_lines)


def require_of_size(table: Table, name: str, values: Array, remedy: str) -> None:
    """Raise DataError where samples (N,) of a channel are infinite or beyond LARGEST; NaN is a sample that is missing.

    remedy: what to do with such a sample, as the end of the sentence.
    """
    infinite = np.flatnonzero(np.isinf(values))
    if len(infinite):
        place = table.place(int(infinite[0]))
        raise DataError(f"{table.source}: channel {name!r} is infinite at {place} ({len(infinite)} in all); {remedy}")
    huge = np.flatnonzero(np.abs(values) > LARGEST)
    if len(huge):
        place, value = table.place(int(huge[0])), float(values[huge[0]])
        raise DataError(
            f"{table.source}: channel {name!r} reads {value:g} at {place} ({len(huge)} in all beyond"
            f" ±{LARGEST:g}): misread, or a simulation that diverged; correct it, {remedy}, or give the"
            " channel in a larger unit"
        )


def place_in_text(index: int, first: int, empty: Integers) -> str:
    """Name the row `index` (from 0) of a text table; first, empty: `first_line` and `empty_lines` of its Table."""
    at = int(np.searchsorted(empty[:, 0], index, side="right"))
    return f"sample {index + 1} (line {first + index + (int(empty[at - 1, 1]) if at else 0)})"


def want_all(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
    """Choose every named column of a file."""
    return tuple(dict.fromkeys(name for name in names if name))


def positions(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return where each wanted name stands first among the names."""
    place = {name: i for i, name in reversed(list(enumerate(names)))}
    return [place[name] for name in wanted]


def require_one_length(source: str | Path, columns: dict[str, Array]) -> None:
    """Refuse columns of different lengths."""
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in lengths.items())
        raise DataError(f"{source}: channels differ in their number of samples ({listed}); resample them to one clock")


def to_numbers(source: str | Path, name: str, values: object, before: int = 0) -> Array:
    """Return values as a float column (N,); text, complex or nested data are refused by sample.

    before: how many samples of the channel come before these.
    """
    array = np.asarray(values)
    if isinstance(values, np.ma.MaskedArray):
        array = np.ma.filled(values.astype(float), np.nan) if values.dtype.kind in "biuf" else np.asarray(values)
    if array.dtype.kind in "biuf":
        return np.ascontiguousarray(array, dtype=np.float64)
    if array.dtype.kind == "c":
        raise DataError(f"{source}: channel {name!r} is complex; give real samples, one channel a signal")
    return _numbers_from_objects(source, name, array, before)


def _numbers_from_objects(source: str | Path, name: str, array: NDArray[np.generic], before: int) -> Array:
    if array.ndim != 1:
        raise DataError(
            f"{source}: channel {name!r} holds {array.ndim}-dimensional data; one number a sample is needed"
        )
    out = np.full(len(array), np.nan)
    for index, value in enumerate(array.tolist()):
        if value is None or (isinstance(value, str) and not value.strip()):
            continue
        if isinstance(value, str | bytes) and not is_number_text(value):
            raise text_error(source, name, f"sample {before + index + 1}", value)
        try:
            out[index] = float(value)
        except (TypeError, ValueError, OverflowError):
            raise text_error(source, name, f"sample {before + index + 1}", value) from None
    return out


def is_number_text(text: str | bytes) -> bool:
    """Tell whether a text is a number. Python alone would also take 1_000 and the figures of other scripts for one."""
    written = text.decode("latin-1") if isinstance(text, bytes) else text
    try:
        float(written)
    except ValueError:
        return False
    return written.isascii() and "_" not in written


def text_error(source: str | Path, name: str, place: str, value: object) -> DataError:
    """Build the refusal of a cell that is not a number."""
    shown = str(value) if len(str(value)) <= 40 else str(value)[:37] + "..."
    return DataError(
        f"{source}: channel {name!r}, {place}: {shown!r} is not a number; correct the cell or leave it empty"
    )


def unreadable(path: str | Path, kind: str, error: Exception) -> DataError:
    """Build the refusal of a file its own reader cannot take."""
    cause = token(without_quotes(" ".join(str(error).split())), 160) or type(error).__name__
    return DataError(f"{path}: not readable as {kind} ({cause}); check that the copy is complete and the suffix right")


def listed(names: Sequence[str], most: int = 12) -> str:
    """Join names for a message, the first `most` of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(token(name) for name in names[:most]) + more
