"""Write numbers as people read them: three or four significant digits, with unit and uncertainty."""

from __future__ import annotations

import math
from typing import Any

from aeolid.wording import last_place

OPEN = "not determined by these data"
_LOOSE = 10.0  # times a value that its deviation may be before the value says nothing
_FURTHEST = 1e15  # of a value in any unit of this trade; beyond it a fit has run away
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: Any, digits: int = 3) -> str:
    """Return e.g. '0.312', '20 400', '1.23·10⁻⁵'; a dash for what is absent or not finite."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "–" if value is None else str(value)
    if isinstance(value, int) and abs(value) < 10**9:
        return _grouped(str(value))
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -4 <= exponent < 6:
        mantissa = f"{value:.{digits - 1}e}".split("e")[0]
        return f"{mantissa}·10{str(exponent).translate(_SUPERSCRIPT)}".replace("-", "−")
    return _grouped(f"{round(value, digits - 1 - exponent):.{max(0, digits - 1 - exponent)}f}")


def is_loose(value: float, std: float) -> bool:
    """Tell whether a deviation is so large that the value says nothing."""
    return not math.isfinite(std) or std > _LOOSE * abs(value) > 0


def with_std(value: Any, std: Any, digits: int = 3) -> str:
    """Return value ± standard deviation, the value cut where the uncertainty begins (two of its digits)."""
    if not (isinstance(std, int | float) and isinstance(value, int | float)):
        return number(value, digits)
    if not (math.isfinite(std) and math.isfinite(value) and std > 0):
        return number(value, digits)
    if is_loose(value, std):
        return f"{number(value, digits)} ({OPEN})"
    last = last_place(std)
    if not -6 <= last <= 4 or std >= abs(value):  # an uncertainty beyond the value must not hide the value
        return f"{number(value, digits)} ± {number(std, 2)}"
    decimals = max(0, -last)
    return f"{_grouped(f'{round(value, -last):.{decimals}f}')} ± {_grouped(f'{round(std, -last):.{decimals}f}')}"


def percent(value: Any, digits: int = 3) -> str:
    """Return a fraction as a percentage."""
    return number(100.0 * value, digits) + " %" if isinstance(value, int | float) else "–"


def quantity(entry: Any, digits: int = 3) -> str:
    """Return {"value", "std", "unit"} or a bare number as text; a value that has run away is said to be open."""
    if not isinstance(entry, dict):
        return number(entry, digits)
    if is_open(entry.get("value")):
        return OPEN
    return f"{with_std(entry.get('value'), entry.get('std'), digits)} {unit_of(entry)}".strip()


def is_open(value: Any) -> bool:
    """Tell whether a value is none that a machine can have: absent, not finite, or beyond any size."""
    return value is None or (isinstance(value, float) and not abs(value) < _FURTHEST)


def unit_of(entry: Any) -> str:
    """Return a unit as it is read: that of a bare ratio is no word."""
    unit = str(entry.get("unit") or "") if isinstance(entry, dict) else str(entry or "")
    return "" if unit == "1" else unit


def _grouped(text: str) -> str:
    """Group thousands from five digits on, with a narrow space; the minus is a minus."""
    sign, digits = ("−", text[1:]) if text.startswith("-") else ("", text)
    whole, dot, rest = digits.partition(".")
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", "\u202f")
    return sign + whole + dot + rest
