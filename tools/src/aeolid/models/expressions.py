"""Check and rewrite the arithmetic of a model file."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterable, Mapping
from functools import reduce
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.text_files import shown
from aeolid.wording import counted, did_you_mean

Array = NDArray[np.float64]
# Functions of the model file, with the fewest and the most arguments each takes.
FUNCTIONS = {
    "sqrt": (1, 1), "exp": (1, 1), "log": (1, 1), "sin": (1, 1), "cos": (1, 1), "tan": (1, 1), "tanh": (1, 1),
    "abs": (1, 1), "sign": (1, 1), "min": (2, 9), "max": (2, 9),
}  # fmt: skip
CONSTANTS = {"pi": "3.141592653589793"}
_BINARY: tuple[type, ...] = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
_UNARY: tuple[type, ...] = (ast.UAdd, ast.USub)
_ON_ARRAYS: dict[type, Any] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_MAX_LENGTH = 20_000  # characters: a longer line is not a model equation
_MAX_DEPTH = 120


def parse(text: str, where: str) -> ast.expr:
    """Parse one expression; raises DataError that names `where` for anything but the arithmetic allowed.

    Allowed: numbers, names, + - * / **, parentheses and FUNCTIONS; ^ is refused with a hint.
    """
    if not isinstance(text, str):
        raise DataError(f"{where}: an expression in quotes is needed, found {shown(text)}")
    if len(text) > _MAX_LENGTH:
        raise DataError(f"{where}: the expression is longer than {_MAX_LENGTH} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DataError(f"{where}: {shown(text)} is not an arithmetic expression") from None
    _check(tree, text, where, 0)
    return tree


def names_in(tree: ast.expr) -> set[str]:
    """List the variables of an expression: every name that is neither a function nor a constant."""
    found: set[str] = set()
    left: list[ast.expr] = [tree]
    while left:
        node = left.pop()
        if isinstance(node, ast.Name):
            found.add(node.id)
        else:
            left += parts_of(node)
    return found - CONSTANTS.keys()


def parts_of(tree: ast.expr) -> list[ast.expr]:
    """Return the expressions that one is made of: operands, or the arguments of a function."""
    if isinstance(tree, ast.BinOp):
        return [tree.left, tree.right]
    if isinstance(tree, ast.UnaryOp):
        return [tree.operand]
    return tree.args if isinstance(tree, ast.Call) else []


def substitute(tree: ast.expr, replacements: Mapping[str, ast.expr]) -> ast.expr:
    """Return the expression with variables replaced by others; itself where none is, as nobody changes one in place."""
    if isinstance(tree, ast.Name):
        return replacements.get(tree.id, tree)
    if isinstance(tree, ast.BinOp):
        left, right = substitute(tree.left, replacements), substitute(tree.right, replacements)
        return tree if left is tree.left and right is tree.right else ast.BinOp(left=left, op=tree.op, right=right)
    if isinstance(tree, ast.UnaryOp):
        inner = substitute(tree.operand, replacements)
        return tree if inner is tree.operand else ast.UnaryOp(op=tree.op, operand=inner)
    if isinstance(tree, ast.Call):
        given = [substitute(a, replacements) for a in tree.args]
        same = all(a is b for a, b in zip(given, tree.args, strict=True))
        return tree if same else ast.Call(func=tree.func, args=given, keywords=[])
    return tree


def swap(tree: ast.expr, before: ast.expr, after: ast.expr) -> ast.expr:
    """Return the expression with every part that reads like `before` replaced by `after`."""

    class Swapper(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> Any:
            return after if _alike(node, before) else super().visit(node)

    result: ast.expr = Swapper().visit(_copy(tree))
    return result


def _alike(a: ast.AST, b: ast.AST) -> bool:
    if type(a) is not type(b):
        return False
    if isinstance(a, ast.Constant):
        return bool(a.value == b.value)  # type: ignore[attr-defined]
    if isinstance(a, ast.Name):
        return bool(a.id == b.id)  # type: ignore[attr-defined]
    mine, other = ([n for n in ast.iter_child_nodes(x) if not isinstance(n, ast.expr_context)] for x in (a, b))
    return len(mine) == len(other) and all(_alike(x, y) for x, y in zip(mine, other, strict=True))


def values_of(tree: ast.expr, known: Mapping[str, Array]) -> Array:
    """Return what a parsed expression is where its variables have these values: arrays of one shape, or numbers.

    As in machine code: what is not defined is NaN or infinite. Raises KeyError for a variable without a value.
    """
    with np.errstate(all="ignore"):
        return np.asarray(_value(tree, known))


def _value(tree: ast.expr, known: Mapping[str, Array]) -> Any:
    if isinstance(tree, ast.Name):
        return np.float64(CONSTANTS[tree.id]) if tree.id in CONSTANTS else known[tree.id]
    if isinstance(tree, ast.Constant):
        return np.float64(cast("float", tree.value))
    if isinstance(tree, ast.UnaryOp):
        inner = _value(tree.operand, known)
        return -inner if isinstance(tree.op, ast.USub) else inner
    if isinstance(tree, ast.BinOp):
        return _ON_ARRAYS[type(tree.op)](_value(tree.left, known), _value(tree.right, known))
    call = cast("ast.Call", tree)
    name = cast("ast.Name", call.func).id
    given = [_value(a, known) for a in call.args]
    return reduce({"min": np.minimum, "max": np.maximum}[name], given) if len(given) > 1 else getattr(np, name)(*given)


def to_text(tree: ast.expr) -> str:
    """Return the expression as a user would write it."""
    return ast.unparse(tree)


def combine(operator: str, left: ast.expr, right: ast.expr) -> ast.expr:
    """Join two expressions by + - * or /."""
    op = {"+": ast.Add(), "-": ast.Sub(), "*": ast.Mult(), "/": ast.Div()}[operator]
    return ast.BinOp(left=left, op=op, right=right)


def unknown_names(tree: ast.expr, known: Iterable[str]) -> list[str]:
    """List variables that nobody defines, in alphabetical order."""
    return sorted(names_in(tree) - set(known))


def _copy(tree: ast.expr) -> ast.expr:
    return ast.parse(ast.unparse(tree), mode="eval").body


def _representable(value: int | float) -> bool:
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _check(node: ast.AST, text: str, where: str, depth: int) -> None:
    if depth > _MAX_DEPTH:
        raise DataError(f"{where}: {shown(text)} is nested too deeply")
    if isinstance(node, ast.Constant):
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise DataError(f"{where}: {shown(node.value)} in {shown(text)} is not a number")
        if not _representable(node.value):
            raise DataError(f"{where}: a number in {shown(text)} is too large for double precision")
        return
    if isinstance(node, ast.Name):
        if node.id in FUNCTIONS:
            raise DataError(f"{where}: function {node.id} in {shown(text)} needs its arguments in parentheses")
        return
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, _UNARY):
        return _check(node.operand, text, where, depth + 1)
    if isinstance(node, ast.BinOp) and isinstance(node.op, _BINARY):
        _check(node.left, text, where, depth + 1)
        return _check(node.right, text, where, depth + 1)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
        raise DataError(f"{where}: '^' in {shown(text)}; a power is written **")
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        _check_call(node, text, where)
        for argument in node.args:
            _check(argument, text, where, depth + 1)
        return None
    piece = ast.get_source_segment(text.strip(), node) or text
    raise DataError(f"{where}: {shown(piece)} is not allowed; use + - * / ** and {', '.join(FUNCTIONS)}, pi")


def _counted(fewest: int, most: int) -> str:
    return counted(fewest, "argument") if fewest == most else f"{fewest} to {most} arguments"


def _check_call(node: ast.Call, text: str, where: str) -> None:
    name = node.func.id  # type: ignore[attr-defined]
    if name not in FUNCTIONS:
        hint = did_you_mean(name, FUNCTIONS) or ";"
        raise DataError(f"{where}: function {shown(name)} is not known{hint} allowed are {', '.join(FUNCTIONS)}")
    fewest, most = FUNCTIONS[name]
    if not fewest <= len(node.args) <= most:
        raise DataError(f"{where}: {name} in {shown(text)} takes {_counted(fewest, most)}, found {len(node.args)}")
