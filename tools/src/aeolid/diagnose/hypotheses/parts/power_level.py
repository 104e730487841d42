"""Find the aerodynamic terms in a turbine's equations and let them act with a changed level."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.baseline import FELT, mass_of
from aeolid.diagnose.structure.forces import FORCE
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter

_WIND = re.compile(r"wind|(^|_)v_?(hub|inf|wind|rel)")


def scaled(
    site: Site, entry: str, label: str, kinds: tuple[str, ...], most: float, equation: str, says: Callable[[float], str]
) -> list[Attachment]:
    """Offer one relative change of the aerodynamic terms on all motions of these kinds; none where one is missing.

    most: the largest that is believed, up or down.
    """
    if not is_turbine(site.context) or site.linear is not None:
        return []
    found = [(m, aerodynamic(site, m, kind)) for kind in kinds for m in [_motion(site, kind)] if m is not None]
    forces = [(m, tree) for m, tree in found if tree is not None]
    if len(forces) < len(kinds):
        return []
    loads = _loads(site, [m for m, _ in forces]) if "fore_aft" in kinds else {}
    slot = Slot(entry, label, "1", 0.0, -most, most, 1e-3)

    def edit(model: Equations) -> Equations:
        extra = Parameter(entry, 0.0, "1", slot.low, slot.high)
        model = replace(model, parameters=(*model.parameters, extra))
        for k, (motion, tree) in enumerate(forces):
            force = ex.combine("*", ast.Name(id=entry), _copy(tree))
            model = rotor.push(model, motion.inject, force, f"{entry}_force{k + 1}")
        for name, tree in loads.items():
            model = rotor.on_output(model, name, ex.combine("*", ast.Name(id=entry), _copy(tree)))
        return model

    shown = (*(site.output_names[rotor.outputs_like(site, kind)[0]] for kind in kinds), *loads)
    return [
        Attachment(
            entry, f"{entry} rotor", location("rotor", outputs=shown), edit, (slot,), equation=equation,
            statement=lambda v: says(v[label]),
        )
    ]  # fmt: skip


def _copy(tree: ast.expr) -> ast.expr:
    return ex.parse(ex.to_text(tree), "aerodynamic terms")


def _motion(site: Site, kind: str) -> Motion | None:
    outputs = rotor.outputs_like(site, kind)
    return rotor.motion_of(site, site.output_names[outputs[0]]) if outputs else None


def aerodynamic(site: Site, motion: Motion, kind: str) -> ast.expr | None:
    """Return the sum of the aerodynamic terms of an equation of motion; None where no term holds pitch or wind.

    On the rotor that is all but the terms with another input (the generator's torque); on the tower all but those
    that hold nothing except the tower's own motion (its stiffness and damping).
    """
    own = {n.id for n in (motion.velocity, motion.position) if isinstance(n, ast.Name)}
    derivative = next(s.derivative for s in site.model.states if s.name in own and s.name == _id(motion.velocity))
    forces = derivative.left if mass_of(derivative, site.model) and isinstance(derivative, ast.BinOp) else derivative
    variables = {*site.symbols, *(s.name for s in site.model.states)}
    air = _air(site)
    terms = []
    for sign, term in _forces(forces, 1):
        names = _reach(site.model, term) & variables
        if any(n.startswith(FORCE) for n in names):
            continue
        others = {n for n in names & set(site.symbols) if n not in air}
        structural = names <= own and bool(names)
        if others or (kind != "speed" and structural):
            continue
        terms.append((sign, term, bool(names & air)))
    if not any(holds for _, _, holds in terms):
        return None
    return _total([(sign, term) for sign, term, _ in terms])


def _loads(site: Site, motions: list[Motion]) -> dict[str, ast.expr]:
    """Return what of each output is aerodynamic load (a blade's moment), accelerations aside: these feel the forces."""
    own = {_id(e) for m in motions for e in (m.velocity, m.position) if e is not None}
    rates = {ex.to_text(s.derivative) for s in site.model.states if not isinstance(s.derivative, ast.Name)}
    states = {s.name for s in site.model.states}
    found: dict[str, ast.expr] = {}
    for output in site.model.outputs:
        text, names = ex.to_text(output.equation), ex.names_in(output.equation)
        if any(n.startswith(FELT) for n in names) or any(rate in text for rate in rates):
            continue
        parts = [(sign, term, _reach(site.model, term)) for sign, term in _terms(output.equation, 1)]
        loads = [(sign, term) for sign, term, seen in parts if not (seen & states and seen & states <= own)]
        if any(seen & _air(site) for _, _, seen in parts):
            found[output.name] = _total(loads)
    return found


def _total(terms: list[tuple[int, ast.expr]]) -> ast.expr:
    total: ast.expr = ast.Constant(0.0)
    for sign, term in terms:
        total = ex.combine("+" if sign > 0 else "-", total, term)
    return total


def _id(tree: ast.expr) -> str:
    return tree.id if isinstance(tree, ast.Name) else ""


def _air(site: Site) -> set[str]:
    """List the inputs and states that are pitch or wind by name."""
    inputs = {
        symbol
        for symbol, name in zip(site.symbols, site.input_names, strict=True)
        if rotor.looks_like("pitch", name) or _WIND.search(name.lower())
    }
    return inputs | {s.name for s in site.model.states if _WIND.search(s.name.lower())}


def _terms(tree: ast.expr, sign: int) -> list[tuple[int, ast.expr]]:
    """Split a sum into its signed terms."""
    if isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Add | ast.Sub):
        right = sign if isinstance(tree.op, ast.Add) else -sign
        return _terms(tree.left, sign) + _terms(tree.right, right)
    if isinstance(tree, ast.UnaryOp):
        return _terms(tree.operand, -sign if isinstance(tree.op, ast.USub) else sign)
    return [(sign, tree)]


def _forces(tree: ast.expr, sign: int) -> list[tuple[int, ast.expr]]:
    """Split an equation of motion into its signed terms, also behind a divisor and factors of numbers.

    An inertia in other units, (torques)/(1000*J), or a force that nobody measured beside the quotient, hid them all.
    """
    found = []
    for own, term in _terms(tree, sign):
        if isinstance(term, ast.BinOp) and isinstance(term.op, ast.Div):
            found += [(s, ex.combine("/", part, term.right)) for s, part in _forces(term.left, own)]
        elif isinstance(term, ast.BinOp) and isinstance(term.op, ast.Mult) and not ex.names_in(term.left):
            found += [(s, ex.combine("*", term.left, part)) for s, part in _forces(term.right, own)]
        else:
            found.append((own, term))
    return found


def _reach(model: Equations, tree: ast.expr) -> set[str]:
    """List every name an expression depends on, through intermediates too."""
    names = ex.names_in(tree)
    for a in reversed(model.auxiliaries):
        if a.name in names:
            names |= ex.names_in(a.equation)
    return names
