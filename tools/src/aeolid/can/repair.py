"""Restore lost parameters of a snapshot from its repair frames: linear equations over GF(2) (stream.h)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

GROUP_MAX = 256
Mask = NDArray[np.bool_]
Words = NDArray[np.uint32]


def choose_stride(count: int) -> int:
    """Return the stride nearest to 0.618 count that is coprime with it and keeps a burst of 16 apart (spread.c)."""
    centre, fallback = (count * 618 + 500) // 1000, 0
    for i in range(33):
        stride = centre + (i + 1) // 2 if i % 2 else centre - (i + 1) // 2
        if stride < 1 or (stride >= count > 1) or math.gcd(count, stride) != 1:
            continue
        fallback = fallback or stride
        if all(min(k * stride % count, -k * stride % count) * 40 >= count for k in range(1, 16)):
            return stride
    return fallback or 1


@lru_cache(maxsize=4)
def group_members(count: int) -> tuple[NDArray[np.int64], ...]:
    """List the blocks (indices) of each group in the order of their bits: positions g, g + G, g + 2 G …"""
    order = np.arange(count, dtype=np.int64) * choose_stride(count) % count
    groups = -(-count // GROUP_MAX)
    return tuple(order[g::groups] for g in range(groups))


def repair_sets(numbers: NDArray[np.int64], size: int) -> Mask:
    """Return which of `size` members each repair number (k,) combines, (k, size): aeo_frame_repair_set."""
    words = -(-size // 32)
    with np.errstate(over="ignore"):
        x = (numbers.astype(np.uint32) << np.uint32(16))[:, None] + np.arange(words, dtype=np.uint32)[None, :]
        x = x + np.uint32(0x9E3779B9)
        x ^= x >> np.uint32(16)
        x *= np.uint32(0x85EBCA6B)
        x ^= x >> np.uint32(13)
        x *= np.uint32(0xC2B2AE35)
        x ^= x >> np.uint32(16)
    bits = np.unpackbits(x.astype("<u4").view(np.uint8), axis=1, bitorder="little")
    return bits[:, :size].astype(bool)


class Repairs:
    """Hold repair frames by their number: w words each, in one table."""

    def __init__(self, most: int, width: int) -> None:
        """Prepare. most: numbers from here on do not exist; width: words of a frame."""
        self._most, self._width = most, width
        self._words = np.zeros((0, width), np.uint32)
        self._have = np.zeros(0, bool)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return self._words.nbytes + self._have.nbytes

    def put(self, numbers: NDArray[np.int64], words: Words) -> None:
        """Take frames: numbers (k,) below the most there are, words (k, w); of equal numbers the last."""
        if not len(numbers):
            return
        if not len(self._have):
            self._words, self._have = np.zeros((self._most, self._width), np.uint32), np.zeros(self._most, bool)
        self._words[numbers] = words
        self._have[numbers] = True
        self._count = int(np.count_nonzero(self._have))

    def all(self) -> tuple[NDArray[np.int64], Words]:
        """Return the numbers (k,) and their words (k, w)."""
        numbers = np.flatnonzero(self._have)
        return numbers, self._words[numbers]


def restore(values: Words, have: Mask, repairs: Mapping[int, Words]) -> None:
    """Fill in `values` (B, w) and `have` (B,) from repair frames by number -> w words, as `restore_from`."""
    numbers = np.fromiter(repairs.keys(), np.int64, len(repairs))
    restore_from(
        values, have, numbers, np.array(list(repairs.values()), np.uint32).reshape(len(repairs), values.shape[1])
    )


def restore_from(values: Words, have: Mask, numbers: NDArray[np.int64], combined: Words) -> None:
    """Fill in `values` (B, w) and `have` (B,) wherever repair frames `numbers` (k,), `combined` (k, w) give a block.

    Cost: per group at most missing · repairs operations on words of 32 blocks, 256 missing at most.
    """
    if not len(numbers):
        return
    members = group_members(len(values))
    group = numbers % len(members)
    for g in np.unique(group).tolist():
        member = members[g]
        missing = ~have[member]
        if not missing.any():
            continue
        mine = group == g
        sets = repair_sets(numbers[mine], len(member))  # (repairs, members)
        known = np.where((sets & ~missing)[:, :, None], values[member], np.uint32(0))  # (repairs, members, w)
        right = combined[mine] ^ np.bitwise_xor.reduce(known, axis=1)
        solved, solution = _eliminate(sets[:, missing], right)
        at = member[missing][solved]
        values[at], have[at] = solution[solved], True


def _eliminate(rows: Mask, right: Words) -> tuple[Mask, Words]:
    """Solve rows (k, m) · x = right (k, w) over GF(2); returns which x (m,) are determined, and x (m, w).

    Rows are packed with their right sides: bit j of x is bit j % 32 of word j // 32.
    """
    count, unknowns = rows.shape
    width = -(-unknowns // 32)
    packed = np.zeros((count, 4 * width), np.uint8)
    some = np.packbits(rows, axis=1, bitorder="little")
    packed[:, : some.shape[1]] = some
    table = np.hstack([packed.view("<u4").astype(np.uint32), right])  # (k, width + w)
    used, pivots = 0, np.full(unknowns, -1)
    for column in range(unknowns):
        bit = table[:, column >> 5] >> np.uint32(column & 31) & np.uint32(1)
        candidates = bit[used:].nonzero()[0]
        if not len(candidates):
            continue
        pivot = used + int(candidates[0])
        if pivot != used:
            table[[used, pivot]] = table[[pivot, used]]
            bit[pivot] = bit[used]
        bit[used] = 0
        table[bit.nonzero()[0]] ^= table[used]
        pivots[column] = used
        used += 1
        if used == count:
            break
    weights = _weights(table, width)
    solved = np.zeros(unknowns, bool)
    solution = np.zeros((unknowns, right.shape[1]), np.uint32)
    found = np.flatnonzero(pivots >= 0)
    alone = found[weights[pivots[found]] == 1]  # depends on no undetermined parameter
    solved[alone], solution[alone] = True, table[pivots[alone], width:]
    return solved, solution


def _weights(table: Words, width: int) -> NDArray[np.int64]:
    """Count the bits of the first words of each row."""
    left = np.ascontiguousarray(table[:, :width]).view(np.uint8)
    counted: NDArray[np.int64] = np.unpackbits(left, axis=1).sum(axis=1, dtype=np.int64)
    return counted
