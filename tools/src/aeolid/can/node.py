"""Follow every node on a bus: description, samples, snapshots, health."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import WIRE, Description, DescriptionCollector
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import MarkovSnapshot, SnapshotStore
from aeolid.can.wire import (
    BASE,
    BEGIN,
    DESCRIPTION,
    END,
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
    STOPPED,
    Frames,
    Messages,
    decode,
    health_names,
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


@dataclass(eq=False)
class Node:
    """Hold the state of one node; `now` is None until it has described itself.

    problem: why its frames cannot be read, None when they can. early_lost: messages that came before the description
    and were too many to keep.
    """

    number: int
    collector: DescriptionCollector = field(default_factory=DescriptionCollector)
    now: Configuration | None = None
    previous: list[Configuration] = field(default_factory=list)
    stopped: bool = False
    flags: int = 0
    counters: dict[str, int] = field(default_factory=dict)
    messages: int = 0
    early_lost: int = 0
    _early: list[Messages] = field(default_factory=list)
    _head: tuple[int, int] | None = None

    @property
    def problem(self) -> str | None:
        """Say why this node cannot be read."""
        return self.collector.problem

    def add(self, m: Messages) -> None:
        """Take this node's messages in the order of arrival."""
        self.messages += len(m)
        heads = np.flatnonzero((m.kind == DESCRIPTION) & (m.tag == WIRE))
        start = 0
        for at in heads.tolist():
            head = (int(m.index[at]), int(m.value[at]))
            if head != self._head:  # from here on another configuration speaks
                self._take(m.take(np.arange(start, at)))
                self._turn(head)
                start = at
        self._take(m.take(np.arange(start, len(m))) if start else m)

    def _turn(self, head: tuple[int, int]) -> None:
        """Put the configuration in force aside; samples wait until the new one has described itself."""
        self._head = head
        self.close()
        if self.now is not None:
            self.previous = [*self.previous, self.now][-PREVIOUS_MAX:]
            self.now = None
            self._early = []

    def _take(self, m: Messages) -> None:
        parts = m.kind == DESCRIPTION
        if parts.any() and self.now is None:
            self._describe(m.take(parts))
        if self.problem is not None:
            return
        rest = m.take(~parts) if parts.any() else m
        if self.now is None:
            self._keep(rest)
        else:
            self._use(self.now, rest)

    def configurations(self) -> list[Configuration]:
        """List all configurations that sent something, oldest first."""
        return [*self.previous, *([self.now] if self.now else [])]

    def latest_complete(self) -> MarkovSnapshot | None:
        """Return the newest complete snapshot."""
        return self.now.snapshots.complete if self.now else None

    def close(self) -> None:
        """Finish what is under way."""
        if self.now is not None:
            self.now.snapshots.close(self._newest(self.now))

    def _describe(self, m: Messages) -> None:
        rows = zip(m.tag.tolist(), m.index.tolist(), m.value.tolist(), strict=True)
        description = self.collector.add(rows)
        if description is None:
            return
        if self.previous and self.previous[-1].description.same_as(description):
            self.now = self.previous.pop()  # a damaged head had interrupted it
        else:
            d = description
            self.now = Configuration(d, SampleStore(d.channels), SampleStore(d.outputs), SnapshotStore(d))
        early, self._early = self._early, []
        for messages in early:
            self._use(self.now, messages)

    def _keep(self, m: Messages) -> None:
        kept = sum(len(e) for e in self._early)
        if kept + len(m) <= EARLY_MAX:
            self._early.append(m)
        else:
            self.early_lost += len(m)

    def _use(self, now: Configuration, m: Messages) -> None:
        samples = (m.kind == SAMPLE) | (m.kind == SAMPLE_FD)
        channel = m.tag + m.lane
        tells_index = ((m.kind == HEALTH) & (m.tag == 0)) | (m.kind == BEGIN)
        start = 0
        for stop in [*np.flatnonzero(tells_index).tolist(), len(m)]:  # a full index holds for the samples before it
            part = slice(start, stop)
            chosen = samples[part]
            if chosen.any():
                now.samples.add(channel[part][chosen], m.index[part][chosen], m.value[part][chosen])
            if stop < len(m):
                now.samples.anchor(int(m.value[stop]))
            start = stop
        innovations = (m.kind == INNOVATION) | (m.kind == INNOVATION_FD)
        if innovations.any():
            now.innovations.add(channel[innovations], m.index[innovations], m.value[innovations])
        if samples.any():
            self.stopped = False
        health = m.take(m.kind == HEALTH)
        if len(health):
            self._take_health(now, health)
        snapshot = SNAPSHOT_KINDS[m.kind]
        if snapshot.any():
            now.snapshots.add(m.take(snapshot), self._newest(now))

    def _newest(self, now: Configuration) -> int | None:
        index = now.samples.last_index()
        return self.counters.get("SampleIndex") if index is None else index

    def _take_health(self, now: Configuration, m: Messages) -> None:
        names = health_names()
        for tag, flags, value in zip(m.tag, m.index, m.value, strict=True):
            name = names.get(int(tag))
            if name is None:
                continue
            self.flags = int(flags) & ~STOPPED
            self.counters[name] = int(value)
            if tag == 0:
                now.innovations.anchor(int(value))
            if int(flags) & STOPPED:
                self.stopped = True


class Assembly:
    """Decode batches of frames and hand them to their nodes."""

    def __init__(self, base: int = BASE) -> None:
        self.nodes: dict[int, Node] = {}
        self.frames = 0
        self.foreign = 0
        self.damaged = 0
        self.garbled = 0
        self._base = base

    def feed(self, frames: Frames) -> None:
        """Take one batch in the order of arrival."""
        if not len(frames) and not frames.garbled:
            return
        messages = decode(frames, self._base)
        self.frames += len(frames)
        self.foreign += messages.foreign
        self.damaged += messages.damaged
        self.garbled += frames.garbled
        for number in np.unique(messages.node).tolist():
            node = self.nodes.get(number)
            if node is None:
                if len(self.nodes) >= NODES_MAX:
                    continue
                node = self.nodes[number] = Node(number)
            mine: NDArray[np.bool_] = messages.node == number
            node.add(messages if mine.all() else messages.take(mine))

    def close(self) -> None:
        """Finish what is under way."""
        for node in self.nodes.values():
            node.close()

    def all_stopped(self) -> bool:
        """Tell whether every node that can be read has said goodbye, and there is one."""
        readable = [n for n in self.nodes.values() if n.problem is None and n.now is not None]
        return bool(readable) and all(n.stopped for n in readable)
