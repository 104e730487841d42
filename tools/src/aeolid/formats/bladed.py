"""Read Bladed's results: a header `run.%04`, its numbers in `run.$04`; a whole run by its project file `run.$PJ`.

The header is text, a keyword and its values a line. Numbers are SI, and their units stand there as codes. Which file
holds which channel is Bladed's own business, so a project file stands for all results beside it that have its name and
the clock of the longest.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_names, guard_size
from aeolid.formats.table import Array, Choose, Table, unreadable
from aeolid.inputs import open_regular, regular_size

_KIND = "Bladed results"
_MOST_HEADER = 4 << 20  # bytes
_MOST_IN_LINE = 64 << 10  # characters: thousands of names
_MOST_FILES = 200
_WORD = re.compile(r"""'([^']*)'|"([^"]*)"|([^\s'"]+|['"])""")  # a quote without its other end is a word
_TYPES = {"R*4": "<f4", "R*8": "<f8", "I*4": "<i4", "I*2": "<i2"}
_UNITS = {
    "A": "rad", "T": "s", "F": "N", "FL": "N m", "L": "m", "L/T": "m/s", "L/TT": "m/s^2", "A/T": "rad/s", "P": "W",
    "A/TT": "rad/s^2", "1/T": "Hz", "M": "kg", "V": "V", "I": "A", "F/L": "N/m", "F/LL": "N/m^2", "N": "",
}  # fmt: skip
CLOCK = "Time"


@dataclass(frozen=True)
class _Result:
    """Hold one header: its data file, kind of numbers, channels with units, samples, first instant and step (s)."""

    data: Path
    kind: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    samples: int
    first: float
    step: float
    times: tuple[float, ...]

    @property
    def clock(self) -> tuple[int, float, float]:
        """Return what tells two clocks apart."""
        return self.samples, self.first, self.step


def is_bladed(path: Path) -> bool:
    """Tell whether a name is that of a result, of its numbers, or of a project."""
    return re.fullmatch(r"\.([%$]\d{1,3}|\$pj)", path.suffix.lower()) is not None


def companions(path: Path) -> list[Path]:
    """Return the files that a recording of this name consists of, itself first."""
    return [path, *(r.data for r in _results(path))]


def beside(path: Path) -> list[Path]:
    """Return the headers and numbers that a recording of this name may consist of, unread."""
    try:
        return sorted(p for p in path.parent.iterdir() if p.stem == path.stem and is_bladed(p))
    except OSError:
        return []


def read_bladed(path: Path, choose: Choose) -> Table:
    """Read the chosen channels of a result, or of all results of a project. Raises DataError."""
    results = _results(path)
    headings = _headings(results)
    place = {heading: (result, i) for heading, result, i in headings}
    units = {CLOCK: "s"} | {heading: result.units[i] for heading, result, i in headings}
    names = guard_names(path, (CLOCK, *(heading for heading, _, _ in headings)))
    wanted = choose(names, CLOCK)
    first = results[0]
    columns: dict[str, Array] = {}
    held: dict[Path, Array] = {}
    for name in dict.fromkeys(wanted):
        if name == CLOCK:
            uniform = first.first + first.step * np.arange(first.samples, dtype=np.float64)
            columns[name] = np.array(first.times, dtype=np.float64) if first.times else uniform
            continue
        result, i = place[name]
        if result.data not in held:
            held = {result.data: _numbers(result)}  # one file at a time
        columns[name] = np.ascontiguousarray(held[result.data][:, i], dtype=np.float64)
    return Table(str(path), names, columns, units, CLOCK)


def _headings(results: Sequence[_Result]) -> list[tuple[str, _Result, int]]:
    """Return a heading for every channel, its result and its place there: the name where no other channel has it.

    Behind a name of several channels stands which result it is from, and its place there where that has several.
    """
    count = Counter([CLOCK, *(name for result in results for name in result.names)])
    found = []
    for result in results:
        own = Counter(result.names)
        for i, name in enumerate(result.names):
            which = result.data.suffix if own[name] == 1 else f"{result.data.suffix} {i + 1}"
            found.append((name if count[name] == 1 else f"{name} ({which})", result, i))
    return found


def _results(path: Path) -> list[_Result]:
    """Return the headers behind a name, those of one clock, the one with most samples first."""
    if path.suffix.lower() != ".$pj":
        return [_header(path.with_suffix(path.suffix.replace("$", "%")))]
    found = []
    own = sorted(p for p in path.parent.iterdir() if p.stem == path.stem and re.fullmatch(r"\.%\d{1,3}", p.suffix))
    for header in own[:_MOST_FILES]:
        try:
            found.append(_header(header))
        except DataError:
            continue  # what is no time series beside it
    if not found:
        raise DataError(f"{path}: no result {path.stem}.%… with a time series lies beside it; name one of them")
    clock = max((r.clock for r in found), key=lambda c: c[0])
    return [r for r in found if r.clock == clock]


def _header(path: Path) -> _Result:
    """Read one header, and compare what it announces with the size of its data file."""
    if regular_size(path) > _MOST_HEADER:
        raise DataError(f"{path}: a header of more than {_MOST_HEADER >> 20} MiB is none of Bladed's")
    with open_regular(path) as handle:
        text = handle.read(_MOST_HEADER).decode("latin-1")
    data = path.with_suffix(path.suffix.replace("%", "$"))
    try:
        return _parsed(path, data, dict(_entries(text)))
    except (ValueError, KeyError, IndexError, OverflowError) as error:
        raise unreadable(path, _KIND, error) from None


def _entries(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the keyword of each line and its values, bare or within quotes; in time that goes with the length."""
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > _MOST_IN_LINE:
            raise ValueError(f"line {number} has more than {_MOST_IN_LINE >> 10} KiB")
        words = [found[1] or found[2] or found[3] or "" for found in _WORD.finditer(line)]
        if words:
            yield words[0].upper(), words[1:]


