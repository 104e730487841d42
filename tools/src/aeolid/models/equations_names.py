"""Say of a model's equations which name is none, and which parameter makes them divide by zero."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.wording import did_you_mean

if TYPE_CHECKING:
    from aeolid.record import Record

Array = NDArray[np.float64]


def own_names(model: Any) -> tuple[str, ...]:
    """List the names that equations define themselves: parameters, states, auxiliaries, memories; none of others."""
    if not isinstance(model, Equations):
        return ()
    return tuple(n.name for group in (model.parameters, model.states, model.auxiliaries, model.memories) for n in group)


def unmatched(model: Any, what: str, name: str, record: Record) -> str:
    """Say that an input or output (`what`) of a model is no channel of a recording, and which name was meant."""
    channels = [c.name for c in record.channels]
    hint = did_you_mean(name, [*own_names(model), *channels]) or ";"
    held = f"{hint} the recording has {', '.join(channels)}"
    if isinstance(model, Equations) and what == "input" and name in model.symbols:
        return f"{name!r} in the equations is neither defined there nor a channel of {record.source}{held}"
    return f"{what} {name!r} is no channel of {record.source}{held}"


def require_divisible(model: Equations, source: str) -> None:
    """Refuse equations that divide by what their parameters make zero; raises DataError with parameter and equation."""
    values = {p.name: np.asarray(p.value) for p in model.parameters}
    behind = {name: {name} for name in values}  # the parameters that each known quantity is made of
    for a in model.auxiliaries:
        _check(a.equation, f"[[auxiliary]] {a.name}", values, behind, source)
        names = ex.names_in(a.equation)
        if names <= values.keys():
            values[a.name] = ex.values_of(a.equation, values)
            behind[a.name] = set().union(*(behind[n] for n in names))
    places = [(f"[[state]] {s.name}", s.derivative) for s in model.states]
    places += [(f"[[output]] {o.name}", o.equation) for o in model.outputs]
    places += [(f"[[memory]] {m.name}", tree) for m in model.memories for tree in (m.next, m.settled)]
    for place, tree in places:
        _check(tree, place, values, behind, source)


def _check(
    tree: ast.expr, place: str, values: Mapping[str, Array], behind: Mapping[str, set[str]], source: str
) -> None:
    """Refuse an equation that divides by a quantity known to be zero."""
    for divisor in _divisors(tree):
        names = ex.names_in(divisor)
        if not names <= values.keys() or float(ex.values_of(divisor, values)) != 0:
            continue
        made_of = set().union(*(behind[n] for n in names))
        blamed = sorted(n for n in made_of if values[n] == 0) or sorted(made_of)
        where = f"[parameters] {', '.join(blamed)}" if blamed else place
        remedy = "give it a value other than 0, and a min above 0 where it is free"
        raise DataError(
            f"{source} {where}: the equation of {place} divides by {ex.to_text(divisor)}, which is 0;"
            f" {remedy if len(blamed) == 1 else 'change them so that it is not'}"
        )


def _divisors(tree: ast.expr) -> Iterator[ast.expr]:
    """Yield what an expression divides by, also within what it is made of."""
    left = [tree]
    while left:
        node = left.pop()
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            yield node.right
        left += ex.parts_of(node)
