"""Take arrays out of an HDF5 file with h5py; everything here runs confined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Reply
from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_size

_NUMBERS = "biuf"
_UNIT_KEYS = ("unit", "units", "Unit", "Units")


def send_arrays(path: str, source: str, most: int) -> Generator[Reply, dict[str, Any], None]:
    """Say what numeric arrays there are, then send those that are wanted.

    Data that a file keeps in other files (external storage, virtual sets, links) are not followed.
    """
    import h5py

    with h5py.File(path, "r") as file:
        found: dict[str, tuple[Any, str | None]] = {}

        def visit(name: str, item: Any) -> None:
            if not isinstance(item, h5py.Dataset) or item.external or item.is_virtual or len(found) > MOST_CHANNELS:
                return
            if item.dtype.names and item.ndim == 1:
                fields = item.dtype.names
                found.update({f"{name}/{f}": (item, f) for f in fields if item.dtype[f].kind in _NUMBERS})
            elif item.dtype.kind in _NUMBERS and item.ndim in (1, 2):
                found[name] = (item, None)

        file.visititems(visit)
        if len(found) > MOST_CHANNELS:
            raise DataError(f"{source}: more than {MOST_CHANNELS} arrays; export the ones needed")
        short = Counter(name.rpartition("/")[2] for name in found)
        places = {tail if short[tail := n.rpartition("/")[2]] == 1 else n: p for n, p in found.items()}
        units = {name: unit for name, (item, field) in places.items() if field is None and (unit := _unit(item))}
        shapes = {name: item.shape for name, (item, _) in places.items()}
        wanted = (yield {"asks": "wanted", "shapes": shapes, "units": units}, {})["wanted"]
        guard_size(source, sum(8 * int(np.prod(places[n][0].shape)) for n in wanted), most)
        yield {}, {str(i): _read(*places[name]) for i, name in enumerate(wanted)}


def _read(item: Any, field: str | None) -> NDArray[Any]:
    return np.asarray(item[()] if field is None else item.fields(field)[()], dtype=np.float64)


def _unit(item: Any) -> str:
    """Return the unit that an attribute says."""
    for key in _UNIT_KEYS:
        value = item.attrs.get(key)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")[:100]
        if isinstance(value, str):
            return value[:100]
    return ""
