"""Read the bounds of an experiment: amounts with units, by the names of a model's channels."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from aeolid.errors import UsageError
from aeolid.models.model_file import Signal
from aeolid.units import factor, rightly

_AMOUNT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.S)
LARGEST = 1e12  # in a channel's unit, as the wrapper for controllers takes it
Amounts = Mapping[str, float | str]


@dataclass(frozen=True)
class Bound:
    """Hold what an input may do, in the model's unit: |u| ≤ amplitude, |du/dt| ≤ rate (inf: any) a second.

    demand: least and most of the whole demand, None where nothing is said.
    """

    name: str
    unit: str
    amplitude: float
    rate: float = math.inf
    demand: tuple[float, float] | None = None


def read_pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    """Read texts NAME=VALUE of one option; raises UsageError on one without a name, or a name that comes twice."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        if not equals or not name.strip() or not value.strip():
            raise UsageError(f"{option} {text!r} is not NAME=VALUE, such as pitch=2deg")
        if name.strip() in found:
            raise UsageError(f"{option}: {name.strip()!r} is given twice; keep one")
        found[name.strip()] = value.strip()
    return found


def read_bounds(
    inputs: Sequence[Signal], amplitudes: Amounts, rates: Amounts, demands: Mapping[str, str | Sequence[float]]
) -> tuple[Bound, ...]:
    """Return the bounds of the inputs that have an amplitude, in the model's order; raises UsageError."""
    known = {s.name: s for s in inputs}
    if not amplitudes:
        raise UsageError(
            f"no input has a bound; --bound NAME=AMPLITUDE says which inputs are excited and by how much: "
            f"{', '.join(known)}"
        )
    for option, given in (("--bound", amplitudes), ("--rate", rates), ("--demand", demands)):
        _require_known(option, given, known, "inputs")
        if unbounded := [n for n in given if n not in amplitudes]:
            raise UsageError(f"{option} {unbounded[0]}: without --bound {unbounded[0]}=AMPLITUDE it is not excited")
    out = []
    for name, signal in known.items():
        if name in amplitudes:
            amplitude = _positive("--bound", name, read_amount("--bound", name, amplitudes[name], signal.unit))
            rate = _positive("--rate", name, _read_rate(name, rates[name], signal.unit)) if name in rates else math.inf
            demand = read_range(name, demands[name], signal.unit) if name in demands else None
            out.append(Bound(name, signal.unit, amplitude, rate, demand))
    return tuple(out)


def read_limits(outputs: Sequence[Signal], limits: Amounts) -> dict[str, float]:
    """Return the largest standard deviation of outputs, in the model's units; raises UsageError."""
    known = {s.name: s for s in outputs}
    _require_known("--limit", limits, known, "outputs")
    return {n: _positive("--limit", n, read_amount("--limit", n, v, known[n].unit)) for n, v in limits.items()}


def read_amount(option: str, name: str, given: float | str, unit: str) -> float:
    """Return an amount in the channel's unit; a text may name a unit of the same quantity. Raises UsageError."""
    value, stated = _split(option, name, given)
    if not stated:
        return value
    ratio = factor(rightly(stated) or stated, unit)
    if ratio is None:
        raise UsageError(
            f"{option} {name}: {stated!r} is no unit of {name}, which the model has in {unit or 'no unit'}"
        )
    return value * ratio


def read_range(name: str, given: str | Sequence[float], unit: str) -> tuple[float, float]:
    """Return LOW and HIGH of a text "LOW..HIGH UNIT" or of two numbers; raises UsageError."""
    if isinstance(given, str):
        low, dots, high = given.partition("..")
        end = _AMOUNT.fullmatch(high)
        if not dots or end is None:
            raise UsageError(f"--demand {name}: {given!r} is not LOW..HIGH, such as 0..90deg")
        pair = (low if re.search(r"[^\d.eE+\-\s]", low) else f"{low} {end[2]}", high)
    else:
        pair = tuple(given)  # type: ignore[assignment]
        if len(pair) != 2:
            raise UsageError(f"--demand {name}: two numbers are needed, the least and the most")
    found = read_amount("--demand", name, pair[0], unit), read_amount("--demand", name, pair[1], unit)
    if not found[0] < found[1]:
        raise UsageError(f"--demand {name}: {found[0]:g} is not below {found[1]:g}")
    return found


def _read_rate(name: str, given: float | str, unit: str) -> float:
    """Return a rate in the channel's unit a second: deg/s for deg, rad/s^2 for rad/s."""
    value, stated = _split("--rate", name, given)
    stated = rightly(stated) or stated
    if not stated:
        return value
    of_unit = factor(stated.removesuffix("/s"), unit) if stated.endswith("/s") else None
    ratio = of_unit if of_unit is not None else factor(stated, f"{unit}^2") if unit.endswith("/s") else None
    if ratio is None:
        raise UsageError(f"--rate {name}: {stated!r} is no rate of {name}; {unit or '1'}/s is one")
    return value * ratio


def _split(option: str, name: str, given: float | str) -> tuple[float, str]:
    if isinstance(given, bool) or not isinstance(given, int | float | str):
        raise UsageError(f"{option} {name}: a number or a text such as 2deg is needed")
    if not isinstance(given, str):
        value, unit = float(given), ""
    else:
        found = _AMOUNT.fullmatch(given)
        if found is None:
            raise UsageError(f"{option} {name}: {given!r} does not begin with a number, as 2deg does")
        value, unit = float(found[1]), " ".join(found[2].split())
    if not abs(value) <= LARGEST:
        raise UsageError(f"{option} {name}: {given} is beyond {LARGEST:g}")
    return value, unit


def _positive(option: str, name: str, value: float) -> float:
    if not 1e-12 <= value <= LARGEST:
        raise UsageError(f"{option} {name}: {value:g} is not an amount above 0")
    return value


def _require_known(option: str, given: Mapping[str, object], known: Mapping[str, object], what: str) -> None:
    if wrong := [n for n in given if n not in known]:
        raise UsageError(f"{option} {wrong[0]}: the model has no such channel; its {what} are {', '.join(known)}")
