"""The catalogue's equations, symbols, units and what its attachments report agree, by dimensional analysis.

Every equation is read as arithmetic. Its quantities have the units that the entry says, forces, positions and times
have theirs, every other name may have any: a system of linear equations in exponents, which has a solution or none.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import test_catalogue_mechanics
import test_catalogue_turbine

from aeolid.diagnose.hypotheses.catalogue import ENTRIES, entry, meaning_of, quantity_of
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot

Exponents = dict[str, float]
UNITS: dict[str, Exponents] = {
    "1": {}, "N": {"N": 1}, "m": {"m": 1}, "s": {"s": 1}, "K": {"K": 1}, "degC": {"K": 1}, "Hz": {"s": -1},
    "kg": {"N": 1, "s": 2, "m": -1}, "rad": {},
}  # fmt: skip
GIVEN: dict[str, Exponents] = {  # what symbols of mechanics and heat are, where an entry does not say otherwise
    "F": {"N": 1}, "F_side": {"N": 1}, "F_fore_aft": {"N": 1}, "Q_weight": {"N": 1, "m": 1}, "q": {"m": 1},
    "v": {"m": 1, "s": -1}, "t": {"s": 1}, "time": {"s": 1}, "step": {"s": 1}, "T": {"K": 1}, "Omega": {"s": -1},
    "azimuth": {}, "blades": {}, "pi": {},
}  # fmt: skip
OWN = {"air_density": {"T"}, "tower_shadow": {"q"}, "rotational_sampling": {"q"}, "wave_load": {"q"}}  # others there
SAME = {"abs", "min", "max", "round", "floor", "trunc"}
PLAIN = {"exp", "cos", "sin", "tanh"}


def plus(a: Exponents, b: Exponents, times: float = 1.0) -> Exponents:
    return {k: a.get(k, 0.0) + times * b.get(k, 0.0) for k in {*a, *b}}


class Dimensions:
    """Collect what the dimensions of an equation's names must fulfil: sums of exponents that vanish."""

    def __init__(self, known: dict[str, Exponents]) -> None:
        self.known, self.rows, self.fresh = known, [], 0

    def of(self, node: ast.expr) -> Exponents | None:
        """Return the exponents of an expression; None for zero, which has any."""
        if isinstance(node, ast.Constant):
            return None if node.value == 0 else {}
        if isinstance(node, ast.Name):
            return self.known.get(node.id, {f"?{node.id}": 1.0})
        if isinstance(node, ast.UnaryOp):
            return self.of(node.operand)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name), ast.unparse(node)
        return self._called(node.func.id, [self.of(a) for a in node.args])

    def same(self, *sides: Exponents | None) -> Exponents | None:
        known = [s for s in sides if s is not None]
        self.rows += [plus(known[0], other, -1.0) for other in known[1:]]
        return known[0] if known else None

    def _binary(self, node: ast.BinOp) -> Exponents | None:
        left, right = self.of(node.left), self.of(node.right)
        if isinstance(node.op, ast.Add | ast.Sub):
            return self.same(left, right)
        if left is None or right is None:
            return None
        if isinstance(node.op, ast.Pow):
            assert isinstance(node.right, ast.Constant)
            return {k: float(node.right.value) * v for k, v in left.items()}
        return plus(left, right, 1.0 if isinstance(node.op, ast.Mult) else -1.0)

    def _called(self, name: str, given: list[Exponents | None]) -> Exponents | None:
        if name in SAME:
            return self.same(*given)
        if name in PLAIN:
            self.same({}, *given)
            return {}
        if name == "sign":
            return {}
        if name == "rate":
            return plus(given[0] or {}, {"s": -1.0})
        if name == "lag":
            self.same({"s": 1.0}, given[1])
            return given[0]
        self.fresh += 1
        return {f"?{name}{self.fresh}": 1.0}  # a function of the model's

    def left_over(self) -> float:
        """Return the largest exponent that no choice of the free names takes away."""
        free = sorted({k for row in self.rows for k in row if k.startswith("?")})
        units = sorted({k for row in self.rows for k in row if not k.startswith("?")})
        if not self.rows or not units:
            return 0.0
        A = np.array([[row.get(k, 0.0) for k in free] for row in self.rows]).reshape(len(self.rows), len(free))
        b = np.array([[row.get(k, 0.0) for k in units] for row in self.rows])
        best = np.linalg.lstsq(A, b, rcond=None)[0] if free else np.zeros((0, len(units)))
        return float(np.abs(A @ best - b).max())


def split_unit(unit: str) -> list[str]:
    """Return a quantity's unit and those it has elsewhere: "N (m/s^2 without a mass)" are two."""
    found = re.fullmatch(r"(.*?)(?: \((.* (?:without|for) .*)\))?", unit)
    assert found is not None
    others = [re.split(r" (?:without|for) ", o)[0] for o in (found[2] or "").split(", ") if o]
    return [found[1], *others]


def exponents(unit: str) -> Exponents:
    """Return the exponents of a unit; what is no SI unit is a free name of its own."""
    text = re.sub(r"unit of the \w+|the \w+'s own", lambda m: "_".join(re.findall(r"\w+", m[0])), unit)
    text = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text.strip() or "1").replace("^", "**")
    reader = Dimensions({k: v for k, v in UNITS.items() if k != "1"})
    return reader.of(ast.parse(text, mode="eval").body) or {}


def parted(text: str) -> list[str]:
    """Return what stands between commas, semicolons and colons outside parentheses."""
    parts, depth = [""], 0
    for c in text:
        depth += (c == "(") - (c == ")")
        if c in ",;:" and not depth:
            parts.append("")
        else:
            parts[-1] += c
    return parts


