"""Put parameter messages of one node together into snapshots of its Markov parameters."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.can.description import Description
from aeolid.can.repair import restore
from aeolid.can.wire import BEGIN, END, PARAMETER, REPAIR, Messages

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MarkovSnapshot:
    """Hold the filter's theta as one snapshot brought it.

    theta_scaled (l, n) binary32, the filter's own bits; theta (l, n) in the channels' units; NaN where missing.
    complete: every parameter is there and the CRC-32 over all of them fits. missing: indices output · n + regressor.
    sample_index: the last sample the filter had seen, None when neither frame that tells it arrived. repaired:
    parameters restored from repair frames.
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


class _Assembly:
    """Hold one snapshot under way."""

    def __init__(self, number: int, count: int) -> None:
        self.number = number
        self.values = np.zeros(count, np.uint32)
        self.have = np.zeros(count, bool)
        self.repairs: dict[int, int] = {}
        self.repaired = 0
        self.begin: int | None = None
        self.low: int | None = None
        self.crc: int | None = None
        self.ends = 0
        self.done = False

    def crc_fits(self) -> bool:
        """Tell whether the values are those the checksum was made of."""
        return self.crc is not None and zlib.crc32(self.values.astype("<u4").tobytes()) == self.crc

    def repair(self) -> None:
        """Restore missing parameters from the repair frames."""
        if not self.have.all() and self.repairs:
            before = int(np.count_nonzero(self.have))
            restore(self.values, self.have, self.repairs)
            self.repaired += int(np.count_nonzero(self.have)) - before

    def sample_index(self, newest: int | None) -> int | None:
        if self.begin is not None or self.low is None or newest is None:
            return self.begin
        return newest + (self.low - newest + 32768) % 65536 - 32768


class SnapshotStore:
    """Assemble the snapshots of one configuration; keeps the latest complete one and the latest at all."""

    def __init__(self, description: Description) -> None:
        self.description = description
        self.complete: MarkovSnapshot | None = None
        self.latest: MarkovSnapshot | None = None
        self.completed = 0
        self.incomplete = 0
        self.damaged = 0  # all parameters there, CRC wrong
        self.repaired = 0  # parameters restored from repair frames
        self._now: _Assembly | None = None

    def add(self, messages: Messages, newest: int | None) -> None:
        """Take begin, parameter, repair and end messages in the order of arrival; newest sample index so far."""
        change = np.flatnonzero(np.diff(messages.tag)) + 1
        for start, stop in zip([0, *change.tolist()], [*change.tolist(), len(messages)], strict=True):
            if stop > start:
                self._run(messages.take(np.arange(start, stop)), newest)

    def close(self, newest: int | None = None) -> None:
        """Finish the snapshot under way with what there is."""
        if self._now is not None and not self._now.done:
            self._settle(self._now, newest)
        self._now = None

    def _run(self, m: Messages, newest: int | None) -> None:
        """Take messages of one snapshot number."""
        begins = m.value[m.kind == BEGIN]
        number = int(m.tag[0])
        now = self._now
        restarted = now is not None and now.begin is not None and len(begins) and int(begins[-1]) != now.begin
        if now is None or now.number != number or restarted:
            self.close(newest)
            now = self._now = _Assembly(number, self.description.parameters)
        if now.done:
            return
        if len(begins):
            now.begin = int(begins[-1])
        self._take(now, m)
        complete = bool(now.have.all())
        if now.crc is not None and (complete or now.ends >= 2):
            now.repair()
            if now.have.all() or now.ends >= 3:
                self._settle(now, newest)

    def _take(self, now: _Assembly, m: Messages) -> None:
        is_parameter = (m.kind == PARAMETER) & (m.index < self.description.parameters)
        index = m.index[is_parameter]
        now.values[index] = m.value[is_parameter]
        now.have[index] = True
        for at in np.flatnonzero(m.kind == REPAIR):
            now.repairs[int(m.index[at])] = int(m.value[at])
        ends = np.flatnonzero(m.kind == END)
        if len(ends):
            now.crc, now.low = int(m.value[ends[-1]]), int(m.index[ends[-1]])
            now.ends += len(ends)

    def _settle(self, now: _Assembly, newest: int | None) -> None:
        now.repair()
        now.done = True
        self.repaired += now.repaired
        whole = bool(now.have.all())
        fits = whole and now.crc_fits()
        snapshot = self._snapshot(now, fits, newest)
        self.latest = snapshot
        if fits:
            self.complete = snapshot
            self.completed += 1
        elif whole and now.crc is not None:
            self.damaged += 1
        else:
            self.incomplete += 1

    def _snapshot(self, now: _Assembly, complete: bool, newest: int | None) -> MarkovSnapshot:
        d = self.description
        flat = now.values.copy().view(np.float32)
        flat[~now.have] = np.nan
        scaled = flat.reshape(d.outputs, d.regressors)
        missing = tuple(np.flatnonzero(~now.have).tolist())
        return MarkovSnapshot(
            scaled, physical(scaled.astype(np.float64), d), d, complete, missing, now.sample_index(newest), now.repaired
        )
