"""Identify from outputs alone: which channels are taken, and what is to be said of the model.

Without inputs the regression of paper 000 eq. (9) has past outputs only, y_k = Σ Ξ_j y_{k−j} + e_k, and the model is
x⁺ = A x + K e, y = C x + e: poles, shapes and the spectrum of the outputs. Whatever drives them, wind, waves and what a
controller does, is the unknown white e coloured by the model; poles of the plant under feedback are those of the loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.errors import DataError, UsageError
from aeolid.record import Channel, Record

ALL = "all"
NOTE = (
    "identified from outputs alone: modes are those of everything that moves, the loop of a controller included; there "
    "is no response to an input, and nothing to simulate"
)


def of_outputs_alone(records: list[Record], outputs: Sequence[str] | None) -> list[Record]:
    """Return the recordings with these channels as their outputs and no input; as they are where none is named.

    outputs: names, or "all" for those of the role. Channels that are left out get the role ignore; azimuth, scheduling
    and the like keep theirs. Raises UsageError on a channel that is not there, or named twice.
    """
    if not records or outputs is None:
        return records
    have = [c.name for c in records[0].channels]
    if list(outputs) == [ALL]:
        outputs = records[0].names("output")
    for name in outputs:
        if name not in have:
            raise UsageError(f"--outputs {name}: {records[0].source} has no such channel; it has {', '.join(have)}")
        if list(outputs).count(name) > 1:
            raise UsageError(f"--outputs names {name!r} twice")
    if not outputs:
        raise DataError(f"{records[0].source}: no channel has the role 'output'; name one in the roles file")
    return [replace(r, channels=tuple(_role(c, outputs) for c in r.channels)) for r in records]


def _role(channel: Channel, outputs: Sequence[str]) -> Channel:
    if channel.name in outputs:
        return replace(channel, role="output", hold="auto")
    return replace(channel, role="ignore", hold="auto") if channel.role in ("input", "output") else channel
