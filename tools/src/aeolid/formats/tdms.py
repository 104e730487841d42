"""Take channels out of a TDMS file with npTDMS; everything here runs confined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from typing import Any

import numpy as np

from aeolid.confined import Reply
from aeolid.errors import DataError
from aeolid.formats.bounds import guard_size
from aeolid.formats.clock import relative
from aeolid.formats.table import Array, to_numbers

CLOCK = "time_s"
_SAME_INSTANT = 1e-9  # seconds


def send_channels(path: str, source: str, most: int, own: bool = False) -> Generator[Reply, dict[str, Any], None]:
    """Say what channels there are, then send those that are wanted, on the clock of their waveforms, or each its own.

    Where no channel says its sample time there is no clock, and a channel of time has to be one of the columns.
    """
    from nptdms import TdmsFile

    with TdmsFile.open(path) as file:
        channels = [c for group in file.groups() for c in group.channels()]
        short = Counter(c.name for c in channels)
        places = {c.name if short[c.name] == 1 else f"{c.group_name}/{c.name}": c for c in channels}
        waves = {n for n, c in places.items() if _step(c) is not None}
        names = ([CLOCK] if waves else []) + list(places)
        units = {n: str(c.properties.get("unit_string") or "")[:100] for n, c in places.items()} | {CLOCK: "s"}
        facts = {"names": names, "units": {n: u for n, u in units.items() if u}, "clock": CLOCK if waves else None}
        wanted = (yield {"asks": "wanted"} | facts, {})["wanted"]
        guard_size(source, sum(16 * len(places[n]) for n in wanted if n != CLOCK), most)
        begins: dict[str, str] = {}
        columns = {n: _values(source, n, places[n], begins) for n in wanted if n != CLOCK}
        stamps = {n: _stamps(source, n, places[n]) for n in columns} if waves else {}
        if stamps:
            begins |= _from_the_earliest({n: places[n] for n in stamps}, stamps)
        if own and waves:
            pairs = {str(i): columns[n] for i, n in enumerate(columns)}
            yield {"begins": begins}, pairs | {f"t{i}": stamps[n] for i, n in enumerate(columns)}
            return
        clock = _one_clock(source, stamps)
        _require_one_length(source, columns)
        yield {"begins": begins}, {str(i): clock if n == CLOCK else columns[n] for i, n in enumerate(wanted)}


def _step(channel: Any) -> float | None:
    step = channel.properties.get("wf_increment")
    return float(step) if isinstance(step, int | float) and 0 < step < 1e6 else None


def _values(source: str, name: str, channel: Any, begins: dict[str, str]) -> Array:
    values = channel[:]
    if np.asarray(values).dtype.kind == "M":
        import pyarrow as pa

        seconds, begins[name] = relative(pa.array(values.astype("datetime64[ns]")), "UTC")
        return seconds
    return to_numbers(source, name, values)


def _stamps(source: str, name: str, channel: Any) -> Array:
    step = _step(channel)
    if step is None:
        raise DataError(f"{source}: channel {name!r} says no sample time (wf_increment), others do; leave it out")
    offset = channel.properties.get("wf_start_offset", 0.0)
    first = float(offset) if isinstance(offset, int | float) and np.isfinite(offset) else 0.0
    return first + step * np.arange(len(channel), dtype=np.float64)


def _from_the_earliest(channels: dict[str, Any], stamps: dict[str, Array]) -> dict[str, str]:
    """Let stamps count from the earliest start of a waveform; returns that instant where every channel says its own."""
    starts = {n: c.properties.get("wf_start_time") for n, c in channels.items()}
    instants = {n: s.astype("datetime64[ns]") for n, s in starts.items() if isinstance(s, np.datetime64)}
    known = {n: int(s.astype(np.int64)) for n, s in instants.items() if not np.isnat(s)}
    earliest = min(known.values(), default=0)
    for name, start in known.items():
        stamps[name] += 1e-9 * (start - earliest)
    if len(known) < len(channels):
        return {}
    import pyarrow as pa

    _, begin = relative(pa.array(np.array([earliest], "datetime64[ns]")), "UTC")
    return {CLOCK: begin}


def _one_clock(source: str, stamps: dict[str, Array]) -> Array:
    first = next(iter(stamps), None)
    if first is None:
        return np.zeros(0)
    time = stamps[first]
    for name, other in stamps.items():
        if len(other) != len(time) or (len(time) and np.max(np.abs(other - time)) > _SAME_INSTANT):
            raise DataError(
                f"{source}: channels {first!r} ({len(time)} samples) and {name!r} ({len(other)} samples) have different"
                " clocks; let --resample bring them to one, or export them resampled"
            )
    return time


def _require_one_length(source: str, columns: dict[str, Array]) -> None:
    lengths = {n: len(v) for n, v in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{n} {k}" for n, k in list(lengths.items())[:6])
        raise DataError(f"{source}: channels differ in their number of samples ({told}) and say no sample time")
