"""Declare a number that decides: its value by default, its unit, what it means and where it comes from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields
from typing import Any, TypeVar

from aeolid.errors import DataError
from aeolid.text_files import is_number, shown

Number = TypeVar("Number", int, float)

# Where a number comes from that neither a level nor a measurement gives: the pages that tell what was tried.
DECISIONS = "decisions: diagnosis"
RUN_DECISIONS = "decisions: run as prior"
LEVEL = "level"

# Ends of what a number may be, by its unit; a number of another unit is none or more.
_RANGES = {
    "share": (0.0, 1.0), "chance": (0.0, 1.0), "cos²": (0.0, 1.0), "cosine": (-1.0, 1.0), "correlation": (-1.0, 1.0),
}  # fmt: skip
_ABOVE_ZERO = ("chance", "times", "odds", "minutes", "log")  # what is divided by, or has a logarithm


@dataclass(frozen=True)
class Rule:
    """Hold what is known of a number that decides; name: its section and its own, as in a file of rules."""

    name: str
    value: int | float
    unit: str
    meaning: str
    source: str


def rule(default: Number, unit: str, meaning: str, source: str = DECISIONS) -> Number:
    """Declare a field of a section; its type is that of the default.

    source: LEVEL for the level of a test, "measured: …" with what was measured, else the page of decisions.
    """
    told = {"unit": unit, "meaning": meaning, "source": source}
    return field(default=default, metadata=told)


def rules_in(section: Any, name: str) -> Iterator[Rule]:
    """Yield the numbers of a section of this name, in the order in which they are declared."""
    for f in fields(section):
        m = f.metadata
        yield Rule(f"{name}.{f.name}", getattr(section, f.name), m["unit"], m["meaning"], m["source"])


def ends_of(unit: str, whole: bool) -> tuple[float, float]:
    """Return the lowest and the highest value of a number of this unit; inf where there is no highest."""
    return (1, math.inf) if whole else _RANGES.get(unit, (0.0, math.inf))


def checked(found: Field[Any], value: Any, key: str) -> int | float:
    """Return a value for a field; raises DataError that names the key where it can be none."""
    whole = isinstance(found.default, int)
    if not is_number(value) or (whole and not isinstance(value, int)):
        raise DataError(f"{key} = {shown(value)}: a finite {'whole ' if whole else ''}number is needed here")
    unit = found.metadata["unit"]
    low, high = ends_of(unit, whole)
    if not low <= value <= high or (value == 0 and unit in _ABOVE_ZERO):
        least = "above 0" if unit in _ABOVE_ZERO and not whole else f"of at least {low:g}"
        most = f" and at most {high:g}" if math.isfinite(high) else ""
        raise DataError(f"{key} = {shown(value)}: a number {least}{most} is needed here [{unit}]")
    return value if whole else float(value)


def quoted(value: float) -> float:
    """Return a rule's number for a text or a table, where it decides nothing and its margins must not count it."""
    found: float = getattr(value, "quoted", value)
    return found
