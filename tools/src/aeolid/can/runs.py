"""Write the samples of nodes to disk while they stream: one file for each uninterrupted run of a node."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.can.clock import ClockFit, ClockPairs
from aeolid.can.node import Assembly, Configuration, Node
from aeolid.can.samples import SampleTable, follows
from aeolid.errors import DataError, UsageError
from aeolid.formats.growing import GrowingTable, growing_suffix, open_growing
from aeolid.record import Channel

Array = NDArray[np.float64]
KEEP = 4096  # samples that stay in memory: later frames may complete them, or say that they are not to be believed
EVERY_VALUES = 1 << 16  # values of a node after which what is older goes to the disk
FILL = 1 << 16  # missing rows that are written at once


def channels_of(configuration: Configuration) -> tuple[Channel, ...]:
    """Return the channels a node described."""
    d = configuration.description
    roles = ["input"] * d.inputs + ["output"] * d.outputs + ["scheduling"] * d.scheduling
    return tuple(Channel(n, u, r) for n, u, r in zip(d.names, d.units, roles, strict=True))


@dataclass(eq=False)
class Run:
    """Hold one uninterrupted run: sample indices first … last in steps, rows with NaN where something is missing.

    lost: values that never arrived. file, roles: where it was written, None where nothing was asked for.
    """

    configuration: Configuration
    first: int
    last: int
    rows: int = 0
    values: int = 0
    lost: int = 0
    file: Path | None = None
    roles: Path | None = None
    clock: ClockFit | None = None
    _table: GrowingTable | None = None
    _innovations: Any = None  # a nameless file of rows (l,) float64, scaled units, from sample `first` on
    _inside: int = 0  # rows in it
    ended: bool = False  # nothing more will be added
    _digest: Any = field(default_factory=hashlib.sha256)

    @property
    def table_path(self) -> Path | None:
        """Return where the rows are now."""
        return None if self._table is None else self._table.path

    @property
    def step(self) -> int:
        """Return how many samples lie between two rows."""
        return max(self.configuration.description.sample_every, 1)

    @property
    def sample_time_s(self) -> float:
        """Return the time between two rows."""
        return round(self.configuration.description.sample_time_s * self.step, 12)

    @property
    def sha256(self) -> str:
        """Return the hash of the values, as of a recording of them."""
        return str(self._digest.hexdigest())

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""
        return self._table is not None and self._table.full

    def goes_on(self, table: SampleTable) -> bool:
        """Tell whether a table continues this run."""
        return follows(int(table.index[0]), self.last, self.values, self.step)

    def append(self, table: SampleTable) -> None:
        """Add rows; samples missing in between become rows without a value. Raises OSError."""
        channels = table.values.shape[1]
        if self.rows:
            fresh = table.index > self.last
            if not fresh.all():
                table = SampleTable(table.index[fresh], table.values[fresh], table.lost)
            if not len(table.index):
                return
            until, stride = int(table.index[0]), FILL * self.step
            for k in range(self.last + self.step, until, stride):
                part = np.arange(k, min(k + stride, until), self.step)
                self._write(part, np.full((len(part), channels), np.nan))
                self.lost += len(part) * channels
        self._write(table.index, table.values)
        self.lost += table.lost
        self.values += table.values.size - table.lost

    def _write(self, index: NDArray[np.int64], values: Array) -> None:
        self.rows += len(index)
        self.last = int(index[-1])
        self._digest.update(np.ascontiguousarray(values).tobytes())
        if self._table is not None:
            time_s = np.round(index * self.configuration.description.sample_time_s, 9)
            self._table.write(np.column_stack([time_s, values]))

    def append_innovations(self, table: SampleTable, folder: Path) -> None:
        """Put innovations beside the rows they belong to; those of samples before the run are left out."""
        at = (table.index - self.first) // self.step
        inside = at >= self._inside
        if self.ended or not inside.any():
            return
        if self._innovations is None:
            self._innovations = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 (held open until the run is written)
        self._pad(int(at[inside][0]), table.values.shape[1])
        self._innovations.write(np.ascontiguousarray(table.values[inside]).tobytes())
        self._inside = int(at[inside][-1]) + 1

    def _pad(self, until: int, outputs: int) -> None:
        while self._inside < until:
            count = min(until - self._inside, FILL)
            self._innovations.write(np.full((count, outputs), np.nan).tobytes())
            self._inside += count

    def innovations(self, scale: Array) -> Array:
        """Return the innovations (rows, l) in the channels' units, NaN where the node sent none; kept on the disk.

        scale (l,): of the outputs.
        """
        outputs = len(scale)
        if self._innovations is None:
            nothing: Array = np.broadcast_to(np.nan, (self.rows, outputs))
            return nothing
        self._pad(self.rows, outputs)
        self._innovations.flush()
        result = np.memmap(self._innovations, np.float64, "r+", shape=(self.rows, outputs))
        for k in range(0, self.rows, FILL):
            result[k : k + FILL] *= scale
        return result

    def end(self) -> None:
        """Complete the file under the name it has so far, once. Raises OSError."""
        if self._table is not None and not self.ended:
            start = None if self.clock is None else datetime.fromtimestamp(self.clock.start_utc, UTC)
            self._table.close(start, _notes(self.clock))
        self.ended = True

    def drop_innovations(self) -> None:
        """Give up the innovations: only those of a node's last run are asked for."""
        if self._innovations is not None:
            self._innovations.close()
            self._innovations = None

    def finish(self, target: Path | None) -> None:
        """Complete the file, give it its name and write its roles. Raises OSError."""
        self.end()
        if self._table is None or target is None:
            return
        output.adopt(self._table.path, target)
        self.file = target
        self.roles = write_roles(target, channels_of(self.configuration), self.sample_time_s, self.clock)


