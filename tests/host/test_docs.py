"""What the README shows works: its C example compiles, its files exist and are read; see test_docs_commands too."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language: str, contains: str) -> str:
    found = [b for b in re.findall(rf"```{language}\n(.*?)```", README, re.S) if contains in b]
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
    """The README's case.toml is read up to its recordings, which are not there."""
    (tmp_path / "case.toml").write_text(block("toml", "# case.toml"))
    (tmp_path / "roles.toml").write_text(block("toml", "# roles.toml"))
    done = aeolid("diagnose", ".", "--out", "out", folder=tmp_path)
    assert done.returncode == 3 and "monday.csv: no such file" in done.stderr


def test_files_named_in_the_readme_exist() -> None:
    for name in ("tools/demo", "tests/run", "tools/apt-packages.txt", "port/template", "port/posix", "LICENSE",
                 "include/aeolid/port.h", "include/aeolid/stream.h", "CHANGELOG.md", "tools/docs", "docs/index.md",
                 "examples/controller/main.c", "examples/offline.py"):  # fmt: skip
        assert (ROOT / name).exists(), name
    for script in ("tools/demo", "tools/docs", "tools/setup", "tests/run", ".ci/run"):
        subprocess.run(["sh", "-n", str(ROOT / script)], check=True)