def _parsed(path: Path, data: Path, found: dict[str, list[str]]) -> _Result:
    sizes = [int(n) for n in found["DIMENS"]]
    if len(sizes) not in (2, 3) or any(n < 1 for n in sizes) or math.prod(sizes[:-1]) > MOST_CHANNELS:
        raise ValueError(f"dimensions {sizes[:4]} are none of channels over time")
    if found.get("AXISLAB", ["Time"])[0].lower() != "time" and found.get("AXIUNIT", ["T"])[0] != "T":
        raise ValueError("its last axis is not the time")
    samples, width = sizes[-1], math.prod(sizes[:-1])
    kind = found.get("FORMAT", ["R*4"])[0].upper()
    binary = found.get("ACCESS", ["D"])[0].upper() == "D"
    if binary and kind not in _TYPES:
        raise ValueError(f"numbers of kind {kind[:8]}")
    if binary and regular_size(data) < samples * width * np.dtype(_TYPES[kind]).itemsize:
        raise DataError(f"{data}: {samples} samples of {width} channels are announced, the file is too short for them")
    names = found["VARIAB"][: sizes[0]]
    codes = [*found.get("VARUNIT", [])[: sizes[0]], *["N"] * sizes[0]][: sizes[0]]
    if len(names) < sizes[0]:
        raise ValueError(f"{len(names)} names for {sizes[0]} channels")
    units = [_UNITS.get(code.upper(), "") for code in codes]
    if len(sizes) == 3:  # of several places, the first axis runs fastest
        places = [*found.get("AXITICK", []), *map(str, range(1, sizes[1] + 1))][: sizes[1]]
        names, units = [f"{n} at {at}" for at in places for n in names], units * sizes[1]
    times = tuple(float(v) for v in found.get("AXIVAL", [])) if found.get("AXIMETH", ["2"])[0] == "3" else ()
    first, step = float(found.get("MIN", ["0"])[0]), float(found.get("STEP", ["0"])[0])
    if (times and len(times) != samples) or (not times and not (step > 0 and math.isfinite(first))):
        raise ValueError("no step of time")
    return _Result(data, kind if binary else "text", tuple(names), tuple(units), samples, first, step, times)


def _numbers(result: _Result) -> Array:
    """Return the numbers of a result (samples, channels)."""
    width = len(result.names)
    guard_size(result.data, 8 * result.samples * width)
    with open_regular(result.data) as handle:
        if result.kind != "text":
            dtype = np.dtype(_TYPES[result.kind])
            content = handle.read(result.samples * width * dtype.itemsize)
            return np.frombuffer(content, dtype).reshape(result.samples, width).astype(np.float64)
        try:
            values = np.array(handle.read().split(), dtype=np.float64)
        except ValueError as error:
            raise unreadable(result.data, _KIND, error) from None
    if values.size < result.samples * width:
        raise DataError(f"{result.data}: {result.samples} samples of {width} channels are announced, fewer are there")
    return values[: result.samples * width].reshape(result.samples, width)
