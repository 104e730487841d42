"""Receive from a source until something ends it: decode, log raw frames, write samples, follow the nodes' clocks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from aeolid.can.assembly import Assembly
from aeolid.can.clock import ClockKeeper
from aeolid.can.limits import FLUSH_S, GATHER_FRAMES, GATHER_S, HELD_SPARE, TOTAL_BYTES
from aeolid.can.raw_log import RawLog
from aeolid.can.runs import RunRecorder
from aeolid.can.source import Source
from aeolid.can.wire import BASE, ERROR, EXTENDED, FAST, FD, GARBLED, Frames, join_frames
from aeolid.errors import DataError

LOOK_S = FLUSH_S  # how often samples are taken out, however few have come
DRAIN_S = 1.0
WEIGH_FRAMES = 8192  # after which memory is looked at, whatever the time


class Memory:
    """Hold how many bytes a reception holds of what has come, and the most so far."""

    def __init__(self) -> None:
        self.now = self.peak = self.given_up = 0
        self._at = 0  # frames at the last look

    def look(self, assembly: Assembly, clocks: ClockKeeper, frames: int, due: bool) -> None:
        """Weigh what is held, and have nodes give up what waits where it is too much."""
        if not due and frames - self._at < WEIGH_FRAMES:
            return
        self._at = frames
        before = assembly.nbytes
        left = assembly.keep_within(total=TOTAL_BYTES)
        self.given_up += max(before - left, 0)
        clocks.forget(assembly.nodes.keys())
        self.now = left + clocks.nbytes
        self.peak = max(self.peak, self.now)


class Reception:
    """Hold what one reception has found so far; `seconds` and `frames` grow while `run` runs."""

    def __init__(
        self,
        source: Source,
        recorder: RunRecorder,
        log: RawLog | None = None,
        *,
        bit_rate: float,
        data_bit_rate: float,
        base: int = BASE,
    ) -> None:
        """Prepare. bit_rate, data_bit_rate: of the bus, 1/s, for the load that is shown; base: of the identifiers."""
        self.source, self.recorder, self.log = source, recorder, log
        self.assembly, self.clocks = Assembly(base), ClockKeeper(base)
        self.lock = threading.Lock()  # held while the state changes: the display reads it in a thread of its own
        recorder.clocks = self.clocks.runs
        self.watch: Callable[[Assembly, bool], None] | None = (
            None  # sees samples before they are written; at the end too
        )
        self.frames = 0  # of anybody
        self.errors = 0  # error frames: the bus is disturbed, or a controller has gone off it
        self.busy_s = 0.0  # what they took on the bus at most
        self.fault: str | None = None  # why nothing more could be written
        self.memory = Memory()
        self._spare: bytearray | None = bytearray(HELD_SPARE)  # set free when there is no memory left
        self.began = self.ended = time.monotonic()
        self.gather_s = GATHER_S
        self._rates = bit_rate, data_bit_rate
        self._looked = self.began
        self._interruptions = source.interruptions

    @property
    def seconds(self) -> float:
        """Return how long it has lasted, s."""
        return max(self.ended, time.monotonic() if self.ended == self.began else self.ended) - self.began

    def run(self, stop: Callable[[], bool], seconds: float | None, until_end: bool) -> str:
        """Receive until something ends it; returns end, time, stopped, full, or the reason why the bus broke off.

        stop: asked between batches. Whatever the source had delivered by then is decoded and logged. Where memory ends,
        reception does, as with a full disk.
        """
        reason = self._loop(stop, seconds, until_end)
        with self.lock:
            self.ended = time.monotonic()
            try:
                self.assembly.close()
                if self.watch is not None:
                    self.watch(self.assembly, True)
                self.recorder.finish(self.assembly)
            except (DataError, OSError) as error:  # most of it is on the disk, shown, and stays as far as it went
                self.fault, reason = self.fault or (str(error) if reason != "full" else None), "full"
            except MemoryError:
                reason = self._no_memory()
        return reason

    def _no_memory(self) -> str:
        """Set free what was kept for this case; what has been written is completed with it."""
        self._spare = None
        self.fault = self.fault or f"{self.source.name}: no memory is left on this machine"
        self.assembly.keep_within(0, 0)
        return "full"

    def _gather(self) -> Frames:
        """Read what comes within a moment: on a busy bus a batch of a few frames costs more than they do."""
        frames = self.source.read(0.1)
        if self.source.is_log or not 0 < len(frames) < GATHER_FRAMES or not self.gather_s:
            return frames
        parts, until = [frames], time.monotonic() + self.gather_s
        count = len(frames)
        while count < GATHER_FRAMES and self.source.ended is None and (left := until - time.monotonic()) > 0:
            more = self.source.read(left)
            if not len(more):
                break
            parts.append(more)
            count += len(more)
        return join_frames(parts)

    def _loop(self, stop: Callable[[], bool], seconds: float | None, until_end: bool) -> str:
        source, assembly = self.source, self.assembly
        while True:
            try:
                self._take(self._gather())
            except (DataError, OSError) as error:
                self.fault = str(error)
                return "full"
            except MemoryError:
                return self._no_memory()
            if self.recorder.full or (self.log is not None and self.log.full):
                return "full"
            if source.ended is not None:
                return "end" if source.is_log or assembly.all_stopped() else source.ended
            if until_end and assembly.all_stopped():
                self._drain()
                return "end"
            if seconds is not None and time.monotonic() - self.began >= seconds:
                return "time"
            if stop():
                return "stopped"

    def _drain(self) -> None:
        """Take what nodes still had under way: a goodbye is several frames; others may go on talking."""
        until = time.monotonic() + DRAIN_S
        while self.source.ended is None and time.monotonic() < until:
            frames = self.source.read(0.1)
            if not len(frames):
                return
            self._take(frames)

    def _take(self, frames: Frames) -> None:
        with self.lock:
            self._digest(frames)

    def _digest(self, frames: Frames) -> None:
        if self.source.interruptions != self._interruptions:
            self._interruptions = self.source.interruptions
            self.assembly.doubt()
        if len(frames):
            if self.log is not None:
                self.log.write(frames)
            self.frames += int(np.count_nonzero(frames.flags & (ERROR | GARBLED) == 0))
            self.errors += int(np.count_nonzero(frames.flags & ERROR))
            self.busy_s += time_on_bus(frames, *self._rates)
            self.assembly.feed(frames)
            described = {n.number: n.now.description for n in self.assembly.nodes.values() if n.now is not None}
            self.clocks.feed(frames, {number: d.sample_time_s for number, d in described.items()})
        now = time.monotonic()
        due = now - self._looked >= LOOK_S
        if due:
            self._looked = now
        if self.watch is not None:
            self.watch(self.assembly, False)
        self.recorder.poll(self.assembly, due)
        if due and self.log is not None:
            self.log.flush()
        self.memory.look(self.assembly, self.clocks, self.frames, due)


def time_on_bus(frames: Frames, bit_rate: float, data_bit_rate: float) -> float:
    """Return how long frames take at most, s: worst-case bit stuffing and the space between frames (ISO 11898-1)."""
    length = frames.length.astype(np.int64)
    extended, fd = frames.flags & EXTENDED > 0, frames.flags & FD > 0
    # classic: 34 or 54 bits from start to CRC are stuffed with the data, one in four at worst; 13 are not
    stuffed = np.where(extended, 54, 34) + 8 * length
    classic = stuffed + 13 + (stuffed - 1) // 4
    # FD (frame.h derives it): 17 or 36 bits at the nominal rate, one in four stuffed, and 15 after the CRC; the payload
    # has the other stuffed bits of the whole, and a check of stuff count, CRC of 17 or 21 bits and fixed stuffing
    head, head_stuff = np.where(extended, 36, 17), np.where(extended, 8, 4)
    payload = 5 + 8 * length
    payload = payload + (head + payload - 1) // 4 - head_stuff + np.where(length > 16, 4 + 21 + 7, 4 + 17 + 6)
    fast = frames.flags & FAST > 0
    long = (head + head_stuff + 15) / bit_rate + payload / np.where(fast, data_bit_rate, bit_rate)
    return float(np.where(fd, long, classic / bit_rate).sum())
