"""Read MDF4 measurement files."""

from __future__ import annotations

import gc
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.binary import unreadable
from aeolid.formats.table import Array, Choose, Table, guard_size, listed, to_numbers

CLOCK = "time_s"
_SAME_INSTANT = 1e-9  # seconds: channels of one clock carry the same stamps


def read_mdf(path: Path, choose: Choose) -> Table:
    """Read the chosen channels of an MDF file; they must share one clock, which becomes the column time_s."""
    refusal: DataError
    with quiet():
        try:
            with _opened(path) as file:
                return _read(path, file, choose)
        except DataError as error:
            refusal = DataError(str(error))
        except Exception as error:  # the reader raises whatever its parser meets in a damaged file
            refusal = unreadable(path, "MDF", error)
    raise refusal


def holds_frames(path: Path) -> bool:
    """Tell whether an MDF file logs raw CAN frames instead of measured channels."""
    with quiet():
        try:
            with _opened(path) as file:
                return any(name.startswith("CAN_DataFrame") for name in file.channels_db)
        except Exception:  # a damaged file is named by read_mdf
            return False


def _opened(path: Path) -> Any:
    from asammdf import MDF

    with open(path, "rb") as handle:
        if handle.read(8).rstrip() not in (b"MDF", b"UnFinMF"):
            raise unreadable(path, "MDF", ValueError("the file does not start with MDF"))
    return MDF(path)


@contextmanager
def quiet() -> Iterator[None]:
    """Silence the reader's warnings, and its finaliser, which fails aloud on an object that was never complete."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda unraisable: None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        gc.collect()
        sys.unraisablehook = hook


def _read(path: Path, file: Any, choose: Choose) -> Table:
    clocks = {file.groups[g].channels[c].name for g, c in file.masters_db.items()}
    names = (CLOCK, *(name for name in file.channels_db if name not in clocks))
    wanted = choose(names, CLOCK)
    signals = []
    for name in wanted:
        if name == CLOCK:
            continue
        if len(file.channels_db[name]) > 1:
            raise DataError(f"{path}: {len(file.channels_db[name])} channels are called {name!r}; rename all but one")
        signals.append(file.get(name))
        guard_size(path, 8 * len(signals) * len(signals[0].samples))
    if not signals:
        raise DataError(f"{path}: no measured channel; it holds {listed(names)}")
    time = np.asarray(signals[0].timestamps, dtype=float)
    columns = {CLOCK: time} if CLOCK in wanted else {}
    for signal in signals:
        columns[signal.name] = _samples(path, signal, signals[0].name, time)
    units = {CLOCK: "s"} | {s.name: str(s.unit) for s in signals if s.unit}
    return Table(str(path), names, columns, units, CLOCK)


def _samples(path: Path, signal: Any, first: str, time: Array) -> Array:
    stamps = np.asarray(signal.timestamps, dtype=float)
    if len(stamps) != len(time) or (len(time) and np.max(np.abs(stamps - time)) > _SAME_INSTANT):
        raise DataError(
            f"{path}: channels {first!r} ({len(time)} samples) and {signal.name!r} ({len(stamps)} samples) have"
            f" different clocks; export them resampled to one clock"
        )
    values = to_numbers(path, signal.name, signal.samples)
    if signal.invalidation_bits is not None:
        values = np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, values)
    return values
