"""Turn a time column into seconds: by its unit, by what it counts from, and from dates as text.

Numbers since 1970 are told by their size: a recording made between 2000 and 2065 has 0.95e9 … 3e9 seconds behind it, so
the same count in ms, µs and ns lies in decades of its own, and so do counts of 100 ns since 1601 and since the year 1.
They are believed where the samples then are as far apart as those of a logger. A column without a unit that steps by 1
or more, or may count days, is not guessed: milliseconds and seconds look alike there, and the sentence asks.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from aeolid.errors import DataError, OpenUnit
from aeolid.formats.headings import plain_unit, split_heading
from aeolid.formats.table import Array, Table
from aeolid.record import TIME_UNITS

log = logging.getLogger("aeolid.formats")

UNITS = dict(zip(TIME_UNITS, (1.0, 1e-3, 1e-6, 1e-9, 60.0, 3600.0, 86400.0, 1e-7), strict=True))
_WORDS = {
    "µs": "us", "μs": "us", "msec": "ms", "usec": "us", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns",
    "minutes": "min", "hours": "h", "days": "d", "millis": "ms", "micros": "us", "hr": "h",
}  # fmt: skip
_SUFFIX = re.compile(r"(?:^|[_\s])(s|sec|seconds|ms|msec|us|usec|ns|min|minutes|h|hours)$", re.IGNORECASE)
_DAYS = ((3.5e4, 8e4), (6.9e5, 8e5))  # since 1900 (1996 to 2119) and since the year 0 (1889 to 2190)
_FIRST_S, _LAST_S = 946684800.0, 3.0e9  # since 1970: 2000 to 2065; counts of LabVIEW, since 1904, are above
_LONGEST_S = 1e10  # 317 years: no time is as many seconds after anything but a date
_FASTEST_S, _SLOWEST_S = 1e-3, 2.0  # between samples of a recording of a machine
_MINUTES = (1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60)  # between the samples of a slow logger: parts of an hour
_SAME_STEP = 1e-3  # relative
_ASK_FROM = 1.0  # steps of a column without unit, from which its unit is asked for
_DATE = re.compile(r"\s*(?:\d{4}[-/]\d\d[-/]\d\d|\d\d\.\d\d\.\d{4})(?:[T\s]+\d\d:\d\d.*)?\s*$")
_OTHER_DATE = re.compile(r"\s*\d{1,2}[/.-]\d{1,2}[/.-]\d{2,4}\b|\s*\d{1,2}:\d\d(?::\d\d)?|\d{4}-W\d\d|\s*\d{8}T\d{4,6}")
_ZONE = re.compile(r"(?:Z|[+-]\d\d(?::?\d\d)?)\s*$")
DATES = "dates are read as 2024-03-01T12:00:00.05, with Z or +01:00 where the zone is known, or 01.03.2024 12:00:00"


@dataclass(frozen=True)
class _Epoch:
    """Hold a way to count instants: in what unit, the count at 1970, since when, and whether that is in UTC."""

    unit: str
    at_1970: float
    since: str
    utc: bool = True

    def seconds(self, count: Array | float) -> Any:
        """Return the seconds since 1970."""
        return (count - self.at_1970) * UNITS[self.unit] if self.at_1970 else count * UNITS[self.unit]

    def holds(self, count: float) -> bool:
        """Tell whether a count lies between 2000 and 2065."""
        return bool(_FIRST_S <= self.seconds(count) <= _LAST_S)


_EPOCHS = (
    *(_Epoch(unit, 0.0, "1970") for unit in ("s", "ms", "us", "ns")),
    _Epoch("100ns", 116444736e9, "1601 (FILETIME of Windows)"),
    _Epoch("100ns", 621355968e9, "the year 1 (ticks of .NET)", utc=False),
)
_DATES = (_Epoch("d", 25569.0, "1900", utc=False), _Epoch("d", 719529.0, "the year 0", utc=False))  # never guessed


@dataclass(frozen=True, eq=False)
class Clock:
    """Hold a time column in seconds (N,), and the instant it counts from where the file says one (ISO 8601)."""

    seconds: Array
    begins: str | None = None


_NAMES = {"time", "timestamp", "datetime", "date_time", "date time", "utc", "zeit", "t"}


def is_time_heading(heading: str) -> bool:
    """Tell whether a heading can only be that of the time: time, timestamp, datetime …, with or without a unit.

    >>> [is_time_heading(h) for h in ("Time [ms]", "timestamp_us", "DateTime", "time_to_failure", "Tower")]
    [True, True, True, False, False]
    """
    name = split_heading(heading)[0]
    found = _SUFFIX.search(name)
    return (name[: found.start()] if found else name).strip().lower() in _NAMES


def unit_of_time(heading: str, unit: str | None, source: str) -> str | None:
    """Return the unit a file gives its time, one of UNITS, None where it gives none.

    Raises DataError on another, and where the heading's own ending says another than the unit.
    """
    ending = _SUFFIX.search(split_heading(heading)[0])
    named = None if ending is None else _WORDS.get(ending[1].lower(), plain_unit(ending[1].lower()))
    if unit is None or not plain_unit(unit):
        return named
    word = _WORDS.get(unit.strip().lower(), plain_unit(unit).lower())
    if word not in UNITS:
        raise DataError(
            f"{source}: the time column {heading!r} is in {unit[:40]!r}; a time is in one of {', '.join(UNITS)}"
        )
    if named not in (None, word):
        raise DataError(
            f"{source}: channel {split_heading(heading)[0]!r} is in {unit!r} in the file and in {named!r} by its"
            " own name; set time_unit under [recording] in the roles file to the right one"
        )
    return word


def clock_of(table: Table, heading: str, unit: str | None, stated: str | None, declared: float | None) -> Clock:
    """Return the time column of a table in seconds.

    unit: what the file says; stated: the unit that the roles file gives, which is believed; declared: the sample time
    of the roles file in seconds, by which a column without unit is understood. What was found out is logged in a
    sentence. Raises DataError where the unit stays open.
    """
    values, source = table.columns[heading], table.source
    if heading in table.begins:
        return Clock(values, table.begins[heading])
    known = values[np.isfinite(values)]
    first, step = (float(known[0]) if len(known) else 0.0), _step(known)
    said = unit_of_time(heading, unit, source) if stated is None else stated
    impossible = said in ("s", "ms", "us", "ns", "100ns") and first * UNITS[said] > _LONGEST_S
    if stated is None and (said is None or impossible):
        epoch = next((e for e in _EPOCHS if e.holds(first)), None)
        if epoch is not None and _is_loggers(step * UNITS[epoch.unit]):
            name, since = epoch.unit.replace("100ns", "100 ns"), epoch.since
            log.warning(
                "%s: the time column %r counts %s since %s, so it is taken in %s", source, heading, name, since, name
            )
            return _dated(values, first, epoch)
        said = _by_declared(known, declared)
        if said is None and (epoch is not None or impossible):
            raise _open(source, heading, known, _readings(first, step), "ns, us, ms or s")
    if said is None:
        said = "s"
        if declared is None:
            _ask(source, heading, known)
    scale = UNITS[said]
    if scale != 1.0:
        log.warning("%s: the time column %r is in %s; one sample takes %.6g s", source, heading, said, step * scale)
    epoch = next((e for e in (*_EPOCHS, *_DATES) if e.unit == said and e.holds(first)), None)
    return Clock(values * scale if scale != 1.0 else values) if epoch is None else _dated(values, first, epoch)


def possible_units(values: Array) -> tuple[str, ...]:
    """Return the units in which a column of time (N,) that says none may be, the likeliest first.

    Those in which its samples are 1 ms to 2 s apart, those in which it counts from a date, and days where it may.
    """
    known = values[np.isfinite(values)]
    first, step = (float(known[0]) if len(known) else 0.0), _step(known)
    fine = [u for u in ("s", "ms", "us", "ns") if _FASTEST_S <= step * UNITS[u] <= _SLOWEST_S]
    days = ["d"] if any(least <= first <= most for least, most in _DAYS) else []
    return tuple(dict.fromkeys(fine + days + [e.unit for e in _EPOCHS if e.holds(first)]))


def _dated(values: Array, first: float, epoch: _Epoch) -> Clock:
    """Return a count from a date in seconds since 1970: periods of a fleet go by it."""
    begins = datetime.fromtimestamp(float(epoch.seconds(first)), UTC).isoformat().removesuffix("+00:00")
    return Clock(epoch.seconds(values), begins + ("Z" if epoch.utc else ""))


def _step(known: Array) -> float:
    return float(np.median(np.diff(known))) if len(known) > 1 else 0.0


def _is_loggers(step_s: float) -> bool:
    """Tell whether samples may be so far apart: up to 2 s, or minutes; a clock that stands is refused elsewhere."""
    return step_s <= _SLOWEST_S or any(abs(step_s / (60 * m) - 1) < _SAME_STEP for m in _MINUTES)


def _is_round(step: float) -> bool:
    """Tell whether a step is one of whole milliseconds and of a whole number of samples a second."""
    if not 0 < step <= 1:
        return False
    return all(round(x) >= 1 and abs(x / round(x) - 1) < _SAME_STEP for x in (1e3 * step, 1 / step))


def _by_declared(known: Array, declared: float | None) -> str | None:
    """Return the unit in which a column without one has the declared sample time."""
    step = _step(known)
    if declared is None or step <= 0:
        return None
    return next((u for u, scale in UNITS.items() if abs(step * scale / declared - 1) < 0.01), None)


def _ask(source: str, heading: str, known: Array) -> None:
    """Ask where a column that says no unit may count days or steps by 1 or more."""
    step = _step(known)
    days = any(least <= known[0] <= most for least, most in _DAYS) if len(known) else False
    if days and step > 0 and not _is_round(step):
        reading = f"in days that is one sample in {step * 86400:.4g} s, in seconds one in {step:.4g} s"
        raise _open(source, heading, known, reading, "d or s")
    if step >= _ASK_FROM:
        (fine, short), (coarse, long) = _pair(step)
        raise OpenUnit(
            f"{source}: the time column {heading!r} steps by {step:g} and does not say its unit: in {fine} that"
            f" is {1 / (step * UNITS[short]):g} samples a second, in {coarse} one every {step * UNITS[long]:g} s; set"
            f' time_unit = "{short}" or "{long}" under [recording] in the roles file'
        )


def _pair(step: float) -> tuple[tuple[str, str], tuple[str, str]]:
    """Return the two units, by name and sign, of which a step of 1 or more is likeliest to be in one."""
    named = (("seconds", "s"), ("milliseconds", "ms"), ("microseconds", "us"), ("nanoseconds", "ns"))
    at = 1 if step < 1e3 else 2 if step < 1e6 else 3
    return named[at], named[at - 1]


def _readings(first: float, step: float) -> str:
    """Say how far apart the samples were in each unit that is possible."""
    told = [f"as {e.unit} since {e.since} that is one sample every {step * UNITS[e.unit]:.4g} s"
            for e in _EPOCHS if e.holds(first)]  # fmt: skip
    (fine, short), _ = _pair(max(step, 1.0))
    return ", ".join([*told, f"in {fine} one every {step * UNITS[short]:.4g} s"])


def _open(source: str, heading: str, known: Array, reading: str, units: str) -> OpenUnit:
    """Build the question for a unit that the numbers do not tell."""
    return OpenUnit(
        f"{source}: the time column {heading!r} begins at {known[0]:.10g}, steps by {_step(known):.4g} and does not say"
        f" its unit; {reading}; set time_unit under [recording] in the roles file to {units}"
    )


def looks_like_date(cell: str) -> bool:
    """Tell whether a cell is a date that `seconds_of_dates` reads."""
    return _DATE.match(cell) is not None


def date_hint(cell: str) -> str:
    """Return what to say of a cell that is a date in another form; empty where it is none."""
    return f"; {DATES}" if _OTHER_DATE.match(cell) else ""


def seconds_of_dates(source: str, name: str, column: Any, place: Any) -> tuple[Array, str]:
    """Return seconds since the first date (N,) of an Arrow column of texts, and that date; empty cells are NaN.

    place: how the row of an index is named. Dates with a zone are brought to UTC; a column has a zone in every cell or
    in none. Raises DataError, naming the cell, where one is no date.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pc.replace_substring_regex(column, r"^\s*(\d\d)\.(\d\d)\.(\d{4})", r"\3-\2-\1")
    text = pc.replace_substring_regex(text, r"^\s*(\d{4})/(\d\d)/(\d\d)", r"\1-\2-\3")
    text = pc.replace_substring_regex(pc.utf8_trim_whitespace(text), r"(:\d\d),(\d+)", r"\1.\2")
    text = pc.if_else(pc.equal(text, ""), pa.scalar(None, pa.string()), text)
    first = next((v.as_py() for v in text if v.is_valid), None)
    zone = "UTC" if first is not None and "T" in first.replace(" ", "T") and _ZONE.search(first[10:]) else None
    try:
        stamps = text.cast(pa.timestamp("ns", zone))
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise _no_date(source, name, text, zone, place) from None
    return relative(stamps, zone)


