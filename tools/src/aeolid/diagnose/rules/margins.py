"""Note, while a diagnosis is made, how far each decision rule could have stood elsewhere with the same answer.

A rule that is only compared is free between the nearest numbers that it was compared with on either side: while it
stays between them every comparison ends as before, and with it every step and the answer. One whose value enters a
calculation is pinned: another value may change anything behind it. So a stored answer can be decided again under other
rules without a fit: inside its margins it is the same by construction, outside them the case has to be diagnosed.

Where several rules meet in one comparison each gets an equal part of the distance, so margins hold together as a box.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from typing import Any, NoReturn

import numpy as np

from aeolid.diagnose.rules import DecisionRules, with_rules

_INWARD = 1.0 - 1e-9  # of a distance: what rounding could do at its end
_COMPARING: dict[Any, Callable[[Any, Any], Any]] = {
    np.greater: operator.gt, np.greater_equal: operator.ge, np.less: operator.lt, np.less_equal: operator.le,
    np.equal: operator.eq, np.not_equal: operator.ne,
}  # fmt: skip
_LINEAR: dict[Any, Callable[[Any, Any], Any]] = {
    np.add: operator.add,
    np.subtract: operator.sub,
    np.multiply: operator.mul,
    np.true_divide: operator.truediv,
}


@dataclass
class Margins:
    """Hold, by section and name of a rule that was read, the interval (low, high) in which the answer stays.

    values: of the rules read; low and high are ±inf where no comparison bounds them.
    """

    values: dict[str, float] = field(default_factory=dict)
    low: dict[str, float] = field(default_factory=dict)
    high: dict[str, float] = field(default_factory=dict)

    def read(self, name: str, value: float) -> None:
        """Note that a rule was asked for."""
        self.values.setdefault(name, float(value))
        self.low.setdefault(name, -math.inf)
        self.high.setdefault(name, math.inf)

    def pin(self, name: str) -> None:
        """Note that a rule's value entered a calculation."""
        self.low[name] = self.high[name] = self.values[name]

    def bound(self, terms: Mapping[str, float], distance: Any) -> None:
        """Note comparisons: `distance` (any shape) is the compared sum of `terms` less what it was compared with."""
        down, up = _nearest(distance)
        if down == 0.0:
            for name in terms:
                self.pin(name)
            return
        for name, factor in terms.items():
            if factor == 0.0:
                continue
            part = _INWARD / (len(terms) * abs(factor))
            lower, upper = (down, up) if factor > 0 else (up, down)
            self.low[name] = max(self.low[name], self.values[name] - lower * part)
            self.high[name] = min(self.high[name], self.values[name] + upper * part)

    def to_json(self) -> dict[str, list[float | None]]:
        """Return the interval of every rule read, ends that nothing bounds as None; sorted by name."""
        return {n: [_finite(self.low[n]), _finite(self.high[n])] for n in sorted(self.values)}


def _nearest(distance: Any) -> tuple[float, float]:
    """Return the smallest of the positive numbers and of the negative ones' sizes, inf for none; (0, 0) with a zero.

    NaN is neither: it compares as false with anything.
    """
    if isinstance(distance, float):
        return (
            (distance, math.inf)
            if distance > 0
            else (math.inf, -distance)
            if distance < 0
            else ((0.0, 0.0) if distance == 0 else (math.inf, math.inf))
        )
    found = np.asarray(distance, dtype=float).ravel()
    if np.any(found == 0.0):
        return 0.0, 0.0
    above, below = found[found > 0], -found[found < 0]
    return float(above.min(initial=math.inf)), float(below.min(initial=math.inf))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


@contextmanager
def noting_margins(rules: DecisionRules) -> Iterator[Margins]:
    """Let rules hold while the block runs, as with_rules does, and note the margins of what is decided by them."""
    margins = Margins()
    with with_rules(_FollowedRules(rules, margins)):
        yield margins


class _FollowedRules(DecisionRules):
    """Hold rules whose sections say what is read of them; `plain`: the rules themselves, for who lists them."""

    def __init__(self, rules: DecisionRules, margins: Margins) -> None:
        object.__setattr__(self, "plain", rules)
        for f in fields(rules):
            object.__setattr__(self, f.name, _Section(getattr(rules, f.name), f.name, margins))


class _Section:
    """Hand out the rules of a section as followed numbers."""

    def __init__(self, rules: Any, name: str, margins: Margins) -> None:
        self._rules, self._name, self._margins = rules, name, margins

    def __getattr__(self, name: str) -> Any:
        kind = type(self._rules)
        if name not in kind.__dataclass_fields__:  # a property, made of rules
            return getattr(kind, name).fget(self)
        value, full = getattr(self._rules, name), f"{self._name}.{name}"
        self._margins.read(full, value)
        return Followed(value, {full: 1.0}, self._margins)


