"""Find outputs that feel what accelerates a state: those that repeat its equation, but for what does not move."""

from __future__ import annotations

import ast
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.structure.sums import written_out
from aeolid.errors import AeolidError
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, State

Array = NDArray[np.float64]
_SETTINGS, _STATES = 5, 7  # inputs and parameters drawn, and states drawn for each
_ROUNDING = 1e-9  # of the largest difference


def felt_in(output: Output, state: State, model: Equations) -> tuple[float, ast.expr] | None:
    """Return the factor of a state's derivative in an output, and the rest, on which no state has a say; or None.

    An accelerometer on an isolated mass reads what its springs do, and its equation of motion holds the motion of the
    base besides: a stop that was added to the latter alone contradicted the former, and had no name. Told by numbers,
    at states, inputs and parameters drawn at random: the factor is one constant for all of them. A state that decays by
    a number of its own alone feels nothing, though it is proportional to its derivative.
    """
    names = [s.name for s in model.states]
    d, o = written_out(state.derivative, model), written_out(output.equation, model)
    moving = ex.names_in(d) & set(names)
    if not moving or not ex.names_in(o) & set(names):
        return None
    known = {*names, *model.symbols, *(p.name for p in model.parameters)}
    if ex.unknown_names(d, known) or ex.unknown_names(o, known):
        return None
    with np.errstate(all="ignore"):
        factor = _factor(d, o, model, next(iter(moving)) if len(moving) == 1 else "")
    if factor is None:
        return None
    return factor, _rest(output.equation, state.derivative, factor)


def _factor(d: ast.expr, o: ast.expr, model: Equations, alone: str) -> float | None:
    """Return by how much `o` moves for what `d` moves when states alone change; None where that is not one number.

    alone: the only state in `d`, whose own differences must not do as well.
    """
    moves = []
    for known in _drawn(model):
        try:
            values = [np.broadcast_to(ex.values_of(t, known), _STATES) for t in (d, o)]
        except AeolidError:
            return None
        own = known[alone] if alone else np.zeros(_STATES)
        moves.append([v[1:] - v[0] for v in (*values, own)])
    of_d, of_o, of_own = (np.concatenate(part) for part in zip(*moves, strict=True))
    if not np.all(np.isfinite([of_d, of_o])) or not np.any(of_d) or not np.any(of_o):
        return None
    factor = _proportional(of_o, of_d)
    if factor is None or (alone and _proportional(of_d, of_own) is not None):
        return None
    nearest = float(np.round(factor))
    return nearest if nearest and abs(factor - nearest) < _ROUNDING else factor


def _proportional(y: Array, x: Array) -> float | None:
    factor = float(y @ x / (x @ x))
    return factor if factor and np.max(np.abs(y - factor * x)) < _ROUNDING * np.max(np.abs(y)) else None


def _drawn(model: Equations) -> list[Mapping[str, Array]]:
    """Return values of all names (1,) and of the states (_STATES,), near the declared ones."""
    rng = np.random.default_rng(0)
    found: list[Mapping[str, Array]] = []
    for _ in range(_SETTINGS):
        known = {name: rng.standard_normal(1) for name in model.symbols}
        known |= {p.name: (p.value or 1.0) * (1 + 0.2 * rng.uniform(-1, 1, 1)) for p in model.parameters}
        known |= {s.name: s.initial + (abs(s.initial) or 1.0) * rng.standard_normal(_STATES) for s in model.states}
        found.append(known)
    return found


def _rest(output: ast.expr, derivative: ast.expr, factor: float) -> ast.expr:
    """Return output − factor · derivative; terms that both have are left out where the factor is 1 or −1."""
    if abs(factor) == 1.0:
        own, other = _terms(output, 1), _terms(derivative, 1 if factor < 0 else -1)
        for term in list(own):
            if (against := (-term[0], term[1])) in other:
                own.remove(term)
                other.remove(against)
        signed = " ".join(f"{'-' if sign < 0 else '+'} {text}" for sign, text in (*own, *other))
        return ex.parse(signed.removeprefix("+ "), "output") if signed else ast.Constant(0.0)
    return ex.combine("-", output, ex.combine("*", ast.Constant(factor), derivative))


def _terms(tree: ast.expr, sign: int) -> list[tuple[int, str]]:
    """Return the terms of a sum with their signs."""
    if isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Add | ast.Sub):
        second = sign if isinstance(tree.op, ast.Add) else -sign
        return _terms(tree.left, sign) + _terms(tree.right, second)
    if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.USub | ast.UAdd):
        return _terms(tree.operand, -sign if isinstance(tree.op, ast.USub) else sign)
    if isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Mult | ast.Div):
        first = _terms(tree.left, sign)
        if len(first) == 1:
            operator = "*" if isinstance(tree.op, ast.Mult) else "/"
            return [(first[0][0], f"{first[0][1]}{operator}{_inner(tree.right)}")]
    return [(sign, _inner(tree))]


def _inner(tree: ast.expr) -> str:
    text = ex.to_text(tree)
    return f"({text})" if isinstance(tree, ast.BinOp) else text
