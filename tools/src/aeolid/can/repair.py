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


def restore(values: Words, have: Mask, repairs: Mapping[int, Words]) -> None:
    """Fill in `values` (B, w) and `have` (B,) wherever the repair frames (number -> w words) determine a block.

    Cost: per group at most missing² · repairs bit operations, 256 missing at most.
    """
    members = group_members(len(values))
    numbers = np.fromiter(repairs.keys(), np.int64, len(repairs))
    combined = np.array(list(repairs.values()), np.uint32).reshape(len(repairs), values.shape[1])
    for g, member in enumerate(members):
        missing = ~have[member]
        mine = numbers % len(members) == g
        if not missing.any() or not mine.any():
            continue
        sets = repair_sets(numbers[mine], len(member))  # (repairs, members)
        known = np.where((sets & ~missing)[:, :, None], values[member], np.uint32(0))  # (repairs, members, w)
        right = combined[mine] ^ np.bitwise_xor.reduce(known, axis=1)
        solved, solution = _eliminate(sets[:, missing], right)
        at = member[missing][solved]
        values[at], have[at] = solution[solved], True


def _eliminate(rows: Mask, right: Words) -> tuple[Mask, Words]:
    """Solve rows (k, m) · x = right (k, w) over GF(2); returns which x (m,) are determined, and x (m, w)."""
    rows, right = rows.copy(), right.copy()
    unknowns = rows.shape[1]
    used, pivots = 0, np.full(unknowns, -1)
    for column in range(unknowns):
        candidates = np.flatnonzero(rows[used:, column])
        if not len(candidates):
            continue
        pivot = used + int(candidates[0])
        rows[[used, pivot]], right[[used, pivot]] = rows[[pivot, used]], right[[pivot, used]]
        others = rows[:, column].copy()
        others[used] = False
        rows[others] ^= rows[used]
        right[others] ^= right[used]
        pivots[column] = used
        used += 1
        if used == len(rows):
            break
    solved = np.zeros(unknowns, bool)
    solution = np.zeros((unknowns, right.shape[1]), np.uint32)
    for column in np.flatnonzero(pivots >= 0).tolist():
        row = int(pivots[column])
        if np.count_nonzero(rows[row]) == 1:  # depends on no undetermined parameter
            solved[column], solution[column] = True, right[row]
    return solved, solution
