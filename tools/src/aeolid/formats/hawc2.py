"""Read HAWC2's results: the list of channels `run.sel`, and their numbers `run.dat`, packed or as text."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_names, guard_size
from aeolid.formats.table import Array, Choose, Table, positions, unreadable
from aeolid.inputs import open_regular, regular_size

_KIND = "HAWC2 results"
_MOST_HEADER = 16 << 20  # bytes
_FIRST = 12  # line, from 0, of the first channel
_NAME, _UNIT, _TEXT = slice(12, 43), slice(43, 54), slice(54, None)


@dataclass(frozen=True)
class _Head:
    """Hold the list of channels: samples, whether packed, headings, units, and the scale of each packed channel."""

    samples: int
    packed: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    scale: Array


def companions(path: Path) -> list[Path]:
    """Return the files that a recording of this name consists of, itself first."""
    return [path.with_suffix(".sel"), path.with_suffix(".dat")]


def read_hawc2(path: Path, choose: Choose) -> Table:
    """Read the chosen channels of `run.sel` and `run.dat`; either name will do. Raises DataError."""
    listing, data = companions(path)
    if not listing.exists():
        raise DataError(f"{listing}: no such file; HAWC2's list of channels lies beside its {data.name}")
    if regular_size(listing) > _MOST_HEADER:
        raise DataError(f"{listing}: more than {_MOST_HEADER >> 20} MiB; this is no list of channels")
    with open_regular(listing) as handle:
        text = handle.read(_MOST_HEADER).decode("latin-1")
    try:
        head = _parsed(text.splitlines())
    except (ValueError, IndexError, OverflowError) as error:
        raise unreadable(listing, _KIND, error) from None
    wanted = tuple(dict.fromkeys(choose(guard_names(listing, head.names), head.names[0])))
    index = positions(head.names, wanted)
    columns = _packed(data, head, index) if head.packed else _plain(data, head, index)
    units = dict(zip(head.names, head.units, strict=True))
    return Table(str(path), head.names, dict(zip(wanted, columns, strict=True)), units, head.names[0])


def _parsed(lines: list[str]) -> _Head:
    words = lines[8].split()
    samples, channels, form = int(words[0]), int(words[1]), words[3].upper()
    if samples < 0 or not 1 <= channels <= MOST_CHANNELS:
        raise ValueError(f"{samples} samples of {channels} channels")
    rows = lines[_FIRST : _FIRST + channels]
    if len(rows) < channels:
        raise ValueError(f"{len(rows)} of {channels} channels are listed")
    names = [(row[_NAME].strip(), row[_TEXT].strip()) for row in rows]
    said = Counter(text for _, text in names)
    # the description says most; where it is that of several channels, both together
    headings = [t if t and said[t] == 1 else f"{n} {t}".strip() for n, t in names]
    twice = Counter(headings)
    headings = [h if twice[h] == 1 and h else f"{h} ({i + 1})".strip() for i, h in enumerate(headings)]
    packed = form == "BINARY"
    scale = np.ones(channels)
    if packed:
        scale = np.array([float(v) for v in lines[_FIRST + channels + 2 :][:channels]])
        if len(scale) < channels:
            raise ValueError(f"{len(scale)} of {channels} scales are listed")
    units = tuple(_unit(row[_UNIT].strip()) for row in rows)
    return _Head(samples, packed, tuple(headings), units, scale)


def _unit(text: str) -> str:
    return {"kNm": "kN m", "Nm": "N m", "-": "", "rad/s2": "rad/s^2", "m/s2": "m/s^2"}.get(text, text)


def _packed(data: Path, head: _Head, index: list[int]) -> list[Array]:
    """Read chosen channels of 16-bit numbers, one channel after the other."""
    if regular_size(data) < 2 * head.samples * len(head.names):
        raise DataError(
            f"{data}: {head.samples} samples of {len(head.names)} channels are announced, the file is too short for"
            " them; the simulation was cut off or the file copied in part"
        )
    guard_size(data, 8 * head.samples * len(index))
    columns = []
    with open_regular(data) as handle:
        for i in index:
            handle.seek(2 * head.samples * i)
            raw = np.frombuffer(handle.read(2 * head.samples), "<i2")
            columns.append(np.asarray(raw * head.scale[i], dtype=np.float64))
    return columns


def _plain(data: Path, head: _Head, index: list[int]) -> list[Array]:
    """Read chosen channels of text, a row a sample."""
    size = regular_size(data)
    if size < 2 * head.samples * len(head.names):
        raise DataError(f"{data}: {head.samples} samples of {len(head.names)} channels do not fit in {size} bytes")
    guard_size(data, 8 * head.samples * len(index))
    table = np.empty((head.samples, len(index)))
    with open_regular(data) as handle:
        for k in range(head.samples):
            cells = handle.readline(1 << 20).split()
            if len(cells) != len(head.names):
                raise DataError(f"{data}: sample {k + 1} has {len(cells)} cells, {len(head.names)} are announced")
            try:
                table[k] = [float(cells[i]) for i in index]
            except ValueError as error:
                raise unreadable(data, _KIND, error) from None
    return [np.ascontiguousarray(table[:, j]) for j in range(len(index))]
