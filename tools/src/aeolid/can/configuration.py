"""Hold what one node sent under one description, and hand its samples on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import Description
from aeolid.can.judging import SEAL as SEALED
from aeolid.can.judging import SURE, VALUE
from aeolid.can.limits import ANCHORS_FREE, ANCHORS_SHARE
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import SnapshotStore
from aeolid.can.wire import (
    BEGIN,
    HEALTH,
    INNOVATION,
    INNOVATION_FD,
    SAMPLE,
    SAMPLE_FD,
    SEAL,
    SEAL_INNOVATION,
    Messages,
)


@dataclass(eq=False)
class Configuration:
    """Hold what one node sent under one description."""

    description: Description
    samples: SampleStore
    innovations: SampleStore
    snapshots: SnapshotStore

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return self.samples.nbytes + self.innovations.nbytes + self.snapshots.nbytes

    def take(self, m: Messages) -> NDArray[np.bool_]:
        """Take the samples and innovations among messages, and what dates them; returns which they are (n,)."""
        seal, of_innovation = m.kind == SEAL, m.tag >= SEAL_INNOVATION
        samples = (m.kind == SAMPLE) | (m.kind == SAMPLE_FD) | (seal & ~of_innovation)
        innovations = (m.kind == INNOVATION) | (m.kind == INNOVATION_FD) | (seal & of_innovation)
        start = 0
        for stop in [*_anchors(m), len(m)]:  # a full index holds for the samples before it
            for store, mine in ((self.samples, samples), (self.innovations, innovations)):
                at = np.flatnonzero(mine[start:stop])
                if len(at):
                    _add_values(store, m.take(at + start))
                if stop < len(m):
                    store.anchor(int(m.value[stop]), int(m.place[stop]))
            start = stop
        data: NDArray[np.bool_] = samples | innovations
        return data


def _anchors(m: Messages) -> list[int]:
    """Return where full indices are told; of more than an honest node tells only some: each costs its turn."""
    at = np.flatnonzero(((m.kind == HEALTH) & (m.tag == 0)) | (m.kind == BEGIN))
    most = ANCHORS_FREE + len(m) // ANCHORS_SHARE
    if len(at) > most:
        at = at[np.linspace(0, len(at) - 1, most).astype(np.int64)]
    told: list[int] = at.tolist()
    return told


def _add_values(store: SampleStore, m: Messages) -> None:
    if not len(m):
        return
    seal = m.kind == SEAL
    channel = np.where(seal, m.tag & np.uint8(SEAL_INNOVATION - 1), m.tag + m.lane).astype(np.uint8)
    what = np.where(seal, SEALED, np.where(m.kind >= SAMPLE_FD, SURE, VALUE)).astype(np.uint8)
    store.add(channel, m.index, m.value, m.place, what)
