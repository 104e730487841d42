"""Follow every node on a bus: description, samples, snapshots, health."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.can.compact import merge_tail
from aeolid.can.configuration import Configuration
from aeolid.can.description import WIRE, DescriptionCollector
from aeolid.can.garbling import Garbling
from aeolid.can.health import Health
from aeolid.can.limits import (
    CONFIGURATIONS_MAX,
    EARLY_MAX,
    MUTE_LEAST,
    NODE_BYTES,
    NODES_MAX,
    PART_BYTES,
    PREVIOUS_KEPT,
    TOTAL_BYTES,
)
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
    KINDS,
    PARAMETER,
    PARAMETER_FD,
    REPAIR,
    REPAIR_FD,
    SEAL_INNOVATION,
    Frames,
    Messages,
    decode,
    join_messages,
)

__all__ = ["Assembly", "Configuration", "Node"]
SNAPSHOT_KINDS = np.isin(np.arange(KINDS), (BEGIN, PARAMETER, REPAIR, END, PARAMETER_FD, REPAIR_FD))


class Node:
    """Hold the state of one node; `now` is None until it has described itself.

    problem: why its frames cannot be read, None when they can. early_lost: messages that came before the description
    and were too many to keep, or whose description never came. refused: why nothing more is taken of it; refused_out:
    messages since. given_up: bytes of what waited that were given up to save memory.
    """

    def __init__(self, number: int, garbling: Garbling | None = None) -> None:
        self.number = number
        self.now: Configuration | None = None
        self.previous: list[Configuration] = []
        self.messages = 0
        self.early_lost = 0
        self.changes = 0  # configurations so far
        self.refused = ""
        self.refused_out = 0
        self.given_up = 0
        self._garbling = garbling or Garbling()
        self._health = Health(self._garbling)
        self._collector = DescriptionCollector()
        self._early: list[Messages] = []  # of a configuration that is not known yet
        self._kept = 0
        self._gone = 0  # messages left out of configurations that are no longer kept
        self._head: tuple[int, int] | None = None  # of the configuration in force
        self._rumour: tuple[int, int, int] | None = None  # head of another one, with the place where it was first heard

    @property
    def problem(self) -> str | None:
        """Say why this node cannot be read."""
        if self.now is None or (self._rumour is not None and self._garbling.quiet_at(self._rumour[2])):
            return self._collector.problem
        return None

    @property
    def contested(self) -> str:
        """Say how it shows that two nodes bear this number, empty where nothing does."""
        told = []
        for configuration in self.configurations():
            samples = configuration.samples
            if samples.refused:
                told.append(f"{samples.contradicted} samples came in two versions that contradict each other")
            if (rest := samples.rival_messages) > 0:
                told.append(f"a second count of samples went on beside the one recorded ({rest} messages)")
        if self._health.is_double:
            told.append("the sample indices told go to and fro")
        return "; ".join(dict.fromkeys(told))

    @property
    def left_out(self) -> int:
        """Count the messages that were not taken."""
        stores = [s for c in self.configurations() for s in (c.samples, c.innovations)]
        return self.early_lost + self.refused_out + self._gone + sum(store.left_out for store in stores)

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        early = sum(m.nbytes + PART_BYTES for m in self._early) + self._collector.nbytes
        return early + sum(c.nbytes for c in self.configurations())

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
        if self.refused:
            self.refused_out += len(m)
            return
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
            if self.changes >= CONFIGURATIONS_MAX:
                self.refused = f"described itself anew more than {CONFIGURATIONS_MAX} times"
                self.refused_out += self._kept
                self._early, self._kept = [], 0
                return
            if self.now is not None:
                self._retire(self.now)
            self.changes += 1
            tags = (d.channels, d.outputs | SEAL_INNOVATION)
            heads = [self.number | tag << 8 for tag in tags]
            samples = SampleStore(d.channels, d.sample_every, self._garbling, heads[0])
            innovations = SampleStore(d.outputs, d.sample_every, self._garbling, heads[1])
            self.now = Configuration(d, samples, innovations, SnapshotStore(d, self._garbling, self.number))
        self._replay()

    def _retire(self, now: Configuration) -> None:
        """Put a configuration aside; its samples wait to be written, its parameters nobody asks for any more."""
        now.snapshots.close(self._newest(now))
        now.snapshots.retire()
        self.previous.append(now)

    def tidy(self) -> None:
        """Forget configurations that are over and written, the newest ones aside."""
        for old in self.previous[:-PREVIOUS_KEPT]:
            if old.samples.is_empty() and old.innovations.is_empty():
                self._gone += old.samples.left_out + old.innovations.left_out
                self.previous.remove(old)

    def _keep(self, m: Messages) -> None:
        if self._kept + len(m) <= EARLY_MAX:
            if len(m):
                self._early.append(m)
                merge_tail(self._early, join_messages)
                self._kept += len(m)
        else:
            self.early_lost += len(m)

    def give_up(self) -> int:
        """Give up what waits, to save memory; returns how many bytes that were."""
        before = self.nbytes
        self.early_lost += self._kept
        self._early, self._kept = [], 0
        for configuration in self.configurations():
            configuration.snapshots.give_up()
        freed = before - self.nbytes
        self.given_up += freed
        return freed

    def _use(self, now: Configuration, m: Messages) -> None:
        data = now.take(m)
        self._take_health(m, data | (m.kind == BEGIN))
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


class Assembly:
    """Decode batches of frames and hand them to their nodes."""

    def __init__(self, base: int = BASE) -> None:
        self.nodes: dict[int, Node] = {}
        self.frames = 0
        self.foreign = 0
        self.damaged = 0
        self.garbled = 0
        self.forgotten = self.forgotten_messages = 0  # numbers that had to make room undescribed, their messages
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
        order = np.argsort(messages.node, kind="stable")
        numbers, starts = np.unique(messages.node[order], return_index=True)
        stops = np.append(starts[1:], len(order))
        for number, start, stop in zip(numbers.tolist(), starts, stops, strict=False):  # none: one stop too many
            node = self.nodes.get(number)
            if node is None:
                if not self._has_place() and not self._forget_one():
                    continue
                node = self.nodes[number] = Node(number, self._garbling)
            node.add(messages if len(numbers) == 1 else messages.take(order[start:stop]))

    def _has_place(self) -> bool:
        """Tell whether one more number that has not described itself can be followed."""
        mute = sum(not node.changes for node in self.nodes.values())
        return mute < max(NODES_MAX - (len(self.nodes) - mute), MUTE_LEAST)

    def _forget_one(self) -> bool:
        """Give up the number with the fewest messages that never described itself: garbled ones must bar no node."""
        mute = [node for node in self.nodes.values() if not node.changes]
        if not mute:
            return False
        least = self.nodes.pop(min(mute, key=lambda node: node.messages).number)
        self.forgotten, self.forgotten_messages = self.forgotten + 1, self.forgotten_messages + least.messages
        return True

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        return sum(node.nbytes for node in self.nodes.values())

    def keep_within(self, each: int = NODE_BYTES, total: int = TOTAL_BYTES) -> int:
        """Have nodes that hold too much give up what waits; returns the bytes held after that.

        Each node may hold `each` bytes, all of them `total`; beyond, those that hold most come first.
        """
        held = {number: node.nbytes for number, node in self.nodes.items()}
        for number in [n for n, size in held.items() if size > each]:
            held[number] -= self.nodes[number].give_up()
        left = sum(held.values())
        for number in sorted(held, key=lambda n: -held[n]) if left > total else ():
            if left <= total:
                break
            left -= self.nodes[number].give_up()
        return left

    def close(self) -> None:
        """Finish what is under way; nothing more will come."""
        self._garbling.closed = True
        for node in self.nodes.values():
            node.close()

    def all_stopped(self) -> bool:
        """Tell whether every node that can be read has said goodbye, and there is one."""
        readable = [n for n in self.nodes.values() if n.problem is None and n.now is not None]
        return bool(readable) and all(n.stopped for n in readable)
