"""Put parameter messages of one node together into snapshots of its Markov parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import Description
from aeolid.can.garbling import Garbling
from aeolid.can.gathering import Gathering
from aeolid.can.wire import BEGIN, Messages

Array = NDArray[np.float64]
RIVALS = 4  # snapshots under way at once; frames garbled past their check may bear any number
SWITCH = 3  # messages after which another snapshot number is believed to be the one being sent


@dataclass(frozen=True, eq=False)
class MarkovSnapshot:
    """Hold the filter's theta as one snapshot brought it.

    theta_scaled (l, n) binary32, the filter's own bits; theta (l, n) in the channels' units; NaN where missing.
    complete: every parameter is there and the CRC-32 over all of them fits. missing: indices output · n + regressor.
    sample_index: the last sample the filter had seen, None when it is not known for certain. repaired: parameters
    restored from repair frames. Values of a snapshot that is not complete are those that arrived on a quiet bus, or in
    CAN FD frames; others are NaN too.
    """

    theta_scaled: NDArray[np.float32]
    theta: Array
    description: Description
    complete: bool
    missing: tuple[int, ...]
    sample_index: int | None
    repaired: int


def physical(theta_scaled: Array, d: Description) -> Array:
    """Undo the filter's scaling: Xi_ij = scale_y_i / scale_c(j) theta_ij (markov.h).

    theta_scaled (l, n), columns oldest block [u; y] ([u; y; e] for varmax) first, present inputs last.
    """
    u, y = d.scale[: d.inputs], d.scale[d.inputs : d.inputs + d.outputs]
    block = np.concatenate([u, y, y] if d.model_set == "varmax" else [u, y])
    columns = np.concatenate([np.tile(block, d.past), u[list(d.feedthrough)]])  # (n,)
    result: Array = theta_scaled * y[:, None] / columns[None, :]
    return result


class SnapshotStore:
    """Assemble the snapshots of one configuration; keeps the latest complete one and the latest at all."""

    def __init__(self, description: Description, garbling: Garbling | None = None, node: int = 0) -> None:
        self._garbling = garbling
        self._node = node
        self.description = description
        self.complete: MarkovSnapshot | None = None
        self.completed = 0
        self.incomplete = 0
        self.damaged = 0  # all parameters there, CRC wrong
        self.repaired = 0  # parameters restored from repair frames
        self._open: dict[int, Gathering] = {}  # by number, the one touched last at the end
        self._last: MarkovSnapshot | tuple[Gathering, tuple[int, ...]] | None = None  # the latter not yet looked at

    @property
    def latest(self) -> MarkovSnapshot | None:
        """Return the newest snapshot, complete or not."""
        if isinstance(self._last, tuple):
            now, newest = self._last
            self._last = self._snapshot(now, False, newest)
        return self._last

    @property
    def nbytes(self) -> int:
        """Return the bytes that are held."""
        held = sum(gathering.nbytes for gathering in self._open.values())
        if isinstance(self._last, tuple):
            held += self._last[0].nbytes
        whole = {id(s): s for s in (self.complete, self._last) if isinstance(s, MarkovSnapshot)}
        return held + sum(s.theta_scaled.nbytes + s.theta.nbytes + 32 * len(s.missing) for s in whole.values())

    def give_up(self) -> int:
        """Forget what is under way, to save memory; returns how many bytes that were."""
        before = self.nbytes
        self.incomplete += sum(g.messages >= SWITCH and not g.done for g in self._open.values())
        self._open, self._last = {}, self.complete
        return before - self.nbytes

    def retire(self) -> None:
        """Forget all but the counters: the configuration is over, and nobody asks for its parameters."""
        self._open, self._last, self.complete = {}, None, None

    def add(self, messages: Messages, newest: Sequence[int]) -> None:
        """Take begin, parameter, repair and end messages in order; newest: what the newest sample index may be."""
        change = np.flatnonzero(np.diff(messages.tag)) + 1
        for start, stop in zip([0, *change.tolist()], [*change.tolist(), len(messages)], strict=True):
            if stop > start:
                self._run(messages.take(slice(start, stop)), newest)

    def close(self, newest: Sequence[int] = ()) -> None:
        """Finish what is under way with what there is."""
        for number in list(self._open):
            self._drop(number, newest)

    def _run(self, m: Messages, newest: Sequence[int]) -> None:
        """Take messages of one snapshot number."""
        number = int(m.tag[0])
        begins = m.value[m.kind == BEGIN]
        now = self._open.pop(number, None)
        if now is not None and now.begin is not None and len(begins) and int(begins[-1]) != now.begin:
            self._settle(now, newest)  # the node was restarted, or has counted round
            now = None
        if now is None:
            now = Gathering(number, self.description, self._node)
        self._open[number] = now
        now.messages += len(m)
        if now.messages >= SWITCH or len(self._open) > RIVALS:
            for other in list(self._open)[:-1]:
                self._drop(other, newest)
        if now.done:
            return
        now.take(m)
        if now.ends >= 3:
            self._settle(now, newest)
        elif now.may_be_complete():
            now.repair()
            if now.fits(newest):
                self._settle(now, newest)
            else:
                now.wait()

    def _drop(self, number: int, newest: Sequence[int]) -> None:
        self._settle(self._open.pop(number), newest)

    def _settle(self, now: Gathering, newest: Sequence[int]) -> None:
        """Judge an assembly once; a stray frame or two make no snapshot."""
        if now.done or now.messages < SWITCH:
            return
        now.repair()
        now.done = True
        self.repaired += now.repaired
        fits = now.fits(newest)
        self._last = now, tuple(newest)
        if fits:
            self._last = self.complete = self._snapshot(now, True, newest)
            self.completed += 1
        elif now.contradicted:
            self.damaged += 1
        else:
            self.incomplete += 1

    def _snapshot(self, now: Gathering, complete: bool, newest: Sequence[int]) -> MarkovSnapshot:
        d = self.description
        words, have = now.parameters()
        flat: NDArray[np.float32] = words.view(np.float32)
        believed = complete or (not now.contradicted and self._trusts(now))
        flat[~have | (not believed)] = np.nan
        scaled = flat.reshape(d.outputs, d.regressors)
        missing = tuple(np.flatnonzero(~have).tolist())
        return MarkovSnapshot(
            scaled, physical(scaled.astype(np.float64), d), d, complete, missing,
            now.sample_index(newest) if believed else None, now.repaired,
        )  # fmt: skip

    def _trusts(self, now: Gathering) -> bool:
        """Tell whether single parameters are believed: by their own CRC-32, or on a quiet bus."""
        if self.description.values_a_frame > 1 or self._garbling is None:
            return True
        return bool(self._garbling.is_quiet(np.array([now.first_place]), np.array([now.last_place]))[0])