class Followed:
    """Stand for a linear expression of rules; what is compared with it bounds them, any other use pins them.

    It is no float, so that whatever takes it for a plain number has to ask for its value.
    """

    __slots__ = ("_margins", "_terms", "_value")

    def __init__(self, value: float, terms: Mapping[str, float], margins: Margins) -> None:
        self._value, self._terms, self._margins = value, terms, margins

    @property
    def quoted(self) -> float:
        """Return the value where it decides nothing."""
        return self._value

    def _plain(self) -> float:
        for name in self._terms:
            self._margins.pin(name)
        return self._value

    def _compared(self, other: Any, holds: Callable[[Any, Any], Any]) -> Any:
        terms = self._terms
        if isinstance(other, Followed):
            terms = _sum(terms, other._terms, -1.0)
            other = other._value
        elif not (_is_number(other) or isinstance(other, np.ndarray)):
            return NotImplemented
        self._margins.bound(terms, _less(self._value, other))
        return holds(self._value, other)

    def __lt__(self, other: Any) -> Any:
        return self._compared(other, operator.lt)

    def __le__(self, other: Any) -> Any:
        return self._compared(other, operator.le)

    def __gt__(self, other: Any) -> Any:
        return self._compared(other, operator.gt)

    def __ge__(self, other: Any) -> Any:
        return self._compared(other, operator.ge)

    def __eq__(self, other: object) -> Any:
        return self._compared(other, operator.eq)

    def __ne__(self, other: object) -> Any:
        return self._compared(other, operator.ne)

    def _added(self, other: Any, sign: float, holds: Callable[[Any, Any], Any]) -> Any:
        if isinstance(other, Followed):
            return self._made(holds(self._value, other._value), _sum(self._terms, other._terms, sign))
        if _is_number(other):
            return self._made(holds(self._value, other), self._terms)
        return NotImplemented

    def _scaled(self, other: Any, factor: Callable[[float], float], holds: Callable[[Any, Any], Any]) -> Any:
        if isinstance(other, Followed):
            other = other._plain()
        if not _is_number(other):
            return NotImplemented
        by = factor(float(other))
        if not math.isfinite(by):
            return holds(self._plain(), other)
        return self._made(holds(self._value, other), {n: c * by for n, c in self._terms.items()})

    def _made(self, value: Any, terms: Mapping[str, float]) -> Followed:
        return Followed(value, terms, self._margins)

    def __add__(self, other: Any) -> Any:
        return self._added(other, 1.0, operator.add)

    def __radd__(self, other: Any) -> Any:
        return self._added(other, 1.0, lambda a, b: b + a)

    def __sub__(self, other: Any) -> Any:
        return self._added(other, -1.0, operator.sub)

    def __rsub__(self, other: Any) -> Any:
        found = self._added(other, 1.0, lambda a, b: b - a)
        return found if found is NotImplemented else self._made(found._value, _sum({}, self._terms, -1.0))

    def __mul__(self, other: Any) -> Any:
        return self._scaled(other, lambda x: x, operator.mul)

    def __rmul__(self, other: Any) -> Any:
        return self._scaled(other, lambda x: x, lambda a, b: b * a)

    def __truediv__(self, other: Any) -> Any:
        return self._scaled(other, lambda x: 1.0 / x if x else math.inf, operator.truediv)

    def __neg__(self) -> Followed:
        return self._made(-self._value, _sum({}, self._terms, -1.0))

    def __abs__(self) -> Followed:
        return -self if self < 0 else self

    def __rtruediv__(self, other: Any) -> Any:
        return other / self._plain()

    def __pow__(self, other: Any) -> Any:
        return self._plain() ** other

    def __rpow__(self, other: Any) -> Any:
        return other ** self._plain()

    def __mod__(self, other: Any) -> Any:
        return self._plain() % other

    def __rmod__(self, other: Any) -> Any:
        return other % self._plain()

    def __floordiv__(self, other: Any) -> Any:
        return self._plain() // other

    def __rfloordiv__(self, other: Any) -> Any:
        return other // self._plain()

    def __hash__(self) -> int:
        return hash(self._plain())

    def __float__(self) -> float:
        return float(self._plain())

    def __index__(self) -> int:
        whole: Any = self._plain()
        return operator.index(whole)

    def __int__(self) -> int:
        return int(self._plain())

    def __bool__(self) -> bool:
        return bool(self._plain())

    def __round__(self, digits: int | None = None) -> Any:
        return round(self._plain(), digits)

    def __ceil__(self) -> int:
        return math.ceil(self._plain())

    def __floor__(self) -> int:
        return math.floor(self._plain())

    def __format__(self, spec: str) -> str:
        return format(self._plain(), spec)

    def __str__(self) -> str:
        return str(self._plain())

    def __repr__(self) -> str:
        return repr(self._plain())

    def __reduce__(self) -> NoReturn:
        raise TypeError("a followed rule belongs to the diagnosis that reads it and cannot be taken elsewhere")

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self._plain(), dtype=dtype or float)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method == "__call__" and len(inputs) == 2 and not kwargs:
            if ufunc in _COMPARING:
                return self._compared_by(_COMPARING[ufunc], *inputs)
            if ufunc in _LINEAR and all(isinstance(i, Followed) or _is_number(i) for i in inputs):
                return _LINEAR[ufunc](*(i.item() if isinstance(i, np.generic | np.ndarray) else i for i in inputs))
        return getattr(ufunc, method)(*(i._plain() if isinstance(i, Followed) else i for i in inputs), **kwargs)

    def _compared_by(self, holds: Callable[[Any, Any], Any], one: Any, other: Any) -> Any:
        if isinstance(one, Followed):
            return one._compared(other, holds)
        return self._compared(one, lambda own, x: holds(x, own))


def _less(value: float, other: Any) -> Any:
    """Return value − other; NaN where both are the same infinity."""
    if isinstance(other, float | int):
        return float(value) - float(other)
    with np.errstate(invalid="ignore"):
        return value - np.asarray(other, dtype=float)


def _is_number(value: Any) -> bool:
    """Tell whether something is one real number, of Python or numpy."""
    return isinstance(value, int | float | np.integer | np.floating) or (
        isinstance(value, np.ndarray) and value.ndim == 0
    )


def _sum(one: Mapping[str, float], other: Mapping[str, float], sign: float) -> dict[str, float]:
    """Return the terms of a sum of two linear expressions, the second times a sign."""
    found = dict(one)
    for name, factor in other.items():
        found[name] = found.get(name, 0.0) + sign * factor
    return found
