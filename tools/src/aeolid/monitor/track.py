"""Remember one node: its modes, Markov parameters and tests of innovations over time, in bounded memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.can.node import Configuration
from aeolid.can.snapshots import MarkovSnapshot
from aeolid.identify.live import LiveMode
from aeolid.monitor.history import History
from aeolid.monitor.innovations import Block, InnovationTest
from aeolid.monitor.wording import MOST_MODES

RECENT, WHOLE = 512, 512  # rows of modes and of tests
VALUES = 1 << 19  # Markov parameters kept in each half of their history; at least LEAST snapshots, at most RECENT
LEAST = 8
OUTSIDE_OF = 20  # blocks that are looked back on

Floats = NDArray[np.float32]
ModeRow = tuple[float, Floats]  # time, (modes, 5): number, frequency, its deviation, damping, its deviation
ThetaRow = tuple[float, Floats]  # time, theta scaled (l, n)
TestRow = tuple[float, Floats]  # time, (2, l): Q and F; of merged blocks the largest Q, and the F farthest from 1


class Track:
    """Hold what has been seen of one configuration of a node.

    Times are seconds of the controller. Where a node starts to count anew, its next run is put behind the one before:
    `start` is the time of sample 0 of the present run, `starts` those of all, the newest last.
    """

    def __init__(self, now: Configuration, start: float = 0.0) -> None:
        d = now.description
        self.now = now
        self.run = 0
        self.start, self.starts = start, [start]
        self.modes: History[ModeRow] = History(RECENT, WHOLE)
        self.tests: History[TestRow] = History(RECENT, WHOLE, _worse)
        half = int(np.clip(VALUES // d.parameters, LEAST, RECENT)) // 2 * 2
        self.thetas: History[ThetaRow] = History(half, half)
        self.newest: MarkovSnapshot | None = None
        self.last_s = start  # newest time that was seen
        self.block: Block | None = None
        self.blocks: list[NDArray[np.bool_]] = []  # which were outside, of the newest
        self.trouble = ""  # why the innovations cannot be tested
        self._test = InnovationTest(d)

    def enter(self, run: int) -> None:
        """Note the run that what follows belongs to."""
        if run != self.run:
            self.run = run
            self.start = self.last_s + self.now.description.sample_time_s
            self.starts = [*self.starts, self.start][-MOST_MODES:]
            self._test = InnovationTest(self.now.description)
            self.block, self.blocks = None, []

    def time_of(self, index: float) -> float:
        """Return the time of a sample of the present run."""
        return self.start + index * self.now.description.sample_time_s

    def take_modes(self, time_s: float, modes: tuple[LiveMode, ...]) -> None:
        """Remember the oscillating modes at a time of the controller."""
        rows = [
            (m.number, m.mode.frequency_hz, m.mode.frequency_std_hz, m.mode.damping, m.mode.damping_std)
            for m in oscillating(modes)
        ]
        at = self.start + time_s
        self.last_s = max(self.last_s, at)  # samples that came since the snapshot these modes are of are newer
        table = np.array(rows, dtype=np.float32).reshape(-1, 5)  # None becomes NaN
        self.modes.push((at, table))

    def take_snapshot(self, snapshot: MarkovSnapshot) -> None:
        """Remember Markov parameters; a snapshot without an index stands where the newest sample is."""
        if snapshot is self.newest:
            return
        self.newest = snapshot
        index = snapshot.sample_index
        self.thetas.push((self.last_s if index is None else self.time_of(index), snapshot.theta_scaled))
        self._test.snapshot(snapshot.theta, index)

    def take_samples(self, index: NDArray[np.int64], part: Any) -> None:
        """Test the innovations of samples."""
        self.last_s = max(self.last_s, self.time_of(int(index[-1])))
        if self.trouble:
            return
        try:
            blocks = self._test.add(index, *part)
        except (ValueError, ArithmeticError) as error:  # the modes go on
            self.trouble = str(error)
            return
        for block in blocks:
            self.block = block
            self.blocks = [*self.blocks, block.outside()][-OUTSIDE_OF:]
            table = np.stack([block.whiteness, block.ratio]).astype(np.float32)
            self.tests.push((self.time_of(block.index), table))

    @property
    def waiting(self) -> str:
        """Say what the test of the innovations waits for, empty where there is one."""
        return self.trouble or self._test.waiting

    @property
    def caution(self) -> str:
        """Say why alarms of the tests prove little; empty where they do."""
        return self._test.caution


def oscillating(modes: tuple[LiveMode, ...]) -> list[LiveMode]:
    """Return the modes that are shown: harmonics of the rotor and steady sines are not."""
    return [m for m in modes if m.is_shown][:MOST_MODES]


def _worse(older: TestRow, row: TestRow) -> TestRow:
    far = [
        np.where(np.isfinite(t) & (t > 0), abs(np.log(np.maximum(t, 1e-30))), -1.0) for t in (older[1][1], row[1][1])
    ]
    ratio = np.where(far[0] > far[1], older[1][1], row[1][1])
    return row[0], np.stack([np.fmax(older[1][0], row[1][0]), ratio])


def lag_table(values: Floats, now: Configuration) -> list[list[list[float | None]]]:
    """Sort parameters (l, n) by [output][channel][lag 0 … p]; None where there is no parameter (markov.h).

    Channels are those of a block: inputs, outputs, for VARMAX innovations.
    """
    d = now.description
    width = (values.shape[1] - len(d.feedthrough)) // d.past
    table = np.full((d.outputs, width, d.past + 1), np.nan)
    blocks = values[:, : d.past * width].reshape(d.outputs, d.past, width)  # oldest first: lag p … 1
    table[:, :, 1:] = blocks[:, ::-1].transpose(0, 2, 1)
    table[:, list(d.feedthrough), 0] = values[:, d.past * width :]
    return [[[round_to(x) for x in lags] for lags in row] for row in table.tolist()]


def column_of(channel: int, lag: int, now: Configuration) -> int | None:
    """Return the column of theta that holds a channel of a block at a lag, None where none does."""
    d = now.description
    width = (d.regressors - len(d.feedthrough)) // d.past
    if lag == 0:
        return d.past * width + d.feedthrough.index(channel) if channel in d.feedthrough else None
    return (d.past - lag) * width + channel if 1 <= lag <= d.past and 0 <= channel < width else None


def round_to(value: float, digits: int = 6) -> float | None:
    """Return a number as JSON can tell it, to so many digits; None where it is none."""
    return float(f"{value:.{digits}g}") if np.isfinite(value) else None
