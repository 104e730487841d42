"""Check what a confined reader sent: it may have been taken over by the file that it read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Failure
from aeolid.formats.table import Array

NONSENSE = "the process that reads it sent nonsense"


def names_of(facts: Mapping[str, Any], key: str = "names") -> tuple[str, ...]:
    """Return a list of texts; raises Failure where it is none."""
    names = facts.get(key)
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise Failure(NONSENSE)
    return tuple(names)


def units_of(facts: Mapping[str, Any], key: str = "units") -> dict[str, str]:
    """Return the units by channel, or another text; raises Failure where they are no texts."""
    units = facts.get(key)
    if not isinstance(units, dict) or not all(isinstance(unit, str) for unit in units.values()):
        raise Failure(NONSENSE)
    return units


def shapes_of(facts: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of named arrays; raises Failure where they are none."""
    shapes = facts.get("shapes")
    if not isinstance(shapes, dict) or not all(isinstance(shape, list) for shape in shapes.values()):
        raise Failure(NONSENSE)
    if not all(type(n) is int and n >= 0 for shape in shapes.values() for n in shape):
        raise Failure(NONSENSE)
    return {name: tuple(shape) for name, shape in shapes.items()}


def clocks_of(arrays: Mapping[str, NDArray[Any]], names: Sequence[str]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return values and seconds of channels with clocks of their own: arrays "0", "1", … and "t0", "t1", …"""
    values, clocks = {}, {}
    for i, name in enumerate(names):
        pair = columns_of({"0": arrays.get(str(i)), "1": arrays.get(f"t{i}")}, ["time", name])  # type: ignore[dict-item]
        values[name], clocks[name] = pair["time"], pair[name]
    return values, clocks


def columns_of(arrays: Mapping[str, NDArray[Any]], names: Sequence[str]) -> dict[str, Array]:
    """Return arrays "0", "1", … as the columns of these names; raises Failure where they are not of one length."""
    found = [arrays.get(str(i)) for i in range(len(names))]
    columns = [a for a in found if a is not None and a.ndim == 1 and a.dtype == np.float64]
    if len(columns) < len(names) or len({len(a) for a in columns}) > 1:
        raise Failure(NONSENSE)
    return dict(zip(names, columns, strict=True))