def _notes(fit: ClockFit | None) -> dict[str, str]:
    if fit is None:
        return {}
    notes = {"time": "the controller's own: sample index times sample time"}
    if fit.is_real_time:
        notes["clock_drift_ppm"] = f"{fit.drift_ppm:.3f}"
        notes["clock_drift_half_width_ppm"] = f"{fit.half_width_ppm:.3f}"
    return notes


def write_roles(path: Path, channels: tuple[Channel, ...], sample_time_s: float, fit: ClockFit | None) -> Path:
    """Write NAME.roles.toml beside a recording; returns its path. Raises OSError."""
    roles = path.with_name(path.name.split(".")[0] + ".roles.toml")
    lines = []
    if fit is not None:
        when = datetime.fromtimestamp(fit.start_utc, UTC).isoformat(timespec="milliseconds")
        lines.append(f"# time_s = 0 was {when} on the receiving host's clock")
        if fit.is_real_time and fit.drift_ppm is not None:
            lines.append(f"# a second of the controller is {1 + 1e-6 * fit.drift_ppm:.9f} s of the host")
    lines += ["[recording]", f"sample_time_s = {sample_time_s!r}", 'time = "time_s"', ""]
    for c in channels:
        lines += ["[[channel]]"] + [f"{key} = {_quote(getattr(c, key))}" for key in ("name", "unit", "role")] + [""]
    output.write_text(roles, "\n".join(lines))
    return roles


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # a JSON string without control characters and \\u pairs is a TOML one


