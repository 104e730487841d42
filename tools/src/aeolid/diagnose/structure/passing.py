"""Find what two stores of a model give to each other: a flow between tanks, heat through a wall."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from aeolid.diagnose.structure.sums import written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations


@dataclass(frozen=True, eq=False)
class Passing:
    """Hold a flow that leaves one state and reaches another: coefficient times what drives it, `share` of it arrives.

    share is 1 between stores of one capacity, else the ratio of the two equations' coefficients, in parameters.
    """

    giver: str
    taker: str
    driver: ast.expr
    flow: ast.expr
    share: ast.expr


@dataclass(frozen=True, eq=False)
class _Term:
    positive: bool
    constant: ast.expr
    driver: ast.expr
    text: str


def passings(model: Equations, names: Sequence[str]) -> list[Passing]:
    """List the terms that stand in two of the named states' equations with opposite signs, one for each pair."""
    constants = {"pi", *(p.name for p in model.parameters)}
    known = {s.name: s.derivative for s in model.states}
    terms = {n: list(_terms(written_out(known[n], model), constants)) for n in names}
    found = []
    for a, b in itertools.combinations(names, 2):
        pair = next(((x, y) for x in terms[a] for y in terms[b] if x.text == y.text and x.positive != y.positive), None)
        if pair is None:
            continue
        (giver, out), (taker, into) = sorted(zip((a, b), pair, strict=True), key=lambda end: end[1].positive)
        same = ex.to_text(out.constant) == ex.to_text(into.constant)
        share = ast.Constant(1.0) if same else ex.combine("/", into.constant, out.constant)
        found.append(Passing(giver, taker, out.driver, ex.combine("*", out.constant, out.driver), share))
    return found


def _terms(tree: ast.expr, constants: Collection[str]) -> Iterator[_Term]:
    """Yield each term of a sum that something moves; a difference is written in the order of its texts."""
    for positive, part in _addends(tree, True):
        constant: ast.expr = ast.Constant(1.0)
        moving: list[tuple[str, ast.expr]] = []
        for over, factor in _factors(part, True):
            turned, ordered = _in_order(factor)
            positive ^= turned
            if ex.names_in(ordered) <= set(constants):
                constant = ex.combine("*" if over else "/", constant, ordered)
                continue
            moving.append(("*" if over else "/", ordered))
        if not moving:
            continue
        moving.sort(key=lambda f: (f[0], ex.to_text(f[1])))
        driver: ast.expr = moving[0][1] if moving[0][0] == "*" else ast.Constant(1.0)
        for operator, factor in moving[1 if moving[0][0] == "*" else 0 :]:
            driver = ex.combine(operator, driver, factor)
        yield _Term(positive, constant, driver, ex.to_text(driver))


def _addends(tree: ast.expr, positive: bool) -> Iterator[tuple[bool, ast.expr]]:
    if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.UAdd | ast.USub):
        yield from _addends(tree.operand, positive == isinstance(tree.op, ast.UAdd))
    elif isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Add | ast.Sub):
        yield from _addends(tree.left, positive)
        yield from _addends(tree.right, positive == isinstance(tree.op, ast.Add))
    elif isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Div):
        yield from ((sign, ex.combine("/", part, tree.right)) for sign, part in _addends(tree.left, positive))
    else:
        yield positive, tree


def _factors(tree: ast.expr, over: bool) -> Iterator[tuple[bool, ast.expr]]:
    if isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Mult | ast.Div):
        yield from _factors(tree.left, over)
        yield from _factors(tree.right, over == isinstance(tree.op, ast.Mult))
    else:
        yield over, tree


def _in_order(factor: ast.expr) -> tuple[bool, ast.expr]:
    """Return a factor without its sign, a difference in the order of its texts, and whether that changed the sign."""
    if isinstance(factor, ast.UnaryOp) and isinstance(factor.op, ast.UAdd | ast.USub):
        turned, inner = _in_order(factor.operand)
        return turned != isinstance(factor.op, ast.USub), inner
    if not (isinstance(factor, ast.BinOp) and isinstance(factor.op, ast.Sub)):
        return False, factor
    if ex.to_text(factor.left) > ex.to_text(factor.right):
        return True, ex.combine("-", factor.right, factor.left)
    return False, factor
