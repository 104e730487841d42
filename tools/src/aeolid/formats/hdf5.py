"""Take arrays out of an HDF5 file with h5py; everything here runs confined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np

from aeolid.confined import Reply
from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_size
from aeolid.formats.clock import is_time_heading
from aeolid.formats.table import Array

_NUMBERS = "biuf"
_UNIT_KEYS = ("unit", "units", "Unit", "Units")
_SAME_INSTANT = 1e-9  # seconds: channels of one clock carry the same stamps


@dataclass(frozen=True)
class _Place:
    """Say where an array stands: its full name, its data set, and its field where that is a table."""

    name: str
    item: Any
    field: str | None

    @property
    def group(self) -> str:
        """Return the name of what holds the array."""
        return self.name.rpartition("/")[0]

    @property
    def turned(self) -> bool:
        """Tell whether MATLAB wrote it, whose matrices lie column by column: their axes are in reverse."""
        return "MATLAB_class" in self.item.attrs

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape that whoever wrote the array knows."""
        shape = tuple(int(n) for n in self.item.shape)
        return shape[::-1] if self.turned else shape


def send_arrays(path: str, source: str, most: int) -> Generator[Reply, dict[str, Any], None]:
    """Say what numeric arrays there are, then send those that are wanted.

    Data that a file keeps in other files (external storage, virtual sets, links) are not followed.
    """
    import h5py

    with h5py.File(path, "r") as file:
        found: dict[str, _Place] = {}

        def visit(name: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or item.external or item.is_virtual or len(found) > MOST_CHANNELS:
                return
            if item.dtype.names and item.ndim == 1:
                fields = [f for f in item.dtype.names if item.dtype[f].kind in _NUMBERS]
                found.update({f"{name}/{f}": _Place(f"{name}/{f}", item, f) for f in fields})
            elif item.dtype.kind in _NUMBERS and item.ndim in (1, 2) and not _is_no_number(item):
                found[name] = _Place(name, item, None)

        file.visititems(visit)
        if len(found) > MOST_CHANNELS:
            raise DataError(f"{source}: more than {MOST_CHANNELS} arrays; export the ones needed")
        short = Counter(name.rpartition("/")[2] for name in found)
        places = {tail if short[tail := n.rpartition("/")[2]] == 1 else n: p for n, p in found.items()}
        units = {name: unit for name, p in places.items() if p.field is None and (unit := _unit(p.item))}
        shapes = {name: p.shape for name, p in places.items()}
        wanted = (yield {"asks": "wanted", "shapes": shapes, "units": units}, {})["wanted"]
        guard_size(source, sum(8 * int(np.prod(shapes[n])) for n in wanted), most)
        _require_one_clock(source, [places[n] for n in wanted], found, most)
        yield {}, {str(i): _read(source, places[name]) for i, name in enumerate(wanted)}


def _is_no_number(item: Any) -> bool:
    """Tell whether an array of numbers is a text of MATLAB, or the mark of an empty one, which holds its shape."""
    kind = item.attrs.get("MATLAB_class")
    return (kind in (b"char", "char")) or "MATLAB_empty" in item.attrs


def _require_one_clock(source: str, wanted: list[_Place], found: dict[str, _Place], most: int) -> None:
    """Refuse channels of groups whose own times differ: samples of one row would not be of one instant."""
    clocks: dict[str, list[_Place]] = {}
    for place in found.values():
        if is_time_heading(place.name.rpartition("/")[2]):
            clocks.setdefault(place.group, []).append(place)
    first = next((p for p in wanted if p in clocks.get(p.group, [])), None)
    time: Array | None = None
    for place in wanted:
        own = [c for c in clocks.get(place.group, []) if np.prod(c.shape) == max(place.shape, default=0)]
        if not own or any(c == first for c in own):
            continue
        first = own[0] if first is None else first
        guard_size(source, 24 * max(int(np.prod(c.shape)) for c in (first, *own)), most)
        time = _read(source, first).reshape(-1) if time is None else time
        if not any(_same(time, _read(source, c).reshape(-1)) for c in own):
            raise DataError(
                f"{source}: channel {place.name!r} has a time of its own, {own[0].name!r}, which differs from"
                f" {first.name!r}; export the channels resampled to one clock"
            )


def _same(time: Array, other: Array) -> bool:
    return len(time) == len(other) and bool(np.allclose(time, other, rtol=0, atol=_SAME_INSTANT, equal_nan=True))


def _read(source: str, place: _Place) -> Array:
    """Return an array in the units it is meant in: unpacked, and NaN where a value stands for a missing one (CF)."""
    if place.field is not None:
        return np.asarray(place.item.fields(place.field)[()], dtype=np.float64)
    raw = place.item[()]
    values = np.array(raw, dtype=np.float64)
    for mark in (m for key in ("_FillValue", "missing_value") for m in _attribute(place.item, key)):
        with np.errstate(all="ignore"):  # a mark that the numbers of the array cannot be is cast, and met nowhere
            values[(raw == mark) | ((raw == mark.astype(raw.dtype)) & (raw.dtype.kind == "f"))] = np.nan
    for key, apply in (("scale_factor", np.multiply), ("add_offset", np.add)):
        found = _attribute(place.item, key)
        if len(found) > 1:
            raise DataError(f"{source}: {place.name!r} has {len(found)} values of {key}; one is needed")
        values = apply(values, float(found[0])) if len(found) else values
    return values.T if place.turned else values


def _attribute(item: Any, key: str) -> Any:
    """Return the numbers of an attribute, one after the other; none where it is absent or no number."""
    found = np.asarray(item.attrs.get(key, ()))
    return found.reshape(-1) if found.dtype.kind in _NUMBERS else np.zeros(0)


def _unit(item: Any) -> str:
    """Return the unit that an attribute says."""
    for key in _UNIT_KEYS:
        value = item.attrs.get(key)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")[:100]
        if isinstance(value, str):
            return value[:100]
    return ""
