"""Follow every node on a bus: description, samples, snapshots, health."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import WIRE, Description, DescriptionCollector
from aeolid.can.garbling import Garbling
from aeolid.can.health import Health
from aeolid.can.judging import SEAL as SEALED
from aeolid.can.judging import SURE, VALUE
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import MarkovSnapshot, SnapshotStore
from aeolid.can.wire import (
    BASE,
    BEGIN,
    DESCRIPTION,
    END,
    ERROR,
    GARBLED,
    HEALTH,
    INNOVATION,
    INNOVATION_FD,
    KINDS,
    PARAMETER,
    PARAMETER_FD,
    REPAIR,
    REPAIR_FD,
    SAMPLE,
    SAMPLE_FD,
    SEAL,
    SEAL_INNOVATION,
    Frames,
    Messages,
    decode,
)

SNAPSHOT_KINDS = np.isin(np.arange(KINDS), (BEGIN, PARAMETER, REPAIR, END, PARAMETER_FD, REPAIR_FD))
NODES_MAX = 32  # nodes followed at once; forged node numbers cost no more than this
EARLY_MAX = 200_000  # messages kept for a node that has not described itself yet
PREVIOUS_MAX = 64  # configurations of one node that are kept


@dataclass(eq=False)
class Configuration:
    """Hold what one node sent under one description."""

    description: Description
    samples: SampleStore
    innovations: SampleStore
    snapshots: SnapshotStore


class Node:
    """Hold the state of one node; `now` is None until it has described itself.

    problem: why its frames cannot be read, None when they can. early_lost: messages that came before the description
    and were too many to keep, or whose description never came.
    """

    def __init__(self, number: int, garbling: Garbling | None = None) -> None:
        self.number = number
        self.now: Configuration | None = None
        self.previous: list[Configuration] = []
        self.messages = 0
        self.early_lost = 0
        self._garbling = garbling or Garbling()
        self._health = Health(self._garbling)
        self._collector = DescriptionCollector()
        self._early: list[Messages] = []  # of a configuration that is not known yet
        self._kept = 0
        self._head: tuple[int, int] | None = None  # of the configuration in force
        self._rumour: tuple[int, int, int] | None = None  # head of another one, with the place where it was first heard

    @property
    def problem(self) -> str | None:
        """Say why this node cannot be read."""
        if self.now is None or (self._rumour is not None and self._garbling.quiet_at(self._rumour[2])):
            return self._collector.problem
        return None

    @property
    def stopped(self) -> bool:
        """Tell whether the node has ended its stream on purpose."""
        return self._health.stopped

    @property
    def flags(self) -> int:
        """Return the filter's health flags."""
        return self._health.flags

    @property
    def counters(self) -> dict[str, int]:
        """Return the counters told in health messages, by name."""
        return self._health.counters

    def add(self, m: Messages) -> None:
        """Take this node's messages in the order of arrival."""
        self.messages += int(np.count_nonzero(m.lane == 0))
        heads = np.flatnonzero((m.kind == DESCRIPTION) & (m.tag == WIRE))
        start = 0
        for at in heads.tolist():
            head = (int(m.index[at]), int(m.value[at]))
            if head != self._head if self._rumour is None else head != self._rumour[:2]:
                self._take(m.take(slice(start, at)))
                self._hear(head, int(m.place[at]))
                start = at
        self._take(m.take(slice(start, len(m))) if start else m)

    def _hear(self, head: tuple[int, int], place: int) -> None:
        """Wait for another description, or go back to the one in force; a head may be garbled past its check."""
        if head == self._head and self.now is not None:
            self._deny()
        else:
            self._rumour = (*head, place)

    def _deny(self) -> None:
        """Give what came since a rumour to the configuration in force."""
        self._rumour = None
        self._replay()

    def _replay(self) -> None:
        early, self._early, self._kept = self._early, [], 0
        for messages in early:
            if self.now is not None:
                self._use(self.now, messages)

    def _take(self, m: Messages) -> None:
        parts = m.kind == DESCRIPTION
        waits = self.now is None or self._rumour is not None
        if waits and parts.any():
            self._describe(m.take(parts))
            waits = self.now is None or self._rumour is not None
        rest = m.take(~parts) if parts.any() else m
        if waits:
            self._keep(rest)
        elif self.now is not None:
            self._use(self.now, rest)

    def configurations(self) -> list[Configuration]:
        """List all configurations that sent something, oldest first."""
        return [*self.previous, *([self.now] if self.now else [])]

    def latest_complete(self) -> MarkovSnapshot | None:
        """Return the newest complete snapshot."""
        return self.now.snapshots.complete if self.now else None

    def close(self) -> None:
        """Finish what is under way."""
        if self._rumour is not None and self.now is not None:
            if self._garbling.quiet_at(self._rumour[2]):  # a new configuration that had no time to describe itself
                self.early_lost += self._kept
                self._early, self._kept = [], 0
            else:
                self._deny()
        if self.now is not None:
            self.now.snapshots.close(self._newest(self.now))

    def _describe(self, m: Messages) -> None:
        rows = zip(m.tag.tolist(), m.index.tolist(), m.value.tolist(), strict=True)
        d = self._collector.add(rows)
        if d is None:
            return
        self._head = (d.wire_version, d.configuration_hash)
        self._rumour = None
        if self.now is None or not self.now.description.same_as(d):
            if self.now is not None:
                self.now.snapshots.close(self._newest(self.now))
                self.previous = [*self.previous, self.now][-PREVIOUS_MAX:]
            tags = (d.channels, d.outputs | SEAL_INNOVATION)
            heads = [self.number | tag << 8 for tag in tags]
            samples = SampleStore(d.channels, d.sample_every, self._garbling, heads[0])
            innovations = SampleStore(d.outputs, d.sample_every, self._garbling, heads[1])
            self.now = Configuration(d, samples, innovations, SnapshotStore(d, self._garbling, self.number))
        self._replay()

    def _keep(self, m: Messages) -> None:
        if self._kept + len(m) <= EARLY_MAX:
            self._early.append(m)
            self._kept += len(m)
        else:
            self.early_lost += len(m)

    def _use(self, now: Configuration, m: Messages) -> None:
        seal, of_innovation = m.kind == SEAL, m.tag >= SEAL_INNOVATION
        samples = (m.kind == SAMPLE) | (m.kind == SAMPLE_FD) | (seal & ~of_innovation)
        innovations = (m.kind == INNOVATION) | (m.kind == INNOVATION_FD) | (seal & of_innovation)
        tells_index = ((m.kind == HEALTH) & (m.tag == 0)) | (m.kind == BEGIN)
        start = 0
        for stop in [*np.flatnonzero(tells_index).tolist(), len(m)]:  # a full index holds for the samples before it
            for store, mine in ((now.samples, samples), (now.innovations, innovations)):
                _add_values(store, m.take(np.flatnonzero(mine[start:stop]) + start))
                if stop < len(m):
                    store.anchor(int(m.value[stop]), int(m.place[stop]))
            start = stop
        self._take_health(m, samples | innovations | (m.kind == BEGIN))
        snapshot = SNAPSHOT_KINDS[m.kind]
        if snapshot.any():
            now.snapshots.add(m.take(snapshot), self._newest(now))

    def _newest(self, now: Configuration) -> list[int]:
        told = self._health.newest_index()
        return now.samples.last_indices() + ([] if told is None else [told])

    def _take_health(self, m: Messages, goes_on: NDArray[np.bool_]) -> None:
        alive = np.flatnonzero(goes_on)
        last = int(alive[-1]) if len(alive) else -1
        for at in np.flatnonzero(m.kind == HEALTH).tolist():
            if at > last >= 0:
                self._health.go_on()
                last = -1
            self._health.take(int(m.tag[at]), int(m.index[at]), int(m.value[at]), int(m.place[at]))
        if last >= 0:
            self._health.go_on()


