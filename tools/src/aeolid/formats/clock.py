"""Turn a time column into seconds: by its unit, by what it counts from, and from dates as text.

Numbers since 1970 are told by their size: a recording made between 1973 and 2100 has 1e8 … 4e9 seconds behind it, so
the same count in ms, µs and ns lies in decades of its own. A column without a unit that steps by 1 or more is not
guessed: milliseconds and seconds look alike there, and the sentence asks.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.headings import plain_unit, split_heading
from aeolid.formats.table import Array, Table
from aeolid.record import TIME_UNITS

log = logging.getLogger("aeolid.formats")

UNITS = dict(zip(TIME_UNITS, (1.0, 1e-3, 1e-6, 1e-9, 60.0, 3600.0, 86400.0), strict=True))
_WORDS = {
    "µs": "us", "μs": "us", "msec": "ms", "usec": "us", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns",
    "minutes": "min", "hours": "h", "days": "d", "millis": "ms", "micros": "us", "hr": "h",
}  # fmt: skip
_SUFFIX = re.compile(r"(?:^|[_\s])(s|sec|seconds|ms|msec|us|usec|ns|min|minutes|h|hours)$", re.IGNORECASE)
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))
_RARE_S = 3600.0  # between samples: a count of another kind is likelier than such a recording of a machine
_DAYS = ((3.5e4, 8e4), (6.9e5, 8e5))  # since 1900 (1996 to 2119) and since the year 0 (1889 to 2190)
_DAYS_STEP = 1e-4  # days: 8.6 s
_ASK_FROM = 1.0  # steps of a column without unit, from which its unit is asked for
_DATE = re.compile(r"\s*(?:\d{4}[-/]\d\d[-/]\d\d|\d\d\.\d\d\.\d{4})(?:[T\s]+\d\d:\d\d.*)?\s*$")
_OTHER_DATE = re.compile(r"\s*\d{1,2}[/.-]\d{1,2}[/.-]\d{2,4}\b|\s*\d{1,2}:\d\d(?::\d\d)?|\d{4}-W\d\d|\s*\d{8}T\d{4,6}")
_ZONE = re.compile(r"(?:Z|[+-]\d\d(?::?\d\d)?)\s*$")
DATES = "dates are read as 2024-03-01T12:00:00.05, with Z or +01:00 where the zone is known, or 01.03.2024 12:00:00"


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
    said = unit_of_time(heading, unit, source) if stated is None else stated
    epoch = next((u for least, u in _EPOCHS if len(known) and known[0] >= least), None)
    if said is None and epoch is not None and _step(known) * UNITS[epoch] > _RARE_S:
        said = _by_declared(known, declared)
        if said is None:
            reading = f"as {epoch} since 1970 that is one sample every {_step(known) * UNITS[epoch]:.4g} s"
            raise _open(source, heading, known, reading, "ns, us, ms or s")
    elif stated is None and epoch is not None and (said is None or known[0] * UNITS[said] > 1e10):
        if epoch != "s" or said != "s":
            log.warning(
                "%s: the time column %r counts %s since 1970, so it is taken in %s", source, heading, epoch, epoch
            )
        return _since_1970(values, known[0], UNITS[epoch])
    if said is None:
        said = _by_declared(known, declared) or "s"
        if said == "s" and declared is None:
            _ask(source, heading, known)
    scale = UNITS[said]
    if scale != 1.0:
        log.warning(
            "%s: the time column %r is in %s; one sample takes %.6g s", source, heading, said, _step(known) * scale
        )
    if len(known) and 1e8 <= known[0] * scale <= 1e10:
        return _since_1970(values, known[0], scale)
    return Clock(values * scale if scale != 1.0 else values)


def _since_1970(values: Array, first: float, scale: float) -> Clock:
    """Return a count since 1970 in seconds, still since 1970: periods of a fleet go by it."""
    begins = datetime.fromtimestamp(first * scale, UTC).isoformat().replace("+00:00", "Z")
    return Clock(values * scale if scale != 1.0 else values, begins)


def _step(known: Array) -> float:
    return float(np.median(np.diff(known))) if len(known) > 1 else 0.0


def _by_declared(known: Array, declared: float | None) -> str | None:
    """Return the unit in which a column without one has the declared sample time."""
    step = _step(known)
    if declared is None or step <= 0:
        return None
    return next((u for u, scale in UNITS.items() if abs(step * scale / declared - 1) < 0.01), None)


def _ask(source: str, heading: str, known: Array) -> None:
    step = _step(known)
    days = any(least <= known[0] <= most for least, most in _DAYS) if len(known) else False
    if days and 0 < step < _DAYS_STEP:
        raise _open(source, heading, known, f"in days that is one sample in {step * 86400:.4g} s", "d or s")
    if step >= _ASK_FROM:
        raise DataError(
            f"{source}: the time column {heading!r} steps by {step:g} and does not say its unit: in milliseconds that"
            f' is {1e3 / step:g} samples a second, in seconds one every {step:g} s; set time_unit = "ms" or "s"'
            " under [recording] in the roles file"
        )


def _open(source: str, heading: str, known: Array, reading: str, units: str) -> DataError:
    """Build the question for a unit that the numbers do not tell."""
    return DataError(
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