def clauses(equation: str) -> Iterator[list[ast.expr]]:
    """Yield the sides of each equation that is arithmetic; words between equations are left out."""
    for clause in parted(equation.replace(" of the blade", "").replace("^", "**").replace("...", "0")):
        text = re.sub(r"d\((\w+)\)/dt", r"rate(\1)", clause.replace(" + noise", "").partition(" or ")[0])
        text = re.sub(r"\|([^|]*)\|", r"abs(\1)", re.sub(r"(\w+)''", r"rate(rate(\1))", text))
        text = re.sub(r"(\w+)'", r"rate(\1)", text)
        try:
            sides = [ast.parse(s.strip(), mode="eval").body for s in re.split(r" (?:=|<=|~) ", text)]
        except SyntaxError:
            continue
        if len(sides) == 2:
            yield sides


def check(e: Entry, quantities: dict[str, Exponents]) -> tuple[int, float]:
    """Return how many equations of an entry were read, and what is left over of their dimensions."""
    known = {k: v for k, v in GIVEN.items() if k not in OWN.get(e.id, ())} | quantities
    reader, read = Dimensions(known), 0
    for sides in clauses(e.equation):
        reader.same(*(reader.of(side) for side in sides))
        read += 1
    return read, reader.left_over()


@pytest.mark.parametrize("e", ENTRIES, ids=lambda e: e.id)
def test_an_equation_is_of_its_quantities_and_of_their_dimensions(e: Entry) -> None:
    names = set(re.findall(r"\w+", e.equation))
    assert {q.symbol for q in e.quantities} - {f"{s}_over_fit" for s in names} <= names, e.equation
    read, left = check(e, {q.symbol: exponents(split_unit(q.unit)[0]) for q in e.quantities})
    assert read and left < 1e-9, e.equation


def test_a_wrong_unit_is_told() -> None:
    for name, symbol, unit in (
        ("temperature_dependence", "stiffness_slope", "1/K"), ("quadratic_damping", "c2", "N/m^2"),
        ("sensor_lag", "tau_s", "1/s"), ("mass_imbalance", "static_moment_cos", "kg"),
    ):  # fmt: skip
        own = {q.symbol: exponents(split_unit(q.unit)[0]) for q in entry(name).quantities}
        assert check(entry(name), own | {symbol: exponents(unit)})[1] > 0.1, name


@cache
def sites(folder: Path) -> dict[str, Site]:
    found = dict(test_catalogue_mechanics.sites(folder))
    hub = {"outputs": tuple(o for o in test_catalogue_turbine.ALL if "flap" not in o)}
    for kind in ("equations", "state_space"):
        for name, changes in (("turbine", {}), ("hub", hub)):
            place = folder / f"{kind} {name}"
            place.mkdir()
            trial = test_catalogue_turbine.everything(kind, **changes)
            found[place.name] = test_catalogue_turbine.site_of(place, trial, 600)
    return found


def told_in(site: Site, a: Attachment, label: str, q: Quantity) -> list[Exponents]:
    """Return the dimensions that a quantity may have at this place of this model."""
    model, made = site.model, []
    units = {"input": {s.name: s.unit for s in model.inputs}, "output": {o.name: o.unit for o in model.outputs}}
    for unit in split_unit(q.unit):
        text = unit
        for kind, known in units.items():
            places = sorted(a.location[f"{kind}s"], key=lambda n: n not in label)  # amplitude_rotor_speed_cos
            own = next((known.get(n, "") for n in places), "")
            text = text.replace(f"unit of the {kind}", f"({own or '1'})")
        made.append(exponents(text))
    turning = {m.location for m in site.motions if "rad" in m.position_unit}
    if a.location["entry"] in turning or label.startswith("torque"):  # N m for N, rad for m
        made += [{**d, "m": d.get("N", 0.0)} for d in made]
    return made


def same(a: Exponents, b: Exponents) -> bool:
    return all(abs(v) < 1e-9 for v in plus(a, b, -1.0).values())


def reported(site: Site) -> Iterator[tuple[Attachment, Slot]]:
    for e in ENTRIES:
        for a in e.attach(site):
            yield from ((a, s) for s in a.slots if s.label is not None)


def test_what_an_attachment_reports_is_a_quantity_of_its_entry_in_its_unit(tmp_path: Path) -> None:
    checked = set()
    for site in sites(tmp_path).values():
        for a, slot in reported(site):
            q = quantity_of(a.entry, str(slot.label))
            assert q is not None and meaning_of(a.entry, str(slot.label)), (a.key, slot.label)
            if slot.show is float and "own" not in q.unit and "channel" not in q.unit:
                may = told_in(site, a, str(slot.label), q)
                assert any(same(exponents(slot.unit), unit) for unit in may), (a.key, slot.label, slot.unit, q.unit)
            checked.add(a.entry)
    assert len(checked) > 45


@pytest.mark.parametrize(
    ("name", "of_forces", "of_modes"),
    [
        ("damping_change", "F = -damping_change*v from", "F = -damping_change*2*w*v from"),
        ("stiffness_change", "F = -stiffness_change*q from", "F = -stiffness_change*w^2*q from"),
        (
            "temperature_dependence", "F = -stiffness_slope*(warmth - 21.43)*q at",
            "F = -stiffness_slope*(warmth - 21.43)*w^2*q at",
        ),
    ],
)  # fmt: skip
def test_a_coefficient_is_absolute_of_forces_and_relative_of_modes(
    name: str, of_forces: str, of_modes: str, tmp_path: Path
) -> None:
    made = test_catalogue_mechanics.sites(tmp_path)
    for place, text in (("spring", of_forces), ("bare", of_forces), ("linear", of_modes)):
        assert entry(name).attach(made[place])[0].equation.startswith(text), place
