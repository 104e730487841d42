"""The rules of style that a tool can check: length, docstrings, imports that point one way, and plain words."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "tools" / "src" / "aeolid"
MODULES = sorted(PACKAGE.rglob("*.py"))
LEVEL = {"errors": 0, "record": 1, "models": 2, "identify": 3, "diagnose": 4, "fleet": 4, "excitation": 4,
         "report": 5, "monitor": 5, "begin": 5, "challenge": 5, "api": 5, "cli": 6, "demo": 7}  # fmt: skip
MOST_LINES, MOST_BODY = 350, 40
SIDE = {"can", "formats", "filters", "native", "plants"}  # hang off record; models are below them
TOP = {"CMakeLists.txt", "src", "include", "port", "tests", "tools", "docs", "examples", "packaging", "zephyr",
       "library.json", "idf_component.yml", "README.md", "DESIGN.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md",
       "LICENSE", ".clang-format", ".ci", ".gitignore",
       ".dockerignore", ".github"}  # fmt: skip


def tracked() -> list[Path]:
    """List the files under version control; without git, every file of the source folders."""
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode == 0 and done.stdout:
        return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]
    return [p for top in TOP for p in ([ROOT / top] if (ROOT / top).is_file() else (ROOT / top).rglob("*"))]


def functions(tree: ast.AST) -> list[ast.FunctionDef]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def body_lines(function: ast.FunctionDef) -> int:
    """Count the lines of a function that are code: neither signature nor docstring."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_modules_keep_to_the_style(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    lines = len(text.splitlines())
    faults = [] if lines <= MOST_LINES else [f"{lines} lines: split it"]
    if not ast.get_docstring(tree):
        faults.append("no module docstring")
    for function in functions(tree):
        if body_lines(function) > MOST_BODY:
            faults.append(f"line {function.lineno}: {function.name} has {body_lines(function)} lines of code")
    faults += [f"line {line}: {name}: {why}" for name, line, why in undocumented(tree)]
    assert faults == []


def undocumented(tree: ast.Module) -> list[tuple[str, int, str]]:
    """Find public functions and classes without a docstring, or with a first line that is no sentence."""
    found = []
    for node in [tree, *(n for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_"))]:
        for child in node.body:
            if not isinstance(child, ast.FunctionDef | ast.ClassDef) or child.name.startswith("_"):
                continue
            text = ast.get_docstring(child)
            if not text:
                found.append((child.name, child.lineno, "no docstring"))
            elif text.split("\n")[0].strip()[-1] not in ".:;,)…":
                found.append((child.name, child.lineno, "the docstring's first line does not end as a sentence"))
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    part = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    wrong = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            used = name.split(".")[1] if name.startswith("aeolid.") else None
            if used is None or used == part or part in ("__init__", "demo"):
                continue
            upwards = LEVEL.get(used, 0) > (LEVEL["models"] if part in SIDE else LEVEL.get(part, 0))
            if upwards or (used in SIDE and LEVEL.get(part, 9) < LEVEL["models"]):
                wrong.append(name)
    assert wrong == []


def test_the_top_level_is_as_laid_out() -> None:
    assert {p.relative_to(ROOT).parts[0] for p in tracked()} <= TOP


def test_nothing_is_left_unfinished_or_machine_bound() -> None:
    endings = (".py", ".c", ".h", ".cpp", ".md", ".toml", ".txt", ".sh", ".cmake", "")
    marks = re.compile(r"\b(TO" + r"DO|FIX" + r"ME|X" + r"XX|HA" + r"CK|NotImplemented" + r"Error)\b")
    paths = re.compile(r"(?<![\w.])/(work|root|home/\w+)/")
    wrong = []
    for path in tracked():
        if path.suffix not in endings:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            if marks.search(line) or paths.search(line):
                wrong.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}")
    assert wrong == []


def test_no_large_file_is_tracked() -> None:
    assert [p.name for p in tracked() if p.is_file() and p.stat().st_size > 800_000] == []


def test_the_rules_can_fail() -> None:
    bad = ast.parse("def f():\n    pass\n\nclass C:\n    def g(self):\n        'no stop'\n")
    assert [name for name, _, _ in undocumented(bad)] == ["f", "C", "g"]
    long = ast.parse("def f():\n    '''Doc.'''\n" + "    x = 1\n" * 60)
    assert body_lines(functions(long)[0]) == 60


LEAST_PATIENCE_S = 1200  # what takes a second has taken forty beside eight others on two cores
WAITING = re.compile(r"(?:\btimeout=|mark\.timeout\(|^PATIENCE_S = |\bTIMEOUT )([0-9]+(?:\.[0-9]+)?)")


def test_no_limit_of_a_test_is_in_reach_of_a_busy_machine() -> None:
    """A test that waits gives up after a long time only; what never ends is ended by processor time, see conftest.

    The guests of tests/sil/uml have limits of their own: an emulated machine that hangs has to be told from a slow one.
    """
    files = [p for p in tracked() if p.is_relative_to(ROOT / "tests") and p.suffix in (".py", ".txt")]
    files = [p for p in files if p.parent.name != "uml"]
    short = [
        f"{path.relative_to(ROOT)}:{number}: {found[0]}"
        for path in files if path.name not in ("conftest.py", Path(__file__).name)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for found in WAITING.finditer(line) if float(found[1]) < LEAST_PATIENCE_S
    ]  # fmt: skip
    assert files and short == []
