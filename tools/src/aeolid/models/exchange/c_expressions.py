"""Write a model's equations as C99: the functions that carry its states on, read its outputs and renew its memories."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, Equations

_OPERATORS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_MOST_FACTORS = 4  # a whole power up to this is written as products, as the models' machine code has it
_OWN = ("sign", "min", "max")  # functions that the header brings along


def functions_of(model: Equations, prefix: str) -> str:
    """Return flow, read and renew of a model as static functions of arrays x, u, th (and dt), results last.

    x holds the states and behind them the memories; names of the model appear nowhere. All memories settle first, then
    each is renewed; later ones see its new value. A model without states has no flow.
    """
    flow = [_flow(model, prefix)] if model.states else []
    return "\n\n".join((*flow, _read(model, prefix), _renew(model, prefix)))


def _flow(model: Equations, prefix: str) -> str:
    lines, names = _visible(model, [s.derivative for s in model.states], prefix)
    lines += [f"    d[{i}] = {_value(s.derivative, names, prefix)};" for i, s in enumerate(model.states)]
    return _function(prefix, "flow", "const double *x, const double *u, const double *th, double *d", lines)


def _read(model: Equations, prefix: str) -> str:
    lines, names = _visible(model, [o.equation for o in model.outputs], prefix)
    lines += [f"    y[{j}] = {_value(o.equation, names, prefix)};" for j, o in enumerate(model.outputs)]
    return _function(prefix, "read", "const double *x, const double *u, const double *th, double *y", lines)


def _renew(model: Equations, prefix: str) -> str:
    trees = [tree for m in model.memories for tree in (m.next, m.settled)]
    following = model.intermediates_of_memories(trees)
    lines, names = _visible(model, trees, prefix, [a.name for a in following])
    names[STEP], first = "dt", len(model.states)
    for i, m in enumerate(model.memories):
        settled = _value(m.settled, names, prefix)
        lines.append(f"    double m{i} = {prefix}_is_nan(x[{first + i}]) ? {settled} : x[{first + i}];")
        names[m.name] = f"m{i}"
        lines += [f"    {names[a.name]} = {_value(a.equation, names, prefix)};" for a in following]
    for i, m in enumerate(model.memories):
        lines.append(f"    m{i} = {_value(m.next, names, prefix)};")
        lines += [f"    {names[a.name]} = {_value(a.equation, names, prefix)};" for a in following]
    lines += [f"    x[{first + i}] = m{i};" for i in range(len(model.memories))]
    return _function(prefix, "renew", "double *x, const double *u, const double *th, double dt", lines, ("dt",))


def _function(prefix: str, name: str, arguments: str, lines: Sequence[str], more: Sequence[str] = ()) -> str:
    unused = "".join(f"    (void)({a});\n" for a in ("x", "u", "th", *more))
    return f"static void {prefix}_{name}({arguments}) {{\n{unused}" + "\n".join([*lines, "}"])


def _visible(
    model: Equations, roots: Sequence[ast.expr], prefix: str, changing: Sequence[str] = ()
) -> tuple[list[str], dict[str, str]]:
    """Return the intermediates that these equations use, as lines, and how everything they name is called in C.

    changing: names of those that are computed again.
    """
    used = set().union(*(ex.names_in(r) for r in roots)) if roots else set()
    needed = []
    for a in reversed(model.auxiliaries):
        if a.name in used:
            used |= ex.names_in(a.equation)
            needed.append(a)
    states = [*(s.name for s in model.states), *(m.name for m in model.memories)]
    names = {n: f"x[{i}]" for i, n in enumerate(states)}
    names |= {n: f"u[{i}]" for i, n in enumerate(model.symbols)}
    names |= {p.name: f"th[{i}]" for i, p in enumerate(model.parameters)}
    lines = []
    for k, a in enumerate(reversed(needed)):
        kind = "double" if a.name in changing else "const double"
        lines.append(f"    {kind} a{k} = {_value(a.equation, names, prefix)};")
        names[a.name] = f"a{k}"
    return lines, names


def number(value: float) -> str:
    """Return a constant that reads back as the same bits."""
    text = repr(float(value))
    return text if any(c in text for c in ".en") else f"{text}.0"


def _value(tree: ast.expr, names: Mapping[str, str], prefix: str) -> str:
    if isinstance(tree, ast.Constant):
        return number(float(tree.value))  # type: ignore[arg-type]
    if isinstance(tree, ast.Name):
        return ex.CONSTANTS[tree.id] if tree.id in ex.CONSTANTS else names[tree.id]
    if isinstance(tree, ast.UnaryOp):
        inner = _value(tree.operand, names, prefix)
        return f"(-{inner})" if isinstance(tree.op, ast.USub) else inner
    if isinstance(tree, ast.BinOp):
        return _binary(tree, names, prefix)
    if isinstance(tree, ast.Call):
        name = tree.func.id  # type: ignore[attr-defined]
        values = [_value(a, names, prefix) for a in tree.args]
        if name in ("min", "max"):
            first = values[0]
            for other in values[1:]:
                first = f"{prefix}_{name}({first}, {other})"
            return first
        called = {"abs": "fabs"}.get(name, f"{prefix}_{name}" if name in _OWN else name)
        return f"{called}({values[0]})"
    raise AssertionError(f"unchecked node {type(tree).__name__}")


def _binary(tree: ast.BinOp, names: Mapping[str, str], prefix: str) -> str:
    left = _value(tree.left, names, prefix)
    if not isinstance(tree.op, ast.Pow):
        return f"({left} {_OPERATORS[type(tree.op)]} {_value(tree.right, names, prefix)})"
    power = tree.right.value if isinstance(tree.right, ast.Constant) else None
    if power in range(1, _MOST_FACTORS + 1) and len(left) < 40:
        return "(" + " * ".join([left] * int(power)) + ")"  # type: ignore[arg-type]
    return f"pow({left}, {_value(tree.right, names, prefix)})"