def _add_values(store: SampleStore, m: Messages) -> None:
    if not len(m):
        return
    seal = m.kind == SEAL
    channel = np.where(seal, m.tag & np.uint8(SEAL_INNOVATION - 1), m.tag + m.lane).astype(np.uint8)
    what = np.where(seal, SEALED, np.where(m.kind >= SAMPLE_FD, SURE, VALUE)).astype(np.uint8)
    store.add(channel, m.index, m.value, m.place, what)


class Assembly:
    """Decode batches of frames and hand them to their nodes."""

    def __init__(self, base: int = BASE) -> None:
        self.nodes: dict[int, Node] = {}
        self.frames = 0
        self.foreign = 0
        self.damaged = 0
        self.garbled = 0
        self._base = base
        self._garbling = Garbling()

    def feed(self, frames: Frames) -> None:
        """Take one batch in the order of arrival."""
        if not len(frames) and not frames.garbled:
            return
        messages = decode(frames, self._base, self.frames)
        garbled = np.flatnonzero(frames.flags & GARBLED)
        self._garbling.add(garbled + self.frames)
        if frames.garbled:  # where among the frames is not known
            self._garbling.add_stretch(self.frames, self.frames + len(frames))
        self._garbling.add(messages.damaged_at)
        self.frames += len(frames)
        self._garbling.frames = self.frames
        self.foreign += messages.foreign - int(np.count_nonzero(frames.flags & (ERROR | GARBLED)))
        self.damaged += messages.damaged
        self.garbled += frames.garbled + len(garbled)
        for number in np.unique(messages.node).tolist():
            node = self.nodes.get(number)
            if node is None:
                if len(self.nodes) >= NODES_MAX and not self._forget_one():
                    continue
                node = self.nodes[number] = Node(number, self._garbling)
            mine: NDArray[np.bool_] = messages.node == number
            node.add(messages if mine.all() else messages.take(mine))

    def _forget_one(self) -> bool:
        """Give up the number with the fewest messages that never described itself: garbled ones must bar no node."""
        mute = [node for node in self.nodes.values() if not node.configurations()]
        if mute:
            del self.nodes[min(mute, key=lambda node: node.messages).number]
        return bool(mute)

    def close(self) -> None:
        """Finish what is under way; nothing more will come."""
        self._garbling.closed = True
        for node in self.nodes.values():
            node.close()

    def all_stopped(self) -> bool:
        """Tell whether every node that can be read has said goodbye, and there is one."""
        readable = [n for n in self.nodes.values() if n.problem is None and n.now is not None]
        return bool(readable) and all(n.stopped for n in readable)
