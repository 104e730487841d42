"""Follow every node on a bus: description, samples, snapshots, health."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.can.compact import merge_tail
from aeolid.can.configuration import Configuration
from aeolid.can.description import WIRE, DescriptionCollector
from aeolid.can.garbling import Garbling
from aeolid.can.health import Health
from aeolid.can.limits import CONFIGURATIONS_MAX, EARLY_MAX, PART_BYTES, PREVIOUS_KEPT
from aeolid.can.recount import find_recount
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import MarkovSnapshot, SnapshotStore
from aeolid.can.wire import (
    BEGIN,
    DESCRIPTION,
    END,
    HEALTH,
    KINDS,
    PARAMETER,
    PARAMETER_FD,
    REPAIR,
    REPAIR_FD,
    SAMPLE,
    SAMPLE_FD,
    SEAL_INNOVATION,
    STOPPED,
    Messages,
    join_messages,
)

__all__ = ["Configuration", "Node"]
RECOUNT, PART = (-1, 0), (-1, 1)  # stand for the head of a configuration that is known to be doubtful only
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
        self._index: int | None = None  # of the sample heard last, modulo 65536

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
        if (self.now is None or self._rumour is not None) and parts.any():
            if self._rumour is not None and self._rumour[:2] == RECOUNT and (at := self._contradicted(m)) is not None:
                self._rumour = (*PART, int(m.place[at]))
            self._describe(m.take(parts))
            m, parts = m.take(~parts), np.zeros(0, bool)
        if self.now is not None and self._rumour is None:
            self._follow(self.now, m)
        else:
            self._keep(m.take(~parts) if parts.any() else m)
            self._index = _last_sample(m, self._index)

    def _follow(self, now: Configuration, m: Messages) -> None:
        """Give messages to the configuration in force, those before something makes it doubtful."""
        is_sample = np.flatnonzero((m.kind == SAMPLE) | (m.kind == SAMPLE_FD))
        found = find_recount(m.index[is_sample], self._index, now.description.sample_every)
        anew, part = None if found is None else int(is_sample[found]), self._contradicted(m)
        at = min((x for x in (anew, part) if x is not None), default=len(m))
        sure = m.take(slice(0, at)) if at < len(m) else m
        described = sure.kind == DESCRIPTION
        self._use(now, sure.take(~described) if described.any() else sure)
        self._index = _last_sample(sure, self._index)
        if at < len(m):
            self._collector.forget()
            self._rumour = (*(PART if at == part else RECOUNT), int(m.place[at]))
            self._take(m.take(slice(at, len(m))))

    def _contradicted(self, m: Messages) -> int | None:
        """Return where a part of a description first differs from the one in force, on a quiet bus."""
        parts = np.flatnonzero((m.kind == DESCRIPTION) & (m.tag != WIRE))
        if not len(parts) or self.now is None:
            return None
        other = parts[self._collector.contradicts(m.tag[parts], m.index[parts], m.value[parts])]
        if len(other):
            other = other[self._garbling.is_quiet(m.place[other], m.place[other])]
        return int(other[0]) if len(other) else None

    def doubt(self) -> None:
        """Note that the node may have been set up anew: what follows waits until its head is heard."""
        if self.now is not None and self._rumour is None and not self.stopped:
            self._collector.forget()
            self._rumour = (*RECOUNT, self._garbling.frames)

    def configurations(self) -> list[Configuration]:
        """List all configurations that sent something, oldest first."""
        return [*self.previous, *([self.now] if self.now else [])]

    def latest_complete(self) -> MarkovSnapshot | None:
        """Return the newest complete snapshot."""
        return self.now.snapshots.complete if self.now else None

    def close(self) -> None:
        """Finish what is under way."""
        if self._rumour is not None and self.now is not None:
            told = self._rumour[:2] != RECOUNT  # a new count alone contradicts nothing
            if told and self._garbling.quiet_at(
                self._rumour[2]
            ):  # a new configuration that had no time to describe itself
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
            ends = (m.kind == HEALTH) & (m.tag == 0) & (m.index & STOPPED != 0)
            if ends.any() and self._rumour is not None and self._rumour[:2] == RECOUNT:
                self._deny()  # no head will come any more
        elif self.now is not None and self._rumour is not None and self._rumour[:2] == RECOUNT:
            self._deny()
            self._use(self.now, m)
        else:
            self.early_lost += len(m)

    def give_up(self) -> int:
        """Give up what waits, to save memory; returns how many bytes that were."""
        before = self.nbytes
        if self._rumour is not None and self._rumour[:2] == RECOUNT:
            self._deny()
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


def _last_sample(m: Messages, before: int | None) -> int | None:
    """Return the index of the newest sample, modulo 65536."""
    at = np.flatnonzero((m.kind == SAMPLE) | (m.kind == SAMPLE_FD))
    return int(m.index[at[-1]]) if len(at) else before
