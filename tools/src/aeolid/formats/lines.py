"""Count the lines of a text table, and tell the empty ones, which hold no sample.

A line ends where Arrow ends it: at CR LF, CR or LF, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import MIB, MOST_LINE
from aeolid.formats.table import Integers
from aeolid.formats.unpacking import open_text

_PIECE = 1 << 17  # bytes counted together: they stay in the processor's cache
_BLOCK = 4 * MIB  # bytes split together: a line is shorter
_LF, _CR = 10, 13


def count_lines(path: Path) -> int:
    """Return the number of lines of a text file; reads it to its end, and raises DataError as `open_text` does."""
    lines, last = 0, _LF
    with open_text(path) as handle:
        while block := handle.read(_PIECE):
            content = np.frombuffer(block, np.uint8)
            ends = content == _LF
            lines += int(np.count_nonzero(ends)) - int(last == _CR and bool(ends[0]))
            if b"\r" in block:
                returns = content == _CR
                lines += int(np.count_nonzero(returns)) - int(np.count_nonzero(returns[:-1] & ends[1:]))
            last = block[-1]
    return lines + int(last not in (_LF, _CR))


def below(path: Path, skip: int) -> tuple[int, Integers]:
    """Look at the lines below the first `skip` ones.

    Returns how many of them are not empty, and where those stand that are: (M, 2), rising, how many lines that are not
    empty stand above some empty ones, and how many empty ones up to there.
    """
    filled, empty = 0, 0
    found = [np.empty((0, 2), np.int64)]
    with open_text(path) as handle:
        for block in _whole_lines(path, handle):
            lengths = np.fromiter(map(len, block.splitlines()), np.int64)
            skip, lengths = max(0, skip - len(lengths)), lengths[skip:]
            above = filled + np.cumsum(lengths > 0)
            rows, counts = np.unique(above[lengths == 0], return_counts=True)
            found.append(np.column_stack([rows, empty + np.cumsum(counts)]))
            filled += int(np.count_nonzero(lengths))
            empty += int(counts.sum())
    return filled, np.concatenate(found)


def numbered(path: Path, skip: int) -> Iterator[tuple[int, bytes]]:
    """Yield the number, from 1, and the content of each line below the first `skip` ones.

    Raises DataError at one longer than MOST_LINE.
    """
    number = 0
    with open_text(path) as handle:
        for block in _whole_lines(path, handle):
            for line in block.splitlines():
                number += 1
                if len(line) > MOST_LINE:
                    raise _too_long(path, number)
                if number > skip:
                    yield number, line


def _whole_lines(path: Path, handle: BinaryIO) -> Iterator[bytes]:
    """Yield a file in blocks that end where a line does."""
    rest, number = b"", 1
    while block := handle.read(_BLOCK):
        block = rest + block
        cut = max(block.rfind(b"\n"), block.rfind(b"\r", 0, len(block) - 1)) + 1  # LF may follow a CR at the end
        if len(block) - cut > _BLOCK:
            raise _too_long(path, number + len(block[:cut].splitlines()))
        rest, block = block[cut:], block[:cut]
        if block:
            yield block
            number += len(block.splitlines())
    if rest:
        yield rest


def _too_long(path: Path, number: int) -> DataError:
    return DataError(f"{path}: line {number} is longer than {MOST_LINE // MIB} MiB; this is not a text table")
