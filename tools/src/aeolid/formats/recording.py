"""Turn a file of any known format into a recording."""

from __future__ import annotations

import hashlib
import importlib
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from aeolid.errors import DataError
from aeolid.file_kinds import NAMED, called, suffix_of
from aeolid.file_kinds import SUFFIXES as SUFFIXES  # part of this module's face, too
from aeolid.formats import extras
from aeolid.formats.bladed import beside, companions, is_bladed, read_bladed
from aeolid.formats.clock import clock_of, is_time_heading
from aeolid.formats.headings import check_unit, fault_of_name, find_heading, split_heading
from aeolid.formats.table import Array, Choose, Table, listed, require_of_size, to_numbers, want_all
from aeolid.formats.timebase import Grid, uniform_grid
from aeolid.inputs import regular_size
from aeolid.record import Channel, Record, Roles, file_sha256

log = logging.getLogger("aeolid.formats")

_TEXT = (".csv", ".csv.gz", ".txt", ".tsv", ".out", ".dbg")
_RATES = (".mf4", ".tdms")  # formats in which each group of channels has a clock
_CAN_LOGS = (".blf", ".asc", ".log")


def read_record(path: str | Path, roles: Roles) -> Record:
    """Read the channels that a roles file names, checked and on a uniform clock.

    Channels of the role `ignore` are not read. Missing samples (empty cells, NaN, gaps of whole samples) become
    NaN. Raises DataError naming file, channel and sample for everything that cannot be used as it stands. Sample
    numbers in messages count from 1. Cost: one pass over the file; memory for the wanted channels only.
    """
    channels = tuple(c for c in roles.channels if c.role != "ignore")
    source = str(path)
    if not channels:
        raise DataError(f"{roles.source}: every channel is ignored; give at least one the role output")
    for channel in channels:
        fault = fault_of_name(channel.name, channel.unit)
        if fault:
            raise DataError(
                f"{roles.source}: the name {channel.name!r} {fault}; rename it and give `column` its heading"
            )

    def choose(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        time = _time_heading(names, roles, clock, source)
        found = [find_heading(c.heading, names, source) for c in channels]
        return tuple(dict.fromkeys(([time] if time else []) + found))

    table = _read(Path(path), choose, own_clocks=roles.resample is not None)
    if table.samples == 0:
        raise DataError(f"{source}: a heading but no sample; record at least one row")
    headings = [find_heading(c.heading, table.names, source) for c in channels]
    for channel, heading in zip(channels, headings, strict=True):
        check_unit(source, channel.name, channel.unit, _unit(table, heading))
        _require_usable(table, channel.name, table.columns[heading])
        if heading in table.begins:
            raise DataError(f"{source}: channel {channel.name!r} holds dates; only the time may")
    grid, values, begins = _on_one_clock(table, roles, channels, headings)
    return Record(
        grid.times(), values, channels, grid.sample_time_s, source, recording_sha256(path), begins, roles.geometry
    )


def _on_one_clock(
    table: Table, roles: Roles, channels: Sequence[Channel], headings: Sequence[str]
) -> tuple[Grid, Array, str | None]:
    """Return the uniform clock of a table, the values (N, channels) on it, and the instant that it counts from."""
    heading = _time_heading(table.names, roles, table.time, table.source)
    clock = None
    likely = [n for n in table.names if is_time_heading(n)]
    if heading is None and likely and roles.sample_time_s is not None:
        log.warning(
            "%s: the time column %s is not looked at; the sample time of the roles file is taken as it is",
            table.source, " nor ".join(map(repr, likely[:3])),
        )  # fmt: skip
    if heading is not None:
        unit = _unit(table, heading)
        clock = clock_of(table, heading, unit, roles.time_unit, roles.sample_time_s)
    time: Array | None = None if clock is None else clock.seconds
    begins = None if clock is None else clock.begins
    if roles.resample is None:
        grid = uniform_grid(table, time, roles.sample_time_s)
        return grid, grid.place(np.column_stack([table.columns[h] for h in headings])), begins
    if time is None and not all(h in table.clocks for h in headings):
        if roles.sample_time_s is None:
            raise DataError(f"{table.source}: no time column, by which its channels could be resampled")
        time = np.asarray(roles.sample_time_s * np.arange(table.samples), dtype=np.float64)
    from aeolid.formats.rates import resampled, series_of

    common = np.zeros(0) if time is None else time
    series = [
        series_of(table, c, table.clocks.get(h, common), table.columns[h])
        for c, h in zip(channels, headings, strict=True)
    ]
    grid, values = resampled(table.source, series, roles.resample)
    return grid, values, begins


def read_table(path: str | Path, columns: Sequence[str] | None = None) -> Table:
    """Read named columns of a file (all where none are named), without roles or checks of the clock.

    Names match headings with or without the unit behind them; the result's columns carry the names asked for.
    """
    if columns is None:
        return _read(Path(path), want_all)
    source = str(path)

    def choose(names: tuple[str, ...], clock: str | None) -> tuple[str, ...]:
        return tuple(dict.fromkeys(find_heading(name, names, source) for name in columns))

    table = _read(Path(path), choose)
    found = {name: find_heading(name, table.names, source) for name in columns}
    units = {name: unit for name, heading in found.items() if (unit := _unit(table, heading)) is not None}
    return Table(
        table.source, table.names, {n: table.columns[h] for n, h in found.items()}, units, table.time, table.first_line
    )


def read_chosen(path: str | Path, choose: Choose) -> Table:
    """Read the columns that `choose` picks from the headings of a file; channels keep clocks of their own."""
    return _read(Path(path), choose, own_clocks=True)


def _read(path: Path, choose: Choose, own_clocks: bool = False) -> Table:
    """Read the chosen columns of a file; own_clocks: they may have different clocks where the format has such."""
    if path.is_dir():
        from aeolid.formats.dataset import read_dataset

        return read_dataset(path, choose)
    empty = regular_size(path) == 0
    suffix = suffix_of(path)
    if suffix not in (*SUFFIXES, *NAMED) and not is_bladed(path):
        if what := called(path):
            raise DataError(f"{path}: {what}, where a recording is needed; name the file with the samples")
        told = ", ".join([*SUFFIXES, *NAMED, ".%04", ".$04", ".$PJ"])
        raise DataError(f"{path}: the suffix {suffix or '(none)'} is none of {told}; export it as CSV")
    if empty and not is_bladed(path):  # of a project only the name counts
        raise DataError(f"{path}: the file is empty (0 bytes); copy or export it again")
    reader = _reader(suffix, path)
    return reader(path, choose, own_clocks=True) if own_clocks and suffix in _RATES else reader(path, choose)


def _reader(suffix: str, path: Path) -> Callable[..., Table]:
    """Import the reader only when its format is met: none of the libraries behind them is needed for the others."""
    if suffix in _TEXT:
        from aeolid.formats import text

        return text.read_out if suffix in (".out", ".dbg") else text.read_csv
    if suffix == ".mf4":
        from aeolid.formats import mdf

        return _read_can_log if mdf.holds_frames(path) else mdf.read_mdf
    if suffix in _CAN_LOGS:
        return _read_can_log
    if suffix == ".mat":
        from aeolid.formats import matlab

        return matlab.read_mat
    if suffix == ".parquet":
        return _read_parquet
    if suffix == ".npz":
        from aeolid.formats import archive

        return archive.read_npz
    if suffix in extras.LIBRARIES:
        return extras.READERS[suffix]
    if suffix in (".sel", ".dat"):
        from aeolid.formats import hawc2

        return hawc2.read_hawc2
    if is_bladed(path):
        return read_bladed
    from aeolid.formats import binary

    return binary.read_outb


def files_of(path: Path) -> list[Path]:
    """List the files that may be read for a recording of this name, itself first; none of them is opened."""
    if path.is_dir():
        from aeolid.formats.dataset import parts_of

        return [path, *parts_of(path)]
    if path.suffix.lower() in (".sel", ".dat"):
        from aeolid.formats.hawc2 import companions as both

        return [path, *both(path)]
    if is_bladed(path):
        return [path, *beside(path)]
    return [path]


def recording_sha256(path: str | Path) -> str:
    """Return the SHA-256 of a recording's file; where it consists of several, that of their sums in hexadecimal.

    What `Record.sha256` is and what tells two recordings apart. Raises DataError where the files cannot be listed.
    """
    path = Path(path)
    if path.is_dir():
        from aeolid.formats.dataset import parts_of as parts
    elif path.suffix.lower() in (".sel", ".dat"):
        from aeolid.formats.hawc2 import companions as parts
    elif is_bladed(path):
        parts = _results_of
    else:
        return file_sha256(path)
    return hashlib.sha256("".join(file_sha256(p) for p in parts(path)).encode()).hexdigest()


def _results_of(path: Path) -> list[Path]:
    """List the project, if it was named, and the headers and numbers of Bladed results, whichever of them was named."""
    data = companions(path)[1:]
    pairs = (p for d in data for p in (d.with_suffix(d.suffix.replace("$", "%")), d))
    return [*([path] if path.suffix.lower() == ".$pj" else []), *pairs]


def _read_parquet(path: Path, choose: Choose) -> Table:
    from aeolid.formats import parquet

    try:
        return parquet.read_parquet(path, choose)
    except parquet.HoldsFrames:
        return _read_can_log(path, choose)


def _read_can_log(path: Path, choose: Choose) -> Table:
    """Decode a CAN log with the product's DBC: aeolid.can gives the columns, among them time_s, and their units."""
    decode = getattr(importlib.import_module("aeolid.can"), "read_log", None)
    if decode is None:
        raise DataError(f"{path}: CAN logs are not read by this build; export the samples as CSV")
    columns, units = decode(path)
    names = tuple(columns)
    wanted = choose(names, "time_s")
    return Table(str(path), names, {n: to_numbers(path, n, columns[n]) for n in wanted}, dict(units), "time_s")


def _time_heading(names: Sequence[str], roles: Roles, clock: str | None, source: str) -> str | None:
    """Find the time column: the one the roles file names, the format's own, one called time_s, or the only one."""
    bare = {split_heading(name)[0] for name in names}
    if roles.time is not None and (clock is None or roles.time in bare or roles.time in names):
        return find_heading(roles.time, names, source)
    if clock is not None:
        return clock
    if "time_s" in bare:
        return find_heading("time_s", names, source)
    found = [name for name in names if is_time_heading(name)]
    ignored = {c.heading for c in roles.channels if c.role == "ignore"}
    likely = [n for n in found if n not in ignored and split_heading(n)[0] not in ignored]
    if len(likely) == 1 or roles.sample_time_s is not None:
        return likely[0] if len(likely) == 1 else None
    if len(found) > 1:
        raise DataError(
            f"{source}: {len(found)} columns may be the time, {listed(found, 4)}; set time = {found[0]!r} or another of"
            " them under [recording] in the roles file"
        )
    return found[0] if found else None  # also of the role ignore: there is no sample time but in it


def _unit(table: Table, heading: str) -> str | None:
    """Return the unit the file gives a column: its own entry, else the one in the heading."""
    return table.units.get(heading, split_heading(heading)[1])


def _require_usable(table: Table, name: str, values: Array) -> None:
    require_of_size(table, name, values, "leave the cell empty if the sample is missing")
    if np.isnan(values).all():
        raise DataError(f'{table.source}: channel {name!r} holds no value at all; give it the role "ignore"')
