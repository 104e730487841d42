"""Turn raw values of MDF4 into physical ones: line, quotient, tables, and formulas by our own arithmetic.

A formula of the file is text from outside: it is parsed by the grammar of `aeolid.models.expressions` (numbers, X,
+ - * / **, a dozen functions) and computed on arrays; nothing else in it is ever evaluated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.errors import DataError
from aeolid.formats.table import Array
from aeolid.models.expressions import names_in, parse, values_of

_SAME, _LINE, _QUOTIENT, _FORMULA, _INTERPOLATED, _TABLE, _RANGES = range(7)
_TEXTS = {7: "text", 8: "text", 9: "text", 10: "text", 11: "text"}  # value to text, ranges to text, …, bit fields
_LONGEST = 1000  # characters of a formula


def is_formula(conversion: Any) -> bool:
    """Tell whether a conversion block is a formula."""
    return conversion is not None and conversion.conversion_type == _FORMULA


def convert(source: str, name: str, conversion: Any, raw: Array, whole: bool) -> Array:
    """Return physical values (N,) of raw ones (N,).

    conversion: block of asammdf, None where there is none;
    whole: whether the raw values are integers.

    Raises DataError, naming the channel, for a formula that is no arithmetic, a table without entries, and for
    conversions into text.
    """
    kind = _SAME if conversion is None else conversion.conversion_type
    if kind == _SAME:
        return raw
    with np.errstate(all="ignore"):  # a quotient with a root gives what is refused as infinite
        if kind == _LINE:
            return raw * float(conversion.a) + float(conversion.b)
        if kind == _QUOTIENT:
            p1, p2, p3, p4, p5, p6 = (float(conversion[f"P{i}"]) for i in range(1, 7))
            return np.asarray((p1 * raw**2 + p2 * raw + p3) / (p4 * raw**2 + p5 * raw + p6))
        if kind == _FORMULA:
            return _formula(source, name, str(conversion.formula), raw)
        if kind in (_INTERPOLATED, _TABLE):
            return _table(source, name, conversion, raw)
        if kind == _RANGES:
            return _ranges(source, name, conversion, raw, whole)
    what = "into text" if kind in _TEXTS else f"of unknown kind {kind}"
    raise DataError(f"{source}: channel {name!r} has a conversion {what}; export it as a number")


def _formula(source: str, name: str, text: str, raw: Array) -> Array:
    where = f"{source}: channel {name!r}, formula of its conversion"
    if len(text) > _LONGEST:
        raise DataError(f"{where}: longer than {_LONGEST} characters; export the channel converted")
    tree = parse(text.strip("\0"), where)
    unknown = sorted(names_in(tree) - {"X", "X1"})
    if unknown:
        raise DataError(f"{where}: {unknown[0]!r} is not known; the raw value is called X or X1")
    values = values_of(tree, {"X": raw, "X1": raw})
    return np.array(np.broadcast_to(values, raw.shape), dtype=float)


def _entries(source: str, name: str, conversion: Any, count: int, *keys: str) -> list[Array]:
    if count < 1:
        raise DataError(f"{source}: channel {name!r} is converted by a table without entries; export it converted")
    return [np.array([conversion[f"{key}_{i}"] for i in range(count)], dtype=float) for key in keys]


def _table(source: str, name: str, conversion: Any, raw: Array) -> Array:
    """Take values from a table of points: on lines between them, or the nearest one's, the lower of two as near."""
    at, values = _entries(source, name, conversion, conversion.val_param_nr // 2, "raw", "phys")
    if np.any(np.diff(at) < 0):
        raise DataError(f"{source}: the conversion table of channel {name!r} does not rise; export it converted")
    if conversion.conversion_type == _INTERPOLATED:
        return np.interp(raw, at, values)
    above = np.minimum(np.searchsorted(at, raw), len(at) - 1)
    below = np.maximum(above - 1, 0)
    nearest = np.where(np.abs(raw - at[below]) <= np.abs(raw - at[above]), below, above)
    return np.where(np.isnan(raw), np.nan, values[nearest])


def _ranges(source: str, name: str, conversion: Any, raw: Array, whole: bool) -> Array:
    """Take values from a table of ranges, the upper end included for integers; the default outside all of them."""
    count = (conversion.val_param_nr - 1) // 3
    lower, upper, values = _entries(source, name, conversion, count, "lower", "upper", "phys")
    if np.any(np.diff(lower) < 0):
        raise DataError(f"{source}: the conversion table of channel {name!r} does not rise; export it converted")
    place = np.searchsorted(lower, raw, side="right") - 1
    inside = (place >= 0) & ((raw <= upper[place]) if whole else (raw < upper[place]))
    return np.where(np.isnan(raw), np.nan, np.where(inside, values[place], float(conversion.default)))
