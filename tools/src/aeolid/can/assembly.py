"""Decode the frames of a bus and hand them to its nodes."""

from __future__ import annotations

import numpy as np

from aeolid.can.garbling import Garbling
from aeolid.can.limits import MUTE_LEAST, NODE_BYTES, NODES_MAX, TOTAL_BYTES
from aeolid.can.node import Node
from aeolid.can.wire import BASE, ERROR, GARBLED, Frames, decode

__all__ = ["Assembly"]


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

    def doubt(self) -> None:
        """Note that the bus was away: nodes may have been set up anew meanwhile."""
        for node in self.nodes.values():
            node.doubt()

    def close(self) -> None:
        """Finish what is under way; nothing more will come."""
        self._garbling.closed = True
        for node in self.nodes.values():
            node.close()

    def all_stopped(self) -> bool:
        """Tell whether every node that can be read has said goodbye, and there is one."""
        readable = [n for n in self.nodes.values() if n.problem is None and n.now is not None]
        return bool(readable) and all(n.stopped for n in readable)
