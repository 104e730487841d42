"""Hold one uninterrupted run of a node, and write its rows and innovations to disk."""

from __future__ import annotations

import hashlib
import tempfile
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.can.clock import ClockFit
from aeolid.can.configuration import Configuration
from aeolid.can.limits import FILL_SHARE, INNOVATIONS_AHEAD, RUN_LEAST
from aeolid.can.tables import SampleTable, follows
from aeolid.errors import DataError, UsageError
from aeolid.filters.scales import START_S, RunSums, find_problems
from aeolid.formats.growing import GrowingTable, growing_suffix, open_growing
from aeolid.formats.meanings import meaning_of
from aeolid.record import Channel, channel_lines

Array = NDArray[np.float64]
FILL = 1 << 16  # missing rows that are written at once


def channels_of(configuration: Configuration) -> tuple[Channel, ...]:
    """Return the channels a node described; what it sends besides in- and outputs and calls the azimuth is that."""
    d = configuration.description
    roles = ["input"] * d.inputs + ["output"] * d.outputs
    roles += [_role(*channel) for channel in zip(d.names[len(roles) :], d.units[len(roles) :], strict=True)]
    return tuple(Channel(n, u, r) for n, u, r in zip(d.names, d.units, roles, strict=True))


def _role(name: str, unit: str) -> str:
    meaning = meaning_of(name)
    return "azimuth" if meaning is not None and meaning.kind == "azimuth" and unit in ("deg", "rad") else "scheduling"


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
    _sums: RunSums | None = None  # of the channels that are filtered

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

    def scale_problems(self) -> tuple[str, ...]:
        """Say which channels the node's filter hardly sees with its offset and scale, and what would fit."""
        if self._sums is None:
            return ()
        d, n = self.configuration.description, self._sums.channels
        return find_problems(d.names[:n], d.units[:n], d.offset[:n], d.scale[:n], self._sums.judged)

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
        d = self.configuration.description
        if self._sums is None:
            self._sums = RunSums(d.inputs + d.outputs, round(START_S / self.sample_time_s))
        self._sums.add(values[:, : self._sums.channels])
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
        lines += [*channel_lines(c), ""]
    output.write_text(roles, "\n".join(lines))
    return roles
