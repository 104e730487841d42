"""Hold one recording: samples, names, units, roles, source."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.display import has_unseen, token
from aeolid.errors import DataError, UsageError
from aeolid.file_kinds import called, check_tables
from aeolid.geometry import (
    Geometry,
    Point,
    Sensor,
    Triple,
    frame_lines,
    placement_lines,
    quoted,
    read_frame,
    read_placement,
)
from aeolid.text_files import MOST_LETTERS, is_number, is_short, parse_toml, read_text, shown
from aeolid.text_files import check_keys as check_keys  # part of this module's face, too
from aeolid.units import PAGE, rightly

ROLES = ("input", "output", "disturbance", "scheduling", "azimuth", "excitation", "ignore")
TIME_UNITS = ("s", "ms", "us", "ns", "min", "h", "d", "100ns")
HOLDS = ("zoh", "foh", "band_limited", "auto")  # of a channel that acts: held, straight, smooth, as recordings say
_BLADES = 9  # of a rotor, at most
_CHANNEL_KEYS = {"name", "unit", "role", "column", "hold", "blade", "position", "direction"}
_ACTING = ("input", "disturbance", "scheduling", "excitation")
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """Name one signal: `column` is its heading in the table where that differs from `name`.

    hold: how it goes on between its samples, one of HOLDS; "auto" leaves that to the recording. blade: number of the
    blade it is measured on, 1 … 9, where it is one of a set that has a channel on each blade; 0 else. position: (x, y,
    z) in m, and direction: the vector of length 1 that it measures along, where both are known.
    """

    name: str
    unit: str
    role: str
    column: str | None = None
    hold: str = "auto"
    blade: int = 0
    position: Triple | None = None
    direction: Triple | None = None

    @property
    def heading(self) -> str:
        """Return the heading under which the table holds this channel."""
        return self.column or self.name


@dataclass(frozen=True)
class Roles:
    """Say what each channel of a table is: the content of a roles TOML file.

    `sample_time_s` is None where the time column gives it; `time` names the time column, None where there is none.
    time_unit: of that column, None where the file says it; resample: seconds to which channels of different rates are
    brought, "auto" for the longest sample time among them, None where they must have one clock. points, lines: of the
    wire frame that sensors with a position are drawn on.
    """

    channels: tuple[Channel, ...]
    sample_time_s: float | None
    time: str | None
    source: str
    time_unit: str | None = None
    resample: float | str | None = None
    points: tuple[Point, ...] = ()
    lines: tuple[tuple[str, str], ...] = ()

    @property
    def geometry(self) -> Geometry | None:
        """Return where sensors are, those of channels that are not read among them; None where no channel says it."""
        sensors = tuple(
            Sensor(c.name, c.unit, c.position, c.direction)
            for c in self.channels
            if c.position is not None and c.direction is not None
        )
        return Geometry(sensors, self.points, self.lines) if sensors else None

    def to_toml(self) -> str:
        """Return the text of a roles file that reads as these roles: every key, every number to its last digit."""
        head = {"sample_time_s": self.sample_time_s, "time": self.time, "time_unit": self.time_unit}
        lines = [
            "[recording]",
            *(_entry(k, v) for k, v in (head | {"resample": self.resample}).items() if v is not None),
        ]
        for c in self.channels:
            lines += ["", *channel_lines(c)]
        return "\n".join([*lines, "", *frame_lines(self.points, self.lines)]).rstrip("\n") + "\n"

    @classmethod
    def load(cls, path: str | Path) -> Roles:
        """Read a roles file.

        Raises DataError on a missing file, bad TOML, an unknown key, role or duplicate name.
        """
        source = str(path)
        data = _tables(source)
        check_tables(data, "roles", source)
        head = data.get("recording", {})
        check_keys(head, {"sample_time_s", "time", "time_unit", "resample"}, f"{source} [recording]")
        sample_time = head.get("sample_time_s")
        if sample_time is not None and not (is_number(sample_time) and 0 < sample_time < 1e6):
            raise DataError(f"{source} [recording]: sample_time_s = {shown(sample_time)} is not a time above 0 s")
        if not is_short(head.get("time", "")):
            raise DataError(f"{source} [recording]: time = {shown(head['time'])} is not the name of a column")
        entries = data.get("channel", [])
        if not isinstance(entries, list):
            raise DataError(f"{source}: channel is a list of tables, each headed [[channel]]")
        channels = tuple(_read_channel(entry, i, source) for i, entry in enumerate(entries))
        if not channels:
            raise DataError(f"{source}: no [[channel]] entry; name at least one input and one output")
        names = [c.name for c in channels]
        double = sorted(n for n, count in Counter(names).items() if count > 1)
        if double:
            raise DataError(f"{source}: channel {double[0]!r} is listed twice")
        unit, resample = head.get("time_unit"), head.get("resample")
        if unit is not None and (not isinstance(unit, str) or unit not in TIME_UNITS):
            raise DataError(f"{source} [recording]: time_unit = {shown(unit)} is none of {', '.join(TIME_UNITS)}")
        check_resample(resample, f"{source} [recording]: resample = {shown(resample)}")
        time_s = None if sample_time is None else float(sample_time)
        placed = {c.name: c.position is not None for c in channels}
        points, lines = read_frame(data.get("point", []), data.get("line", []), placed, source)
        return cls(channels, time_s, head.get("time"), source, unit, resample, points, lines)


@dataclass(frozen=True, eq=False)
class Record:
    """Hold one recording; time runs along the first axis and missing samples are NaN.

    time_s (N,) seconds, uniform; values (N, channels) in the channels' units; sha256 of the file it came from; begins:
    the instant that time_s counts from, ISO 8601, where the file says one. geometry: where sensors are, where that is
    known; it may name sensors that are not in this recording.
    """

    time_s: Array
    values: Array
    channels: tuple[Channel, ...]
    sample_time_s: float
    source: str
    sha256: str
    begins: str | None = None
    geometry: Geometry | None = None

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or self.values.shape != (len(self.time_s), len(self.channels)):
            raise ValueError(f"values {self.values.shape} do not match {len(self.time_s)} x {len(self.channels)}")

    def __len__(self) -> int:
        return len(self.time_s)

    def names(self, *roles: str) -> tuple[str, ...]:
        """List the names of the channels with one of these roles, in the order of the roles file."""
        return tuple(c.name for c in self.of(*roles))

    def of(self, *roles: str) -> tuple[Channel, ...]:
        """List the channels with one of these roles, in the order of the roles file."""
        return tuple(c for c in self.channels if c.role in roles)

    def matrix(self, *roles: str) -> Array:
        """Return the samples (N, k) of the channels with one of these roles."""
        index = [i for i, c in enumerate(self.channels) if c.role in roles]
        return self.values[:, index]

    def column(self, name: str) -> Array:
        """Return the samples (N,) of one channel."""
        for i, c in enumerate(self.channels):
            if c.name == name:
                return self.values[:, i]
        raise DataError(f"{self.source}: no channel {name!r}; it has {', '.join(c.name for c in self.channels)}")

    def columns(self, names: Sequence[str]) -> Array:
        """Return the samples (N, k) of the named channels in the order given."""
        if not names:
            return np.zeros((len(self), 0))
        return np.column_stack([self.column(n) for n in names])

    def unit(self, name: str) -> str:
        """Return the unit of one channel."""
        for c in self.channels:
            if c.name == name:
                return c.unit
        raise DataError(f"{self.source}: no channel {name!r}")

    def slice(self, start: int, stop: int) -> Record:
        """Return samples start … stop-1 as a recording of its own."""
        return replace(self, time_s=self.time_s[start:stop], values=self.values[start:stop])


def check_resample(value: Any, where: str) -> None:
    """Refuse what is neither None, "auto" nor a sample time in seconds."""
    if value not in (None, "auto") and not (is_number(value) and 0 < value < 1e6):
        raise DataError(f'{where} is neither "auto" nor a sample time above 0 s')


def file_sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as handle:
        while block := handle.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def require_same_layout(records: Sequence[Record], *, ordered: bool = True) -> None:
    """Refuse an experiment set whose recordings differ in channels, units, roles or sample time; names the channel.

    ordered: whether the channels must stand in the same order too.
    """
    if not records:
        raise UsageError("at least one recording is needed")
    first = records[0]
    for other in records[1:]:
        difference = _difference(first, other) or _order_difference(first, other, ordered)
        if difference:
            raise DataError(f"{other.source}: channels, units or roles differ from {first.source}: {difference}")
        if abs(other.sample_time_s - first.sample_time_s) > 1e-6 * first.sample_time_s:
            raise DataError(
                f"{other.source}: sample time {other.sample_time_s} s differs from {first.sample_time_s} s"
                f" in {first.source}; resample one of them"
            )


def require_distinct(records: Sequence[Record]) -> None:
    """Refuse recordings with the same samples: what is held back of one would have been fitted in the other."""
    seen: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        ends = record.values.shape, record.values[:1].tobytes(), record.values[-1:].tobytes()
        for first in seen.setdefault(ends, []):
            if np.array_equal(first.values, record.values, equal_nan=True):
                raise DataError(f"{record.source}: the same samples as in {first.source}; leave one of them out")
        seen[ends].append(record)


def _difference(first: Record, other: Record) -> str:
    """Say by which channel two recordings differ, whatever the order; empty where they do not."""
    there, here = ({c.name: c for c in r.channels} for r in (first, other))
    for name in [*there, *here]:
        if name not in here or name not in there:
            return f"channel {name!r} is {'missing' if name in there else 'not in the other'}; leave it out of both"
        for what in ("unit", "role"):
            mine, others = getattr(here[name], what), getattr(there[name], what)
            if mine != others:
                return f"channel {name!r} has the {what} {mine!r}, there {others!r}; bring both to the same"
    return ""


def _order_difference(first: Record, other: Record, ordered: bool) -> str:
    for there, here in zip(first.channels, other.channels, strict=True) if ordered else ():
        if here.name != there.name:
            return f"channel {here.name!r} stands where {there.name!r} does there; bring both to the same order"
    return ""


def _tables(source: str) -> dict[str, Any]:
    """Return the content of a roles file; what is no TOML at all, or no file, is told what is needed."""
    if not source.endswith(".toml") and not Path(source).exists():
        raise DataError(
            f"{source}: no such file; roles are read from a TOML file with a [[channel]] table for each channel, by its"
            " full name (no patterns); aeolid init RECORDING writes one"
        )
    text = read_text(source)
    try:
        return parse_toml(text, source)
    except DataError as error:
        if source.endswith(".toml"):
            raise
        raise DataError(
            f"{source}: {called(Path(source)) or 'a file'}, where a roles file is needed; give the TOML file with"
            " [[channel]] tables; aeolid init RECORDING writes one"
        ) from error


def _read_channel(entry: Any, index: int, source: str) -> Channel:
    where = f"{source} [[channel]] {index + 1}"
    check_keys(entry, _CHANNEL_KEYS, where)
    for key in ("name", "unit", "role"):
        if not isinstance(entry.get(key), str) or (key != "unit" and not entry[key]):
            raise DataError(f"{where}: {key} is missing or not a text")
        if not is_short(entry[key]):
            raise DataError(f"{where}: {key} = {shown(entry[key])} is longer than {MOST_LETTERS} characters")
    if has_unseen(entry["name"], entry["unit"]):
        raise DataError(f"{where}: the name {token(entry['name'])!r} or its unit holds a control character; rename it")
    check_spelling(entry["unit"], entry["name"], where)
    if entry["role"] not in ROLES:
        raise DataError(f"{where}: role {shown(entry['role'])} is none of {', '.join(ROLES)}")
    if not is_short(entry.get("column", "")):
        raise DataError(f"{where}: column = {shown(entry['column'])} is not the heading of a column")
    hold = entry.get("hold", "auto")
    if hold not in HOLDS or not isinstance(hold, str):
        raise DataError(f"{where}: hold = {shown(hold)} is none of {', '.join(HOLDS)}")
    if "hold" in entry and entry["role"] not in _ACTING:
        raise DataError(f"{where}: hold is for what acts on the plant ({', '.join(_ACTING)}), not for {entry['role']}")
    blade = entry.get("blade", 0)
    if "blade" in entry and not (type(blade) is int and 1 <= blade <= _BLADES):
        raise DataError(f"{where}: blade = {shown(blade)} is no number of a blade, 1 … {_BLADES}")
    place, direction = read_placement(entry, where)
    return Channel(entry["name"], entry["unit"], entry["role"], entry.get("column"), hold, blade, place, direction)


def check_spelling(unit: str, channel: str, where: str) -> None:
    """Refuse a unit that is written otherwise here; raises DataError that names both spellings."""
    right = rightly(unit)
    if right is not None:
        raise DataError(f"{where}: the unit {unit!r} of {channel!r} is written {right!r} here; correct it ({PAGE})")


def channel_lines(c: Channel) -> list[str]:
    """Return a channel as the lines of its [[channel]] table in a roles file."""
    lines = ["[[channel]]", *(_entry(key, getattr(c, key)) for key in ("name", "unit", "role"))]
    lines += [] if c.column is None else [_entry("column", c.column)]
    lines += [] if c.hold == "auto" else [_entry("hold", c.hold)]
    lines += [f"blade = {c.blade}"] if c.blade else []
    return lines + placement_lines(c.position, c.direction)


def _entry(key: str, value: str | float) -> str:
    return f"{key} = {quoted(value) if isinstance(value, str) else repr(value)}"
