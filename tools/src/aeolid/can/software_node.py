"""Run the compiled node, the C filters in a process of their own, and feed it with samples."""

from __future__ import annotations

import signal
import subprocess
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import AeolidError, DataError, UsageError
from aeolid.native import find_native
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
PATIENCE_S = 20.0  # from an interrupt to the last snapshot; the node itself gives up on listeners after 5 s
CHUNK = 256


@dataclass(frozen=True, eq=False)
class Feed:
    """Hold what a node is fed with.

    rows: blocks (k, 2 + r + l) of index, time in s, inputs, outputs; NaN where missing. offset, scale (r + l,).
    """

    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    offset: Array
    scale: Array
    sample_time_s: float
    samples: int
    rows: Iterable[Array]


def feed_from_record(record: Record, samples: int | None = None) -> Feed:
    """Feed a recording; offset and scale are its mean and standard deviation, as `aeolid filter` takes them.

    Without inputs the node's filter is an autoregression of the outputs. Raises DataError for a recording without
    outputs, or with a constant or empty channel.
    """
    inputs, outputs = record.of("input"), record.of("output")
    if not outputs:
        raise DataError(f"{record.source}: a node needs at least one output channel in the roles")
    values = record.columns([c.name for c in inputs + outputs])
    for channel, column in zip(inputs + outputs, values.T, strict=True):
        finite = column[np.isfinite(column)]
        if not finite.size or np.ptp(finite) == 0:
            state = "constant" if finite.size else "empty"
            raise DataError(f"{record.source}: channel {channel.name!r} is {state}; give it the role ignore")
    finite_values = np.where(np.isfinite(values), values, np.nan)
    count = len(record) if samples is None else min(samples, len(record))
    table = np.column_stack([np.arange(len(record)), record.time_s - record.time_s[0], values])[:count]
    rows = (table[k : k + CHUNK] for k in range(0, count, CHUNK))
    return Feed(
        inputs, outputs, np.nanmean(finite_values, axis=0), np.nanstd(finite_values, axis=0), record.sample_time_s,
        count, rows,
    )  # fmt: skip


def feed_from_turbine(samples: int, seed: int) -> Feed:
    """Feed the built-in turbine in its closed loop, simulated sample by sample while the node runs.

    The scales are those of a short run with another seed: a controller knows the size of its signals beforehand.
    """
    from aeolid.plants import hawt

    channels = hawt.roles().channels
    inputs = tuple(c for c in channels if c.role == "input")
    outputs = tuple(c for c in channels if c.role == "output")
    trial = hawt.simulate_closed_loop(1000, seed + 1_000_003)
    scale = trial.columns([c.name for c in inputs + outputs]).std(axis=0)
    loop = hawt.ClosedLoop(seed)

    def rows() -> Iterator[Array]:
        for k in range(samples):
            time_s, u, y = loop.step()
            yield np.concatenate([[k, time_s], u, y])[None, :]

    return Feed(inputs, outputs, np.zeros(len(scale)), scale, hawt.SAMPLE_TIME_S, samples, rows())


class SoftwareNode:
    """Own the node process from its start to its last word."""

    def __init__(self, feed: Feed, options: list[str]) -> None:
        """Start the process; options are those of port/posix/node_options.h but for the channels and sample time."""
        arguments = [str(find_native("aeolid-node")), "--sample-time", repr(feed.sample_time_s), *options]
        channels = [("--input", c) for c in feed.inputs] + [("--output", c) for c in feed.outputs]
        for (option, channel), offset, scale in zip(channels, feed.offset.tolist(), feed.scale.tolist(), strict=True):
            arguments += [option, channel.name, channel.unit, repr(offset), repr(scale)]
        self.fed = 0
        self._interrupted = False
        self._process = subprocess.Popen(
            arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0
        )
        self._said: deque[str] = deque(maxlen=20)
        self._reader = threading.Thread(target=self._listen, args=(self._process.stderr,), daemon=True)
        self._reader.start()
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().decode().strip()
        if not self.address:
            raise self._died()

    def feed(self, rows: Array) -> None:
        """Hand over samples (k, 2 + r + l); waits while the node is busy. Raises DataError when the node has died."""
        assert self._process.stdin is not None
        data = memoryview(np.ascontiguousarray(rows, "<f8").tobytes())
        try:
            while data:  # an unbuffered pipe may take a part only
                data = data[self._process.stdin.write(data) or 0 :]
        except BrokenPipeError:
            if self._process.poll() is None and self._stopping():
                return
            raise self._died() from None
        self.fed += len(rows)

    def finish(self) -> str:
        """End the input, wait until the node has used it up and sent its last snapshot; returns its health line."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            code = self._process.wait(PATIENCE_S if self._interrupted else None)
        except subprocess.TimeoutExpired:
            self.kill()
            raise DataError(f"the node process did not end within {PATIENCE_S:.0f} s of the interrupt") from None
        self._reader.join(1.0)
        if code != 0:
            raise self._died()
        return next((line[7:] for line in reversed(self._said) if line.startswith("health ")), "{}")

    def interrupt(self) -> None:
        """Ask the node to stop now and send what is under way."""
        self._interrupted = True
        with suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """End the process for certain and collect it."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                with suppress(BrokenPipeError):
                    pipe.close()

    def _listen(self, pipe: IO[bytes] | None) -> None:
        assert pipe is not None
        for line in pipe:
            self._said.append(line.decode("utf-8", "replace").rstrip())

    def _stopping(self) -> bool:
        """Tell whether the node has closed its input because it was asked to stop."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE_S)
        return self._process.returncode == 0

    def _died(self) -> AeolidError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)
        self._reader.join(1.0)
        code = self._process.poll()
        words = next((s.removeprefix("aeolid-node: ") for s in reversed(self._said) if not s.startswith("health ")), "")
        if code == 2:
            return UsageError(words)
        how = f"was killed by signal {-code}" if code is not None and code < 0 else f"ended with code {code}"
        return DataError(f"the node process {how} after {self.fed} samples" + (f": {words}" if words else ""))
