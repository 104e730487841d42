"""Put the values of samples together and decide which of them are believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.crc import solve_second
from aeolid.can.garbling import Garbling

Words = NDArray[np.uint32]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
VALUE, SURE, SEAL = 0, 1, 2  # what a message is: guarded by a CRC-8, guarded by a CRC-32, seal of a sample
SHUFFLE = 16  # gateways may swap neighbours; a longer way back is a restart, or a silence of 65536 samples


@dataclass(frozen=True, eq=False)
class Part:
    """Hold messages in the order of arrival, arrays (n,): unwrapped index, channel, pattern, place, what."""

    index: Integers
    channel: NDArray[np.uint8]
    value: Words
    place: Integers
    what: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.index)

    @property
    def nbytes(self) -> int:
        """Return the bytes of the arrays."""
        return self.index.nbytes + self.channel.nbytes + self.value.nbytes + self.place.nbytes + self.what.nbytes

    def take(self, chosen: Mask | slice | Integers) -> Part:
        """Return the messages that a mask, a slice or an index array chooses."""
        index, channel, value = self.index[chosen], self.channel[chosen], self.value[chosen]
        return Part(index, channel, value, self.place[chosen], self.what[chosen])


def join_parts(parts: list[Part]) -> Part:
    """Put messages together, in order."""
    return Part(
        np.concatenate([np.zeros(0, np.int64), *(p.index for p in parts)]),
        np.concatenate([np.zeros(0, np.uint8), *(p.channel for p in parts)]),
        np.concatenate([np.zeros(0, np.uint32), *(p.value for p in parts)]),
        np.concatenate([np.zeros(0, np.int64), *(p.place for p in parts)]),
        np.concatenate([np.zeros(0, np.uint8), *(p.what for p in parts)]),
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Hold samples in order: index (k,) as in the messages, bits and have (k, channels).

    sure, sealed, misfit, clash (k,): guarded by a CRC-32 frame by frame; complete with a seal that fits; with one that
    does not; a channel came twice with different values. torn (k,): two seals came that differ, or two values of a
    sample without seals: two controllers say different things of one sample. turn (k,): what must be added to the index
    for the seal to fit. first, last (k,): places of the first and last frame.
    """

    index: Integers
    bits: Words
    have: Mask
    sure: Mask
    sealed: Mask
    misfit: Mask
    clash: Mask
    torn: Mask
    turn: Integers
    first: Integers
    last: Integers


def drop_strays(part: Part, every: int, before: int | None, after: int | None) -> Part:
    """Leave out values whose neighbours in time are both far away: they have strayed from another node's count.

    before, after: samples beyond the ends. What strays by less meets its sample's true value, and the seal decides.
    """
    near = np.abs(np.diff(part.index)) <= SHUFFLE * every
    first = before is not None and abs(int(part.index[0]) - before) <= SHUFFLE * every
    last = after is not None and abs(int(part.index[-1]) - after) <= SHUFFLE * every
    kept = np.append(first, near) | np.append(near, last) | (part.what == SURE)
    return part if kept.all() else part.take(kept)


def gather(part: Part, channels: int, head: int) -> Rows:
    """Sort messages (n ≥ 1) into samples; head: first word under the seals."""
    index, at = np.unique(part.index, return_inverse=True)
    rows = len(index)
    bits, have = np.zeros((rows, channels), np.uint32), np.zeros((rows, channels), bool)
    sure, clash = np.zeros(rows, bool), np.zeros(rows, bool)
    first, last = np.empty(rows, np.int64), np.empty(rows, np.int64)
    first[at[::-1]], last[at] = part.place[::-1], part.place
    is_seal = part.what == SEAL
    row, column, value = at[~is_seal], part.channel[~is_seal], part.value[~is_seal]
    bits[row, column] = value
    have[row, column] = True
    clash[row[bits[row, column] != value]] = True
    sure[at[part.what == SURE]] = True
    seal, has_seal = np.zeros(rows, np.uint32), np.zeros(rows, bool)
    seal[at[is_seal]], has_seal[at[is_seal]] = part.value[is_seal], True
    torn = clash & ~has_seal & ~sure
    torn[at[is_seal][seal[at[is_seal]] != part.value[is_seal]]] = True
    sealed = has_seal & have.all(axis=1) & ~sure
    turn = np.zeros(rows, np.int64)
    turn[sealed] = solve_second(seal[sealed], head, bits[sealed]).astype(np.int64) - index[sealed]
    misfit = sealed & (turn % 65536 != 0)
    return Rows(index, bits, have, sure, sealed & ~misfit, misfit, clash, torn, turn, first, last)


def believe(rows: Rows, known: set[int], garbling: Garbling | None) -> tuple[Mask, Integers, Mask]:
    """Decide which rows are believed (k,); returns that, and the turn of each row (k,) with whether it is known (k,).

    A seal proves its sample with 16 bits by itself and with 32 when its turn is that of its neighbour, or in `known`;
    without a neighbour a quiet bus must do. Other rows are believed on a quiet bus, when nothing contradicts them. Of
    two different seals none is believed.
    """
    quiet = np.ones(len(rows.index), bool)
    at = np.flatnonzero(rows.sealed)
    turn = rows.turn[at]
    same = turn[1:] == turn[:-1]
    proved = np.append(False, same) | np.append(same, False) | np.isin(turn, np.fromiter(known, np.int64, len(known)))
    if garbling is not None:
        garbling.add(rows.last[rows.misfit])
        lone = at[~proved]
        proved[~proved] = garbling.is_quiet(rows.first[lone], rows.last[lone])
        garbling.add(rows.last[at[~proved]])
        quiet = garbling.is_quiet(rows.first, rows.last)
    else:
        proved[:] = True
    sealed = np.zeros(len(rows.index), bool)
    sealed[at[proved]] = True
    loose = ~rows.sealed & ~rows.misfit & ~rows.sure
    believed = (sealed & ~rows.torn) | rows.sure | (loose & quiet & ~rows.clash)
    if not sealed.any():
        return believed, np.zeros(len(rows.index), np.int64), sealed
    anchors = np.flatnonzero(sealed)  # the nearest proved row before, else the first one, dates the others
    nearest = np.clip(np.searchsorted(anchors, np.arange(len(rows.index)), side="right") - 1, 0, None)
    return believed, rows.turn[anchors[nearest]], np.ones(len(rows.index), bool)
