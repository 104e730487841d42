"""What lies in examples/ does what the pages say of it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
SCRIPT = Path(sys.executable).parent / "aeolid"


def run(*words: object, folder: Path) -> str:
    done = subprocess.run(
        [str(w) for w in words], cwd=folder, env=os.environ | {"MPLBACKEND": "Agg"}, capture_output=True, text=True,
        timeout=3600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{words}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the example with all warnings as errors; returns the program."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    folder = tmp_path_factory.mktemp("controller")
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow",
             "-Werror", f"-I{ROOT / 'include'}", f"-I{ROOT / 'src'}"]  # fmt: skip
    sources = [EXAMPLES / "controller/main.c", *sorted((ROOT / "src").glob("*.c"))]
    run(compiler, *flags, *sources, "-o", "controller", "-lm", folder=folder)
    return folder / "controller"


@pytest.mark.slow
def test_the_controller_is_heard_and_its_tower_found(controller: Path, tmp_path: Path) -> None:
    """The plant in the example has a tower at 0.32 Hz with 3 % damping, and a rotor that slows down within 4 s."""
    assert ", health 0, " in run(controller, "bus.log", folder=tmp_path)
    run(SCRIPT, "listen", "--bus", "bus.log", "--record", "received.csv", "--markov", "markov.npz", folder=tmp_path)
    options = ("--past", "12", "--order", "3", "--markov", "markov.npz", "--out", "model.json", "--json", "facts.json")
    run(SCRIPT, "identify", "received.csv", "--roles", "received.roles.toml", *options, folder=tmp_path)
    modes = json.loads((tmp_path / "facts.json").read_text())["modes"]
    (tower,) = [m for m in modes if m["damping"] < 0.5]
    assert abs(tower["frequency_hz"] - 0.32) < 0.003 and abs(tower["damping"] - 0.03) < 0.01, tower


def test_the_controller_says_what_it_needs(controller: Path, tmp_path: Path) -> None:
    for arguments in ([], ["none/bus.log"]):
        done = subprocess.run([controller, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 2 and "usage: controller LOG" in done.stderr


def test_the_walk_in_python_runs(tmp_path: Path) -> None:
    said = run(sys.executable, EXAMPLES / "offline.py", "tryout", folder=tmp_path)
    assert "one step" in said and "innovations" in said
    assert (tmp_path / "tryout/response.svg").stat().st_size > 5000
    assert json.loads((tmp_path / "tryout/model.json").read_text())["kind"] == "state_space"


def test_the_newest_version_of_the_changelog_is_that_of_the_header() -> None:
    header = (ROOT / "include/aeolid/aeolid.h").read_text()
    version = ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header))
    titles = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert next(t for t in titles if t != "Unreleased") == version
    for title in re.findall(r"^### (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.M):
        assert title in ("Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"), title
