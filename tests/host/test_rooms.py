"""The rooms of aeolid.diagnose: imports point down only, and no modules import each other in a circle."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "tools" / "src" / "aeolid"

# From the ground up; the rooms of one line do not know of each other. A word without a folder is a module of its own.
FLOORS = (
    ("rules",),
    ("deadline", "stats"),
    ("data",),
    ("structure",),
    ("predictor",),
    ("hypotheses.parts",),
    ("hypotheses.entries", "hypotheses.generic"),
    ("hypotheses.catalogue",),
    ("hypotheses.simulators",),
    ("baseline",),
    ("scoring", "localise"),
    ("candidates",),
    ("selection",),
    ("validation",),
    ("experiments",),
    ("pipeline",),
    ("conclusion",),
    ("run_prior",),
    ("conclude", "estimate"),
)
FLOOR = {f"diagnose.{room}": floor for floor, rooms in enumerate(FLOORS) for room in rooms}

# Circles elsewhere in aeolid, each by its modules. The list may only become shorter.
CIRCLES_LEFT = (
    frozenset({"models.equations", "models.integrate", "models.machine_code", "models.rate"}),
    frozenset({"models.load", "models.lpv_prediction"}),
    frozenset({"output.call", "output.writing"}),
    frozenset({"challenge.models", "challenge.plants"}),
    # objects that are made from each other: a model simulates, a simulation knows its model
    frozenset(
        f"api.{m}"
        for m in ("equations", "fitted", "linear", "models", "pictures", "scheduled", "simulation", "validation")
    ),
)


def name_of(path: Path) -> str:
    """Return a module's dotted name below aeolid; that of a package is its folder's."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


def imports_in(tree: ast.AST, module: str, is_package: bool, known: frozenset[str]) -> frozenset[str]:
    """Return the modules of aeolid that a module imports anywhere, also for types alone or within a function."""
    package = module if is_package else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {a.name.removeprefix("aeolid.") for a in node.names if a.name.startswith("aeolid.")}
        elif isinstance(node, ast.ImportFrom):
            base = (node.module or "").removeprefix("aeolid").removeprefix(".")
            if node.level:
                parts = package.split(".")
                base = ".".join([*parts[: len(parts) - node.level + 1], *filter(None, [node.module])])
            elif not f"{node.module}.".startswith("aeolid."):
                continue
            below = {f"{base}.{a.name}".removeprefix(".") for a in node.names}
            found |= (below & known) | ({base} if below - known else set())
    return frozenset(found & known) - {module}


@cache
def imports() -> dict[str, frozenset[str]]:
    """Return what every module of aeolid imports from aeolid."""
    paths = {name_of(p): p for p in sorted(PACKAGE.rglob("*.py"))}
    known = frozenset(paths)
    trees = {n: ast.parse(p.read_text(encoding="utf-8")) for n, p in paths.items()}
    found = {n: imports_in(trees[n], n, p.name == "__init__.py", known) for n, p in paths.items()}
    return found | {"": frozenset()}  # the package itself only lists its public names, which it imports on demand


def room_of(module: str) -> str | None:
    """Return the room a module of diagnose is in; None for the packages that only hold rooms."""
    return next((r for r in FLOOR if module == r or module.startswith(f"{r}.")), None)


def upward(graph: dict[str, frozenset[str]]) -> list[str]:
    """List the imports that point up, or from one room to another on the same floor."""
    wrong = []
    for module, used in graph.items():
        for other in sorted(used):
            above, below = room_of(module), room_of(other)
            if above and below and above != below and FLOOR[below] >= FLOOR[above]:
                wrong.append(f"{module} imports {other}")
    return wrong


def circles(graph: dict[str, frozenset[str]]) -> set[frozenset[str]]:
    """Return the groups of modules that reach each other (Warshall's closure by depth-first search from each)."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        left = [start]
        while left:
            for other in graph.get(left.pop(), frozenset()) - seen:
                seen.add(other)
                left.append(other)
        return seen

    reach = {n: reached(n) for n in graph}
    return {frozenset(m for m in reach[n] if n in reach[m]) for n in graph if n in reach[n]}


def test_every_module_of_diagnose_is_in_a_room() -> None:
    modules = [n for n in imports() if n.startswith("diagnose.")]
    outside = [n for n in modules if room_of(n) is None]
    assert outside == ["diagnose.hypotheses"]
    assert set(FLOOR) == {room_of(n) for n in modules} - {None}


def test_imports_between_rooms_point_down() -> None:
    assert upward(imports()) == []


def test_no_modules_of_diagnose_import_each_other() -> None:
    assert [sorted(c) for c in circles(imports()) if any(n.startswith("diagnose") for n in c)] == []


def test_no_circle_is_new_elsewhere() -> None:
    found = circles(imports())
    assert found - set(CIRCLES_LEFT) == set(), "a new circle, or one that has grown"
    assert set(CIRCLES_LEFT) - found == set(), "this one is gone: take it off the list"


@pytest.mark.parametrize(
    ("text", "module", "wrong"),
    [
        ("from aeolid.diagnose.pipeline import study", "diagnose.data.case", True),
        ("from aeolid.diagnose import pipeline", "diagnose.data.case", True),
        ("import aeolid.diagnose.scoring.scores", "diagnose.localise.cells", True),  # the same floor
        ("from ..candidates import race", "diagnose.data.case", True),
        ("from aeolid.diagnose.data.case import load_case", "diagnose.pipeline", False),
        ("from aeolid.diagnose.hypotheses.entries import overflow", "diagnose.hypotheses.parts.rotor", True),
    ],
)
def test_the_rule_can_fail(text: str, module: str, wrong: bool) -> None:
    used = imports_in(ast.parse(f"def f():\n    {text}\n"), module, False, frozenset(imports()))
    assert len(used) == 1 and bool(upward({module: used})) == wrong
    other = next(iter(used))
    assert circles({module: used, other: frozenset({module})}) == {frozenset({module, other})}
