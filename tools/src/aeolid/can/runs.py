"""Write the samples of nodes to disk while they stream: one file for each uninterrupted run of a node."""

from __future__ import annotations

import glob
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
from aeolid.can.limits import FILES_MAX, FILL_SHARE, INNOVATIONS_AHEAD, RUN_LEAST, RUNS_MAX
from aeolid.can.node import Assembly, Configuration, Node
from aeolid.can.tables import SampleTable, follows
from aeolid.errors import DataError, UsageError
from aeolid.formats.growing import GrowingTable, growing_suffix, open_growing
from aeolid.record import Channel

Array = NDArray[np.float64]
KEEP = 64  # samples that stay in memory: later frames may complete them
PATIENCE = 512  # times as many that wait for a full index
LEAST = 512  # messages that are worth being taken out; what waits is shown in the files all the same
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

    lost: values that never arrived. found: rows with a value. file, roles: where it was written, None where nothing was
    asked for. `path`, names and units say where rows go until then; the file is made with the first that are shown, or
    once there are RUN_LEAST.
    """

    configuration: Configuration
    first: int
    last: int
    rows: int = 0
    values: int = 0
    found: int = 0
    lost: int = 0
    file: Path | None = None
    roles: Path | None = None
    clock: ClockFit | None = None
    path: Path | None = None
    _table: GrowingTable | None = None
    _waiting: list[Array] = field(default_factory=list)  # rows before there is a file
    _part_roles: Path | None = None
    _ahead: SampleTable | None = None  # innovations of samples that have not been written yet
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
        """Tell whether a table continues this run; where nothing has been written yet, any does."""
        first = int(table.index[0])
        if not self.rows:
            return True
        return follows(first, self.last, self.found, self.step, self.rows - self.found, FILL_SHARE)

    @property
    def is_short(self) -> bool:
        """Tell whether it has too few samples to be a recording when another run follows."""
        return self.found < RUN_LEAST

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
        else:
            self.first = int(table.index[0])
        self._write(table.index, table.values)
        self.lost += table.lost
        self.values += table.values.size - table.lost
        self.found += int(np.count_nonzero(np.isfinite(table.values).any(axis=1)))
        if self.found >= RUN_LEAST:
            self._begin()

    def _begin(self) -> None:
        """Make the file, with its roles beside it. Raises OSError."""
        if self._table is not None or self.path is None or self.ended:
            return
        channels = channels_of(self.configuration)
        names, units = ["time_s", *(c.name for c in channels)], ["s", *(c.unit for c in channels)]
        try:
            self._table = open_growing(self.path, growing_suffix(self.path) or "", names, units)
        except UsageError as error:  # it could be written to when the reception began
            raise DataError(str(error)) from None
        stem = self.path.name.split(".part")[0]
        self._part_roles = write_roles(self.path.with_name(stem), channels, self.sample_time_s, None, whole=True)
        for rows in self._waiting:
            self._table.write(rows)
        self._waiting = []

    def show(self, table: SampleTable | None) -> None:
        """Put rows on the disk, behind those that stay, that later frames may still change. Raises OSError."""
        if self.path is None or self.ended or (table is None and self._table is None):
            return
        self._begin()
        assert self._table is not None
        if table is None:
            self._table.show(np.zeros((0, 1 + self.configuration.description.channels)))
            return
        fresh = table.index > self.last if self.rows else np.ones(len(table.index), bool)
        self._table.show(self._rows(table.index[fresh], table.values[fresh]))

    def _rows(self, index: NDArray[np.int64], values: Array) -> Array:
        time_s = np.round(index * self.configuration.description.sample_time_s, 9)
        return np.column_stack([time_s, values])

    def drop(self) -> None:
        """Give the run up and remove its file. Raises OSError."""
        self.drop_innovations()
        self._waiting, self._ahead, self.ended = [], None, True
        if self._table is not None:
            self._table.drop()
        self._forget_part_roles()

    def _forget_part_roles(self) -> None:
        if self._part_roles is not None:
            self._part_roles.unlink(missing_ok=True)
            self._part_roles = None

    def _write(self, index: NDArray[np.int64], values: Array) -> None:
        self.rows += len(index)
        self.last = int(index[-1])
        self._digest.update(np.ascontiguousarray(values).tobytes())
        if self._table is not None:
            self._table.write(self._rows(index, values))
        elif self.path is not None:
            self._waiting.append(self._rows(index, values))

    def append_innovations(self, tables: list[SampleTable], folder: Path) -> None:
        """Put innovations beside the rows they belong to; those of samples before the run are left out.

        What is ahead of the samples that were written waits for them, as far as samples are ever ahead; more is forged.
        """
        for table in [*([] if self._ahead is None else [self._ahead]), *tables]:
            self._put_innovations(table, folder)

    def _put_innovations(self, table: SampleTable, folder: Path) -> None:
        at = (table.index - self.first) // self.step
        ahead = table.index > self.last
        near = ahead & (table.index <= self.last + INNOVATIONS_AHEAD * self.step)
        self._ahead = SampleTable(table.index[near], table.values[near], 0) if near.any() else None
        inside = (at >= self._inside) & ~ahead
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
        if not self.ended and self._waiting:
            self._begin()
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
        self._forget_part_roles()
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


def write_roles(
    path: Path, channels: tuple[Channel, ...], sample_time_s: float, fit: ClockFit | None, *, whole: bool = False
) -> Path:
    """Write NAME.roles.toml beside a recording; returns its path. whole: NAME goes to the end. Raises OSError."""
    roles = path.with_name((path.name if whole else path.name.split(".")[0]) + ".roles.toml")
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
    """Take finished samples out of an assembly and write them; what stays in memory is bounded.

    What later frames may still change is shown in the files too, so that a process that is killed leaves all that had
    come until a second before. short, refused: runs that were left out, and their samples: too short, or too many.
    """

    def __init__(self, target: Path | None, *, innovations: Path | None = None, only: int | None = None) -> None:
        """Prepare. target: name of the recording, None to count only; innovations: folder to keep them in meanwhile."""
        self.runs: dict[int, list[Run]] = {}
        self._target, self._folder, self._only = target, innovations, only
        self.clocks: Callable[[int], list[ClockPairs]] | None = None  # of a node; with it, runs that are over are ended
        self.short: dict[int, list[int]] = {}
        self.refused: dict[int, list[int]] = {}
        self._seen: dict[int, int] = {}  # node -> values that had arrived at the last look
        self._begun: dict[int, int] = {}  # node -> runs begun
        self._shown: dict[int, int] = {}  # node -> values that had arrived when its newest rows were shown

    @property
    def target(self) -> Path | None:
        """Return the name of the recording, None where only counts are kept."""
        return self._target

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""
        return any(run.full for runs in self.runs.values() for run in runs[-2:])

    def poll(self, assembly: Assembly, now: bool = False) -> None:
        """Write what is old enough of nodes that have sent enough since the last look, or of all. Raises DataError."""
        for node in assembly.nodes.values():
            arrived = sum(c.samples.arrived for c in node.configurations())
            stale = any(not (c.samples.is_empty() and c.innovations.is_empty()) for c in node.previous)
            if now or stale or arrived - self._seen.get(node.number, 0) >= EVERY_VALUES:
                self._seen[node.number] = arrived
                self._drain(node, KEEP)
                node.tidy()
                if now and arrived != self._shown.get(node.number):
                    self._shown[node.number] = arrived
                    self._show(node)

    def finish(self, assembly: Assembly) -> None:
        """Take all that is left; the files wait for `name`. Raises DataError."""
        for node in assembly.nodes.values():
            self._drain(node, 0)

    def _drain(self, node: Node, keep: int) -> None:
        wanted = self._only is None or node.number == self._only
        for configuration in node.configurations():
            every = configuration.description.sample_every
            amount = keep if configuration is node.now else 0
            limits = {"patience": PATIENCE, "share": FILL_SHARE, "least": LEAST}
            tables = configuration.samples.release(amount, every, **limits)
            innovations = configuration.innovations.release(amount, every, **limits)
            if wanted:
                self._append(node.number, configuration, tables)
                self._append_innovations(node.number, configuration, innovations)

    def _append(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        for table in tables:
            run = None
            try:
                run = self._run_for(number, configuration, table)
                if run is not None:
                    run.append(table)
            except DataError:  # there is no file for it
                if run is not None:
                    self.runs[number].remove(run)
                raise
            except OSError as error:
                raise DataError(f"{self._target}: nothing more can be written ({error.strerror or error})") from None

    def _run_for(self, number: int, configuration: Configuration, table: SampleTable) -> Run | None:
        """Return the run that a table goes on with, or a new one; None where there are too many."""
        runs = self.runs.setdefault(number, [])
        for run in runs[-2:]:  # the last one may be shown only so far
            if run.configuration is configuration and not run.ended and run.goes_on(table):
                return run if run.rows or run is not runs[-1] else self._settled(number, run)
        if runs and not runs[-1].rows:  # shown, and something else has come of it
            runs.pop().drop()
        if not self._may_begin(number):
            count = self.refused.setdefault(number, [0, 0])
            count[0] += 1
            count[1] += len(table.index)
            return None
        return self._settled(number, self._open(number, configuration, table))

    def _may_begin(self, number: int) -> bool:
        files = sum(len(runs) for runs in self.runs.values())
        return len(self.runs.get(number, [])) < RUNS_MAX and files < FILES_MAX

    def _settled(self, number: int, run: Run) -> Run:
        """Make a run the newest one: the one before it is completed, or left out where it is too short."""
        runs = self.runs[number]
        if run in runs:
            runs.remove(run)
        if runs and runs[-1].is_short:
            short = runs.pop()
            short.drop()
            count = self.short.setdefault(number, [0, 0])
            count[0] += 1
            count[1] += short.found
        elif runs:
            self._settle(number)
        runs.append(run)
        return run

    def _open(self, number: int, configuration: Configuration, table: SampleTable) -> Run:
        first = int(table.index[0])
        run = Run(configuration, first, first)
        if self._target is not None:
            suffix = growing_suffix(self._target) or ""
            stem = self._target.name[: len(self._target.name) - len(suffix)]
            k = self._begun.get(number, 0) + 1
            while list(self._target.parent.glob(f"{glob.escape(stem)}.node{number}.run{k}.*")):
                k += 1  # what a killed reception left stays
            self._begun[number] = k
            run.path = self._target.with_name(f"{stem}.node{number}.run{k}.part{suffix}")
        return run

    def _show(self, node: Node) -> None:
        """Put what has come of a node, and may still change, on the disk."""
        configuration, runs = node.now, self.runs.setdefault(node.number, [])
        wanted = self._target is not None and (self._only is None or node.number == self._only)
        if not wanted or configuration is None:
            return
        tables = configuration.samples.tables(configuration.description.sample_every, FILL_SHARE)
        try:
            if runs and runs[-1].rows and not runs[-1].ended:
                mine = runs[-1].configuration is configuration and tables and runs[-1].goes_on(tables[0])
                runs[-1].show(tables.pop(0) if mine else None)
            elif len(runs) > 1 and tables and runs[-2].configuration is configuration and runs[-2].goes_on(tables[0]):
                runs[-2].show(tables.pop(0))
            if not tables:
                return
            if (not runs or runs[-1].rows) and self._may_begin(node.number):
                runs.append(self._open(node.number, configuration, tables[-1]))
            if not runs[-1].rows and runs[-1].configuration is configuration:
                runs[-1].show(tables[-1])
        except OSError as error:
            raise DataError(f"{self._target}: nothing more can be written ({error.strerror or error})") from None

    def _append_innovations(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        runs = [run for run in self.runs.get(number, [])[-2:] if run.configuration is configuration and run.rows]
        if self._folder is not None and runs:
            runs[-1].append_innovations(tables, self._folder)

    def name(self, number: int, tag: str) -> None:
        """Complete the files of a node and give them their names. Raises DataError."""
        runs = self.runs.get(number, [])
        for run in [run for run in runs if not run.rows]:  # shown, and nothing has come of it
            run.drop()
            runs.remove(run)
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