class RunRecorder:
    """Take finished samples out of an assembly and write them; what stays in memory is bounded."""

    def __init__(self, target: Path | None, *, innovations: Path | None = None, only: int | None = None) -> None:
        """Prepare. target: name of the recording, None to count only; innovations: folder to keep them in meanwhile."""
        self.runs: dict[int, list[Run]] = {}
        self._target, self._folder, self._only = target, innovations, only
        self.clocks: Callable[[int], list[ClockPairs]] | None = None  # of a node; with it, runs that are over are ended
        self._seen: dict[int, int] = {}  # node -> values that had arrived at the last look

    @property
    def target(self) -> Path | None:
        """Return the name of the recording, None where only counts are kept."""
        return self._target

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""
        return any(runs[-1].full for runs in self.runs.values() if runs)

    def poll(self, assembly: Assembly, now: bool = False) -> None:
        """Write what is old enough of nodes that have sent enough since the last look, or of all. Raises DataError."""
        for node in assembly.nodes.values():
            arrived = sum(c.samples.arrived for c in node.configurations())
            stale = any(not (c.samples.is_empty() and c.innovations.is_empty()) for c in node.previous)
            if now or stale or arrived - self._seen.get(node.number, 0) >= EVERY_VALUES:
                self._seen[node.number] = arrived
                self._drain(node, KEEP)

    def finish(self, assembly: Assembly) -> None:
        """Take all that is left; the files wait for `name`. Raises DataError."""
        for node in assembly.nodes.values():
            self._drain(node, 0)

    def _drain(self, node: Node, keep: int) -> None:
        wanted = self._only is None or node.number == self._only
        for configuration in node.configurations():
            every = configuration.description.sample_every
            amount = keep if configuration is node.now else 0
            tables = configuration.samples.release(amount, every)
            innovations = configuration.innovations.release(amount, every)
            if wanted:
                self._append(node.number, configuration, tables)
                self._append_innovations(node.number, configuration, innovations)

    def _append(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        runs = self.runs.setdefault(number, [])
        for table in tables:
            try:
                if not runs or runs[-1].configuration is not configuration or not runs[-1].goes_on(table):
                    self._settle(number)
                    runs.append(self._open(number, len(runs) + 1, configuration, table))
                runs[-1].append(table)
            except OSError as error:
                raise DataError(f"{self._target}: nothing more can be written ({error.strerror or error})") from None

    def _open(self, number: int, k: int, configuration: Configuration, table: SampleTable) -> Run:
        first = int(table.index[0])
        run = Run(configuration, first, first)
        if self._target is not None:
            suffix = growing_suffix(self._target) or ""
            stem = self._target.name[: len(self._target.name) - len(suffix)]
            channels = channels_of(configuration)
            path = self._target.with_name(f"{stem}.node{number}.run{k}.part{suffix}")
            names = ["time_s", *(c.name for c in channels)]
            try:
                run._table = open_growing(path, suffix, names, ["s", *(c.unit for c in channels)])
            except UsageError as error:  # it could be written to when the reception began
                raise DataError(str(error)) from None
        return run

    def _append_innovations(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        runs = [run for run in self.runs.get(number, []) if run.configuration is configuration]
        if self._folder is None or not runs:
            return
        for table in tables:
            runs[-1].append_innovations(table, self._folder)

    def name(self, number: int, tag: str) -> None:
        """Complete the files of a node and give them their names. Raises DataError."""
        runs = self.runs.get(number, [])
        for k, run in enumerate(runs):
            try:
                run.finish(with_tag(self._target, tag + (f"-run{k + 1}" if len(runs) > 1 else "")))
            except OSError as error:
                raise DataError(f"{self._target}: cannot be completed ({error.strerror or error})") from None
            except UsageError as error:  # the name was taken meanwhile: the rows stay where they are
                raise DataError(f"{error}; they are in {run.table_path}") from None

    def _settle(self, number: int) -> None:
        """Complete the file of a node's newest run: one that starts again and again must not use up all handles."""
        if self.clocks is not None:
            self.date(number, self.clocks(number))
            for run in self.runs[number][-1:]:
                run.drop_innovations()
                run.end()

    def date(self, number: int, clocks: list[ClockPairs]) -> None:
        """Give each run of a node that is not complete yet the clock whose samples are its own."""
        shifts: dict[int, int] = {}
        for run in reversed([run for run in self.runs.get(number, []) if not run.ended]):
            for pairs in reversed(clocks):
                assert pairs.last is not None
                index, _ = pairs.pairs()
                turn = round((run.last - pairs.last[0]) / 65536) * 65536
                shift = shifts.get(id(pairs), turn)
                if index[0] + shift <= run.last and index[-1] + shift >= run.first:
                    shifts[id(pairs)] = shift
                    run.clock = pairs.fit(shift)
                    break


def with_tag(path: Path | None, tag: str) -> Path | None:
    """Put a tag behind the first part of a file's name."""
    if path is None:
        return None
    stem, dot, rest = path.name.partition(".")
    return path.with_name(stem + tag + dot + rest)
