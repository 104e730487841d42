"""Read an expression as a sum of named quantities with constant factors."""

from __future__ import annotations

import ast
import math
from collections.abc import Collection, Mapping

from aeolid.models import expressions as ex
from aeolid.models.equations import Equations


def factors_of(tree: ast.expr, model: Equations, names: Collection[str]) -> dict[str, float]:
    """Return the factor of each name in a sum of them, parameters at their declared values; empty where it is none."""
    constants = {"pi": math.pi, **{p.name: p.value for p in model.parameters}}
    parts = _sum(tree, constants, names)
    if parts is None or parts.pop("", 0.0) or not all(math.isfinite(f) and f for f in parts.values()):
        return {}
    return parts


def straight_in(tree: ast.expr, name: str, model: Equations) -> tuple[float, float] | None:
    """Return (a, b) where an expression is a·name + b at the declared parameters, a not none; None where it is not."""
    constants = {"pi": math.pi, **{p.name: p.value for p in model.parameters}}
    parts = _sum(written_out(tree, model), constants, {name})
    if parts is None or not math.isfinite(sum(parts.values())) or not parts.get(name):
        return None
    return parts[name], parts.get("", 0.0)


def _sum(tree: ast.expr, constants: Mapping[str, float], names: Collection[str]) -> dict[str, float] | None:
    """Return a sum's factors by name, "" for its constant; None where it is no such sum."""
    if isinstance(tree, ast.Constant):
        return {"": float(tree.value)}  # type: ignore[arg-type]
    if isinstance(tree, ast.Name):
        return {"": constants[tree.id]} if tree.id in constants else {tree.id: 1.0} if tree.id in names else None
    if isinstance(tree, ast.UnaryOp):
        inner = _sum(tree.operand, constants, names)
        return inner if inner is None or isinstance(tree.op, ast.UAdd) else {k: -v for k, v in inner.items()}
    if not isinstance(tree, ast.BinOp):
        return None
    left, right = _sum(tree.left, constants, names), _sum(tree.right, constants, names)
    if left is None or right is None:
        return None
    if isinstance(tree.op, ast.Add | ast.Sub):
        sign = 1.0 if isinstance(tree.op, ast.Add) else -1.0
        return {k: left.get(k, 0.0) + sign * right.get(k, 0.0) for k in {**left, **right}}
    if isinstance(tree.op, ast.Mult) and set(left) == {""}:
        return {k: left[""] * v for k, v in right.items()}
    if isinstance(tree.op, ast.Mult) and set(right) == {""}:
        return {k: right[""] * v for k, v in left.items()}
    if isinstance(tree.op, ast.Div) and set(right) == {""} and right[""]:
        return {k: v / right[""] for k, v in left.items()}
    return None


def written_out(tree: ast.expr, model: Equations) -> ast.expr:
    """Return an expression with the model's intermediates replaced by what they stand for."""
    names = ex.names_in(tree)
    for a in reversed(model.auxiliaries):
        if a.name in names:
            tree = ex.substitute(tree, {a.name: a.equation})
            names |= ex.names_in(a.equation)
    return tree
