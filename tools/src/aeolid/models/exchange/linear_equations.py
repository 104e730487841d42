"""Write a linear model as equations, for what takes equations alone."""

from __future__ import annotations

import ast
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.equations import Equations, Output, State
from aeolid.models.state_space import StateSpace

_MOST = 120  # states: its square is the number of products in every step


def linear_equations(model: StateSpace, source: str) -> Equations:
    """Return x⁺ (or dx/dt) = A x + B (u − u₀), y = y₀ + C x + D (u − u₀) as equations; the Kalman gain has no part.

    Raises DataError on more than 120 states.
    """
    if model.order > _MOST:
        raise DataError(f"{source}: {model.order} states; a linear model of at most {_MOST} is written as equations")
    states, inputs = [f"x{i + 1}" for i in range(model.order)], [f"u{j + 1}" for j in range(len(model.inputs))]
    names: list[ast.expr] = [ast.Name(id=n, ctx=ast.Load()) for n in states]
    for symbol, signal in zip(inputs, model.inputs, strict=True):
        own: ast.expr = ast.Name(id=symbol, ctx=ast.Load())
        names.append(own if not signal.offset else _joined(own, ast.Sub(), _constant(signal.offset)))
    flow, read = np.hstack([model.A, model.B]), np.hstack([model.C, model.D])
    return Equations(
        "linear model", model.sample_time_s, (),
        tuple(State(n, "", _sum(row, names, 0.0), float(x)) for n, row, x in zip(states, flow, model.x0, strict=True)),
        tuple(Output(s.name, s.unit, _sum(row, names, s.offset)) for s, row in zip(model.outputs, read, strict=True)),
        tuple(model.inputs), tuple(inputs),
    )  # fmt: skip


def _sum(row: NDArray[np.float64], names: Sequence[ast.expr], offset: float) -> ast.expr:
    """Return the offset plus the products of coefficients and names, coefficients of zero left out."""
    products = [_joined(_constant(c), ast.Mult(), n) for c, n in zip(row, names, strict=True) if c]
    return _halved([_constant(offset), *products] if offset or not products else products)


def _halved(terms: Sequence[ast.expr]) -> ast.expr:
    """Return a sum as a tree that is no deeper than it must be."""
    if len(terms) == 1:
        return terms[0]
    middle = (len(terms) + 1) // 2
    return _joined(_halved(terms[:middle]), ast.Add(), _halved(terms[middle:]))


def _constant(value: float) -> ast.expr:
    number = ast.Constant(value=abs(float(value)))
    return ast.UnaryOp(op=ast.USub(), operand=number) if value < 0 else number


def _joined(left: ast.expr, operator: ast.operator, right: ast.expr) -> ast.expr:
    return ast.BinOp(left=left, op=operator, right=right)