def relative(stamps: Any, zone: str | None) -> tuple[Array, str]:
    """Return Arrow timestamps in ns as seconds since the first (N,), and the first as ISO 8601."""
    import pyarrow as pa

    whole = stamps.cast(pa.int64())
    valid = np.asarray(whole.is_valid())
    count = np.asarray(whole.fill_null(0), dtype=np.int64)
    if not valid.any():
        return np.full(len(count), np.nan), ""
    first = int(count[np.argmax(valid)])
    seconds = np.where(valid, (count - first) * 1e-9, np.nan)
    text = datetime.fromtimestamp(first // 10**9, UTC).isoformat()[:19] + f".{first % 10**9:09d}".rstrip("0").rstrip(
        "."
    )
    return seconds, text + ("Z" if zone else "")


def _no_date(source: str, name: str, text: Any, zone: str | None, place: Any) -> DataError:
    """Name the first cell that is no date."""
    for index, cell in enumerate(text):
        value = cell.as_py()
        if value is None:
            continue
        if (_ZONE.search(value[10:]) is not None) != (zone is not None):
            return DataError(
                f"{source}: channel {name!r}, {place(index)}: {value[:40]!r} has {'no' if zone else 'a'} time zone, the"
                f" first date has {'one' if zone else 'none'}; write it in all of them"
            )
        try:
            datetime.fromisoformat(value)
        except ValueError:
            return DataError(f"{source}: channel {name!r}, {place(index)}: {value[:40]!r} is no date; {DATES}")
    return DataError(f"{source}: channel {name!r} holds dates before 1678 or after 2262, or in several forms; {DATES}")
