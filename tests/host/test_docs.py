"""What the README shows works: its C example compiles, its commands exist, its files are read."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aeolid.formats import write_table
from aeolid.plants import hawt
from aeolid.record import Roles

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", README, re.S) for line in block.splitlines() if line]


def block(language: str, contains: str) -> str:
    found = [b for b in re.findall(rf"```{language}\n(.*?)```", README, re.S) if contains in b]
    assert len(found) == 1, f"{len(found)} {language} blocks contain {contains!r}"
    return found[0]


def aeolid(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "aeolid.cli.main", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=200, check=False)


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


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write recordings with the channels of the README's roles file, from the built-in turbine."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "roles.toml").write_text(block("toml", "# roles.toml"))
    assert [c.role for c in Roles.load(folder / "roles.toml").channels] == ["input", "input", "output"]
    for seed, name in enumerate(["monday.csv", "tuesday.csv"]):
        record = hawt.simulate_closed_loop(2500, seed, excitation=hawt.Excitation(noise=0.1))
        columns = {
            "time_s": record.time_s,
            "BldPitch1": record.column("pitch"),
            "torque": 1e-3 * record.column("generator_torque"),
            "generator_speed": record.column("generator_speed") * 30 / np.pi,
        }
        write_table(folder / name, columns)
    return folder


def test_the_commands_on_a_recording_run(recordings: Path) -> None:
    lines = [line for line in COMMANDS if "monday" in line or "tuesday" in line]
    assert len(lines) == 3
    for line in lines:
        done = aeolid(*shlex.split(line)[1:], folder=recordings)
        assert done.returncode == 0, done.stderr
    for name in ("model.json", "model.html", "simulated.csv"):
        assert (recordings / name).stat().st_size > 1000


def test_every_option_shown_exists(tmp_path: Path) -> None:
    for line in COMMANDS:
        words = shlex.split(line.removesuffix("&"))
        done = aeolid(words[1], "--help", folder=tmp_path)
        assert done.returncode == 0, words
        known = set(re.findall(r"--[a-z][a-z-]*", done.stdout))
        assert {w for w in words if w.startswith("--")} <= known, line
    for command, option in re.findall(r"`aeolid (\w+)[^`]*?(--[a-z-]+)", README):
        done = aeolid(command, "--help", folder=tmp_path)
        assert option in done.stdout, (command, option)


def test_the_case_file_is_understood(tmp_path: Path) -> None:
    """The README's case.toml is read up to its recordings, which are not there."""
    (tmp_path / "case.toml").write_text(block("toml", "# case.toml"))
    (tmp_path / "roles.toml").write_text(block("toml", "# roles.toml"))
    done = aeolid("diagnose", ".", "--out", "out", folder=tmp_path)
    assert done.returncode == 3 and "monday.csv: no such file" in done.stderr


def test_files_named_in_the_readme_exist() -> None:
    for name in ("tools/demo", "tests/run", "tools/apt-packages.txt", "port/template", "port/posix", "LICENSE",
                 "include/aeolid/port.h", "include/aeolid/stream.h", "CHANGELOG.md"):  # fmt: skip
        assert (ROOT / name).exists(), name
    for script in ("tools/demo", "tools/setup", "tests/run", ".ci/run"):
        subprocess.run(["sh", "-n", str(ROOT / script)], check=True)
