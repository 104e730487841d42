"""The numbers that decide in aeolid.diagnose: all in one place, each once, with unit, meaning and source."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path

import pytest

from aeolid.diagnose.data.forensics import ratio_text
from aeolid.diagnose.rules import DecisionRules, differing, every_rule, in_force, load_rules, rules_of, with_rules
from aeolid.errors import DataError

HERE = Path(__file__).resolve().parent
ROOM = HERE.parents[1] / "tools" / "src" / "aeolid" / "diagnose"
SETTINGS = HERE / "numerical_settings.txt"
PREFIX = "aeolid.diagnose."
# A number this small or large guards against rounding or overflow; no quantity of a recording is compared with it.
ROUNDING, OVERFLOW = 1e-6, 1e6
PLAIN = (0, 1, 2, 3, 0.5)  # counts and halves, with either sign; a whole number beyond has a meaning

Constants = Mapping[str, tuple[float, ...]]


def numbers_in(node: ast.AST) -> tuple[float, ...]:
    """Return the numbers that are written anywhere in an expression."""
    found = [n.value for n in ast.walk(node) if isinstance(n, ast.Constant)]
    return tuple(v for v in found if isinstance(v, int | float) and not isinstance(v, bool))


def decides(number: float) -> bool:
    """Tell whether a number may decide by its size: neither plain nor a guard."""
    return abs(number) not in PLAIN and ROUNDING < abs(number) < OVERFLOW


def constants_of(tree: ast.Module) -> dict[str, tuple[float, ...]]:
    """Return the numeric constants of a module by name; of a tuple that is unpacked each for itself."""
    found: dict[str, tuple[float, ...]] = {}
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            found[node.target.id] = numbers_in(node.value)
        for target in node.targets if isinstance(node, ast.Assign) else []:
            if isinstance(target, ast.Name):
                found[target.id] = numbers_in(node.value)
            elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = zip(target.elts, node.value.elts, strict=True)
                found |= {t.id: numbers_in(v) for t, v in pairs if isinstance(t, ast.Name)}
    return {name: values for name, values in found.items() if values}


def compared(node: ast.Compare) -> Iterator[ast.expr]:
    """Yield the parts of a comparison: within arithmetic and calls, not within what an index selects."""
    left: list[ast.AST] = [node.left, *node.comparators]
    while left:
        part = left.pop()
        if isinstance(part, ast.expr):
            yield part
        index = part.slice if isinstance(part, ast.Subscript) else None
        left += [child for child in ast.iter_child_nodes(part) if child is not index]


def found_in(tree: ast.Module, module: str, known: Mapping[str, Constants]) -> set[str]:
    """Return the numbers that a module compares with, as `module:name` of where they stand or `module:literal`."""
    names = {name: f"{module}:{name}" for name, values in known[module].items() if any(map(_is_large, values))}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").removeprefix(PREFIX) in known:
            home = (node.module or "").removeprefix(PREFIX)
            taken = {a.asname or a.name: a.name for a in node.names if any(map(_is_large, known[home].get(a.name, ())))}
            names |= {own: f"{home}:{name}" for own, name in taken.items()}
    found = set()
    for part in (p for n in ast.walk(tree) if isinstance(n, ast.Compare) for p in compared(n)):
        if isinstance(part, ast.Name) and part.id in names:
            found.add(names[part.id])
        if isinstance(part, ast.Constant) and any(map(decides, numbers_in(part))):
            found.add(f"{module}:{part.value}")
    return found


def _is_large(number: float) -> bool:
    return ROUNDING < abs(number) < OVERFLOW


@cache
def trees() -> dict[str, ast.Module]:
    """Return the modules of diagnose outside its rules, by dotted name."""
    paths = {".".join(p.relative_to(ROOM).with_suffix("").parts): p for p in sorted(ROOM.rglob("*.py"))}
    return {n: ast.parse(p.read_text(encoding="utf-8")) for n, p in paths.items() if not n.startswith("rules.")}


def settings() -> dict[str, str]:
    """Return the numerical settings that are compared with and decide nothing, each with its reason."""
    lines = [x for x in SETTINGS.read_text(encoding="utf-8").splitlines() if x and not x.startswith("#")]
    pairs = [[part.strip() for part in line.split("|")] for line in lines]
    assert all(len(pair) == 2 and all(pair) for pair in pairs), "module:NAME | reason"
    assert len({name for name, _ in pairs}) == len(pairs)
    return dict(pairs)


def test_no_number_decides_outside_the_rules() -> None:
    known = {name: constants_of(tree) for name, tree in trees().items()}
    found = {x for name, tree in trees().items() for x in found_in(tree, name, known)}
    assert sorted(found - set(settings())) == [], "declare it in diagnose/rules and read it by in_force()"
    assert sorted(set(settings()) - found) == [], "not compared with any more: take it off the list"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("_LEAST = 20.0\ndef f(x):\n    return x > _LEAST\n", "m:_LEAST"),
        ("_A, _LEAST = 1, 0.3\ndef f(x, y):\n    return x < max(2 * _LEAST * y, y)\n", "m:_LEAST"),
        ("_LEAST: float = 4.0\ndef f(x):\n    return [v for v in x if abs(v) >= -_LEAST]\n", "m:_LEAST"),
        ("from aeolid.diagnose.other import LEAST as SURE\ndef f(x):\n    return x > SURE\n", "other:LEAST"),
        ("def f(x, s):\n    return x > 1.64 * s\n", "m:1.64"),
        ("def f(x):\n    return len(x) < 20\n", "m:20"),
        ("_LEAST = 20.0\ndef f(x):\n    return x * _LEAST\n", None),  # no comparison
        ("_PLACE = 20\ndef f(x):\n    return x[_PLACE] > 0\n", None),
        ("def f(x):\n    return x > 1e-9 or x < -0.5 or len(x) == 2\n", None),
    ],
)
def test_the_gate_can_fail(text: str, fault: str | None) -> None:
    tree = ast.parse(text)
    found = found_in(tree, "m", {"m": constants_of(tree), "other": {"LEAST": (3.0,)}})
    assert found == ({fault} if fault else set())


def test_rules_are_read_when_they_decide() -> None:
    """Neither on import nor as the default of an argument, where they would be those of that moment."""
    wrong = []
    for name, tree in trees().items():
        within = {c for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.Lambda) for c in _body_of(n)}
        calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
        wrong += [f"{name}:{n.lineno}" for n in calls if n.func.id == "in_force" and n not in within]  # type: ignore[attr-defined]
    assert wrong == []


def _body_of(function: ast.FunctionDef | ast.Lambda) -> set[ast.AST]:
    body = function.body if isinstance(function, ast.FunctionDef) else [function.body]
    return {child for part in body for child in ast.walk(part)}


def test_every_rule_is_read_somewhere() -> None:
    read = {n.attr for tree in trees().values() for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
    read |= {"plain_level", "fair_level"}  # by ScoringRules.levels
    assert [r.name for r in every_rule() if r.name.split(".")[1] not in read] == []


def test_every_rule_says_what_it_is() -> None:
    rules = every_rule()
    assert len({r.name for r in rules}) == len(rules) > 200
    for r in rules:
        assert r.unit and len(r.meaning) > 15 and not r.meaning.endswith("."), r.name
        assert r.source == "level" or r.source.startswith(("measured: ", "decisions: ")), r.name
        assert math.isfinite(r.value), r.name
    for section in fields(DecisionRules):
        assert is_dataclass(getattr(in_force(), section.name))


def test_defaults_pass_their_own_check() -> None:
    tables: dict[str, dict[str, float]] = {}
    for r in every_rule():
        section, name = r.name.split(".")
        tables.setdefault(section, {})[name] = r.value
    assert rules_of(tables, "defaults") == DecisionRules()


def test_other_rules_decide_otherwise_while_they_hold() -> None:
    factor = 60 * 1.05  # a twentieth beside the ratio of a minute to a second
    loose = rules_of({"data": {"known_ratio_distance": 0.07}}, "test")
    assert ratio_text(factor) == ""
    with with_rules(loose):
        assert "minute" in ratio_text(factor)
        with with_rules(DecisionRules()):
            assert ratio_text(factor) == ""
        assert in_force() is loose
    assert ratio_text(factor) == ""
    with pytest.raises(ZeroDivisionError), with_rules(loose):
        raise ZeroDivisionError
    assert in_force() == DecisionRules()


def test_a_file_says_what_differs(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[selection]\nvuong_z = 3\nmost_effects = 2\n[evidence]\ntied_nats = 1.0\n", encoding="utf-8")
    rules = load_rules(file)
    assert rules == replace(DecisionRules(), selection=replace(DecisionRules().selection, vuong_z=3.0, most_effects=2))
    assert differing(rules) == {"selection": {"vuong_z": 3.0, "most_effects": 2}}
    assert rules_of(differing(rules), "again") == rules
    assert differing(DecisionRules()) == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[choice]\nvuong_z = 3.0\n", "choice"),
        ("[selection]\nvuong = 3.0\n", "[selection]: unknown key 'vuong'"),
        ("selection = 3.0\n", "[selection]: a table is needed"),
        ("[selection]\nvuong_z = true\n", "[selection] vuong_z = True: a finite number"),
        ("[selection]\nvuong_z = '3'\n", "[selection] vuong_z = '3': a finite number"),
        ("[selection]\nvuong_z = [3.0]\n", "[selection] vuong_z"),
        ("[selection]\nvuong_z = nan\n", "[selection] vuong_z = nan: a finite number"),
        ("[selection]\nvuong_z = -inf\n", "[selection] vuong_z = -inf: a finite number"),
        (f"[selection]\nvuong_z = {'9' * 400}\n", "[selection] vuong_z"),
        ("[selection]\nvuong_z = -2.0\n", "[selection] vuong_z = -2.0: a number of at least 0"),
        ("[selection]\nmost_effects = 2.5\n", "[selection] most_effects = 2.5: a finite whole number"),
        ("[selection]\nmost_effects = 0\n", "[selection] most_effects = 0: a number of at least 1"),
        ("[selection]\nfurther_share = 1.5\n", "[selection] further_share = 1.5: a number of at least 0 and at most 1"),
        ("[selection]\nrarer_odds = 0\n", "[selection] rarer_odds = 0: a number above 0"),
        ("[selection]\nvuong_z = 3.0\nvuong_z = 3.0\n", "not valid TOML"),
    ],
)
def test_what_can_be_no_rule_is_refused(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "rules.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as refused:
        load_rules(file)
    assert said in str(refused.value) and str(file) in str(refused.value) and len(str(refused.value)) < 6000
