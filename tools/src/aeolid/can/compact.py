"""Hold batches that come one after the other in few pieces: an object a frame would cost fifty times the frame."""

from __future__ import annotations

from collections.abc import Callable, Sized
from typing import TypeVar

from aeolid.can.limits import LOOSE

Piece = TypeVar("Piece", bound=Sized)


def merge_tail(parts: list[Piece], join: Callable[[list[Piece]], Piece]) -> None:
    """Join the newest pieces in place once there are many, so that each is several times as long as those after it.

    Cost: each message is copied a few times, however the batches fall.
    """
    if len(parts) < LOOSE:
        return
    total, first = 0, len(parts)
    while first and len(parts[first - 1]) <= 4 * total + LOOSE:
        first -= 1
        total += len(parts[first])
    if len(parts) - first > 1:
        parts[first:] = [join(parts[first:])]
    elif len(parts) >= 2 * LOOSE:
        parts[:] = [join(parts)]
