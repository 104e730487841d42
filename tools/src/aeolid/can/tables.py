"""Lay believed samples out in tables: one for each uninterrupted run, with NaN where something is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.limits import FILL_FREE

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
SPARSE = 20  # rows that a table held in memory may have for each with a value


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Hold one uninterrupted run of a node: index (N,), values (N, channels), lost values that never arrived.

    A value that arrived as NaN was missing in the controller already; it is not counted as lost. rejected: samples
    among them that arrived and were not believed; their values count as lost.
    """

    index: Integers
    values: Array
    lost: int
    rejected: int = 0


@dataclass
class Piece:
    """Hold believed and rejected rows that lie in one run: full index (k,), bits and there (k, channels)."""

    index: Integers
    bits: NDArray[np.uint32]
    there: NDArray[np.bool_]
    believed: NDArray[np.bool_]

    def take(self, chosen: slice) -> Piece:
        """Return the rows of a slice."""
        return Piece(self.index[chosen], self.bits[chosen], self.there[chosen], self.believed[chosen])


def follows(first: int, last: int, rows: int, every: int, filled: int = 0, share: int = SPARSE) -> bool:
    """Tell whether sample `first` goes on with a run that ended with sample `last`.

    rows: with a value so far; filled: without one; share: of these allowed for each of those.
    """
    return 0 <= first - last <= max(every, 1) * max(FILL_FREE + share * rows - filled, 1)


def tables_of(pieces: list[Piece], channels: int, every: int, share: int) -> list[SampleTable]:
    """Return one table for each run; a run ends where the index goes back, or too much would be missing."""
    runs: list[list[Piece]] = []
    last = rows = filled = 0  # of the run so far, rows without those of the piece at hand
    for piece in pieces:
        gaps = np.flatnonzero(np.diff(piece.index) > every)
        start = 0
        for at in [-1, *gaps.tolist()]:
            first, last = int(piece.index[at + 1]), int(piece.index[at]) if at >= 0 else last
            if runs and follows(first, last, rows + at + 1 - start, every, filled, share):
                filled += max((first - last) // every - 1, 0)
                continue
            if at >= 0:
                runs[-1].append(piece.take(slice(start, at + 1)))
            runs.append([])
            start, rows, filled = at + 1, 0, 0
        runs[-1].append(piece.take(slice(start, len(piece.index))))
        rows, last = rows + len(piece.index) - start, int(piece.index[-1])
    return [_table(run, channels, every) for run in runs]


def _table(run: list[Piece], channels: int, every: int) -> SampleTable:
    low = min(int(piece.index[0]) for piece in run)
    high = max(int(piece.index[-1]) for piece in run)
    rows = (high - low) // every + 1
    table = np.full((rows, channels), np.nan)
    arrived = np.zeros((rows, channels), bool)
    for piece in run:
        row, channel = np.nonzero(piece.there)
        at = (piece.index[row] - low) // every
        table[at, channel] = piece.bits[row, channel].view(np.float32).astype(np.float64)
        arrived[at, channel] = True
    lost = int(arrived.size - np.count_nonzero(arrived))
    rejected = sum(int(np.count_nonzero(~piece.believed)) for piece in run)
    return SampleTable(low + every * np.arange(rows, dtype=np.int64), table, lost, rejected)


def cut_before(tables: list[SampleTable], index: int) -> list[SampleTable]:
    """Return what comes before a sample; nothing from there on."""
    result = []
    for table in tables:
        stop = int(np.searchsorted(table.index, index)) if index <= table.index[-1] else len(table.index)
        if stop:
            values = table.values[:stop]
            whole = stop == len(table.index)
            lost = table.lost if whole else int(np.count_nonzero(np.isnan(values)))
            result.append(SampleTable(table.index[:stop], values, lost, table.rejected if whole else 0))
        if stop < len(table.index):
            break
    return result
