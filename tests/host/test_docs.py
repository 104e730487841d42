"""What the README shows works: its C example compiles, its files exist; papers keep their length."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
OWN = (ROOT / "docs/howto/own_recording.md").read_text(encoding="utf-8")


def block(language: str, contains: str, text: str = README) -> str:
    found = [b for b in re.findall(rf"```{language}\n(.*?)```", text, re.S) if contains in b]
    assert len(found) == 1, f"{len(found)} {language} blocks contain {contains!r}"
    return found[0]


def aeolid(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "aeolid.cli.main", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=3600, check=False)


@pytest.mark.parametrize("standard", ["c99", "c11"])
def test_the_c_example_compiles_without_a_warning(tmp_path: Path, standard: str) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    (tmp_path / "example.c").write_text(block("c", "void control_task("))
    flags = [f"-std={standard}", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", f"-I{ROOT / 'include'}"]
    command = [compiler, *flags, "-c", "example.c", "-o", "example.o"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_c_example_is_short() -> None:
    lines = [line for line in block("c", "void control_task(").splitlines() if line.strip()]
    assert len(lines) <= 26


@pytest.mark.diagnosis
def test_the_case_file_is_understood(tmp_path: Path) -> None:
    """The case.toml shown is read up to its recordings, which are not there."""
    (tmp_path / "case.toml").write_text(block("toml", "# case.toml", OWN))
    (tmp_path / "roles.toml").write_text(block("toml", "# roles.toml", OWN))
    done = aeolid("diagnose", ".", "--out", "out", folder=tmp_path)
    assert done.returncode == 3 and "monday.csv: no such file" in done.stderr


def test_files_named_exist() -> None:
    """Links of the papers at the top, and what they name in backquotes."""
    for name in ("README.md", "DESIGN.md", "CONTRIBUTING.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        links = [link.split("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
        quoted = re.findall(r"`((?:docs|tools|tests|port|src|include|examples)/[\w./]+)`", text)
        assert links and [link for link in links + quoted if not (ROOT / link).exists()] == [], name
    for script in ("tools/demo", "tools/docs", "tools/setup", "tests/run", ".ci/run"):
        subprocess.run(["sh", "-n", str(ROOT / script)], check=True)


def test_the_papers_at_the_top_stay_short() -> None:
    for name, most in (("README.md", 150), ("DESIGN.md", 300)):
        assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) <= most, name
