"""Take raw values out of MDF4 blocks with asammdf; everything here runs confined."""

from __future__ import annotations

import io
import sys
import types
from collections.abc import Generator
from typing import Any

import numpy as np

from aeolid.confined import Reply
from aeolid.errors import DataError
from aeolid.formats.bounds import guard_size
from aeolid.formats.clock import UNITS, unit_of_time
from aeolid.formats.conversions import convert, is_formula
from aeolid.formats.table import Array, listed, to_numbers

_SAME_INSTANT = 1e-9  # seconds: channels of one clock carry the same stamps
_TIME, _MASTERS = 1, {2: "angle", 3: "distance", 4: "index"}  # what the channels of a group are recorded over
_BUS_EVENT = 2  # flag of a channel group


def open_mdf(path: str) -> Any:
    """Open an MDF file; nothing that stands in it can be evaluated, and asammdf writes no file.

    Called before asammdf is imported for the first time: what it would compute formulas with is not there for it. It
    makes a file for later additions at once; here that is memory.
    """
    forbid_formulas()
    from asammdf import MDF
    from asammdf.blocks import mdf_v4

    blocks: Any = mdf_v4
    blocks.NamedTemporaryFile = lambda *_, **__: io.BytesIO()
    blocks.MDF4.extract_attachment = lambda *_, **__: (b"", "", b"")  # it opens whatever path the file names
    return MDF(path)


def forbid_formulas() -> None:
    """Put modules that compute nothing in the place of those that asammdf evaluates formulas with."""

    def refuse(*_: Any, **__: Any) -> Any:
        raise TypeError("formulas are not evaluated")

    empty = types.ModuleType("numexpr")
    empty.evaluate, empty.__version__ = refuse, "0"  # type: ignore[attr-defined]
    sys.modules["numexpr"] = empty
    sys.modules["sympy"] = None  # type: ignore[assignment] # importing it fails


def say_kind(path: str) -> Reply:
    """Say whether the file logs raw CAN frames."""
    return {"frames": any(name.startswith("CAN_DataFrame") for name in open_mdf(path).channels_db)}, {}


def send_channels(path: str, source: str, most: int, own: bool = False) -> Generator[Reply, dict[str, Any], None]:
    """Say what channels there are, then send those that are wanted, with their clock, or each with its own."""
    file = open_mdf(path)
    clocks = {file.groups[g].channels[c].name for g, c in file.masters_db.items()}
    names = [name for name in file.channels_db if name not in clocks]
    wanted = (yield {"asks": "wanted", "names": names}, {})["wanted"]
    if not wanted:
        raise DataError(f"{source}: no measured channel; it holds {listed(['time_s', *names])}")
    time, first = np.zeros(0), ""
    stamped: dict[str, Array] = {}
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    size = 0
    for name in wanted:
        if len(file.channels_db[name]) > 1:
            raise DataError(f"{source}: {len(file.channels_db[name])} channels are called {name!r}; rename all but one")
        group, index = file.channels_db[name][0]
        size += _announced(file.groups[group])
        guard_size(source, size, most)
        stamps, values, unit = _channel(file, source, name, group, index)
        if not first:
            time, first = stamps, name
        if own:
            stamped[f"t{len(columns)}"] = stamps
        else:
            _require_one_clock(source, (first, time), (name, stamps))
        columns[name] = values
        units |= {name: unit} if unit else {}
    held = list(columns.values()) if own else [time, *columns.values()]
    yield {"units": units}, {str(i): values for i, values in enumerate(held)} | stamped


def _announced(group: Any) -> int:
    """Return how many bytes the records of a group take, and one channel and the clock as numbers."""
    head = group.channel_group
    return int(head.cycles_nr) * (int(head.samples_byte_nr) + int(head.invalidation_bytes_nr) + 16)


def _channel(file: Any, source: str, name: str, group: int, index: int) -> tuple[Array, Array, str]:
    """Return time, physical values and unit of one channel."""
    channel = file.groups[group].channels[index]
    clock = file.masters_db.get(group)
    if clock is not None and is_formula(file.groups[group].channels[clock].conversion):
        raise DataError(f"{source}: the clock of channel {name!r} is computed by a formula; export it resampled")
    raw, invalid = file.get(group=group, index=index, raw=True, samples_only=True)
    scale = 1.0 if clock is None else _seconds_of(source, name, file.groups[group].channels[clock])
    stamps = scale * np.asarray(file.get_master(group), dtype=float)
    whole = np.asarray(raw).dtype.kind in "biu"
    values = convert(source, name, channel.conversion, to_numbers(source, name, raw), whole)
    if invalid is not None:
        values = np.where(np.asarray(invalid, dtype=bool), np.nan, values)
    unit = getattr(channel.conversion, "unit", "") or channel.unit or ""
    return stamps, values, str(unit)


def _seconds_of(source: str, name: str, clock: Any) -> float:
    """Return what the values of a channel's master are multiplied by to be seconds; refuses one that is no time."""
    where = f"{source}: channel {name!r}"
    if clock.sync_type not in (0, _TIME):
        kind = _MASTERS.get(clock.sync_type, f"kind {clock.sync_type}")
        raise DataError(f"{where} is recorded over the {kind} {clock.name!r}, not over time; export it over time")
    unit = getattr(clock.conversion, "unit", "") or clock.unit or ""
    return UNITS[unit_of_time("time", str(unit), where) or "s"]


def _require_one_clock(source: str, first: tuple[str, Array], other: tuple[str, Array]) -> None:
    (name, time), (second, stamps) = first, other
    if len(stamps) != len(time) or (len(time) and np.max(np.abs(stamps - time)) > _SAME_INSTANT):
        raise DataError(
            f"{source}: channels {name!r} ({len(time)} samples) and {second!r} ({len(stamps)} samples) have"
            f" different clocks; let --resample bring them to one, or export them resampled"
        )


def refuse_formulas(path: str, file: Any) -> None:
    """Refuse a bus log in which something is computed by a formula: frames hold nothing to compute."""
    for group in file.groups:
        for channel in group.channels if group.channel_group.flags & _BUS_EVENT else ():
            if is_formula(channel.conversion):
                raise DataError(f"{path}: {str(channel.name)[:80]!r} of a CAN log is computed by a formula")
