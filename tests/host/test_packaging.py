"""Recipes for container, conda and CI say what the package itself says, and call what there is."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

import aeolid

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "tools" / "pyproject.toml").read_text())
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


def loaded(path: Path) -> Any:
    return pytest.importorskip("yaml").safe_load(path.read_text(encoding="utf-8"))


def test_conda_asks_for_what_the_package_asks_for() -> None:
    recipe = loaded(ROOT / "packaging" / "conda" / "recipe.yaml")
    wanted = set()
    for text in PROJECT["project"]["dependencies"]:
        name, ends = re.fullmatch(r"([\w-]+)(.*)", text).groups()  # type: ignore[union-attr]
        wanted.add(f"{CONDA_NAMES.get(name, name).lower()} {ends}")
    given = set(recipe["requirements"]["run"])
    assert given - wanted == {f"python {PROJECT['project']['requires-python']}"} and wanted <= given
    assert recipe["context"]["version"] == aeolid.__version__
    assert set(PROJECT["build-system"]["requires"]) == {
        t.replace(" ", "", 1) for t in recipe["requirements"]["host"] if t.startswith("scikit")
    }
    assert recipe["build"]["python"]["entry_points"] == [
        f"{k} = {v}" for k, v in PROJECT["project"]["scripts"].items()
    ]  # fmt: skip


def test_the_container_is_made_of_what_is_locked() -> None:
    """Its lines are the commands that a reader would type; the groups that it takes from the lock are there."""
    text = (ROOT / "packaging" / "docker" / "Dockerfile").read_text()
    groups = re.search(r"# \((.*?)\)\$", text)
    assert groups is not None and "--require-hashes" in text
    locked = (ROOT / "tools" / "constraints.txt").read_text()
    known = set(re.findall(r"--hash=\S+ # (\w+)$", locked, re.M))
    assert {"build", "demo"} <= set(groups[1].split("|")) <= known
    order = [line.split()[0] for line in text.splitlines() if re.match("[A-Z]+ ", line)]
    assert order.count("FROM") == 2 and order.index("USER") < order.index("ENTRYPOINT")  # nobody is root at work
    lines = [line for line in text.replace("\\\n", "").splitlines() if line.startswith("RUN ")]
    for line in lines:
        subprocess.run(["sh", "-n", "-c", line.removeprefix("RUN ")], check=True)


def test_ci_calls_what_there_is() -> None:
    flow = loaded(ROOT / ".github" / "workflows" / "ci.yml")
    called = [step["run"] for job in flow["jobs"].values() for step in job["steps"] if "run" in step]
    scripts = [word for line in called for word in line.split() if "/" in word and word.startswith((".ci", "tests"))]
    assert set(scripts) == {".ci/run", "tests/run"} and all((ROOT / s).is_file() for s in scripts)
    options = {o for line in called for o in re.findall(r"-D(AEOLID_\w+)", line)}
    assert options and all(o in (ROOT / "CMakeLists.txt").read_text() for o in options)
    (wheels,) = (s for s in flow["jobs"]["wheels"]["steps"] if "cibuildwheel" in s.get("uses", ""))
    assert (ROOT / wheels["with"]["package-dir"] / "pyproject.toml").is_file()
    minor = PROJECT["project"]["requires-python"].removeprefix(">=3.")
    settings = PROJECT["tool"]["cibuildwheel"]
    assert settings["build"] == f"cp3{minor}-*" and "*-win*" in settings["skip"]
    systems = flow["jobs"]["wheels"]["strategy"]["matrix"]["os"]
    assert not any("windows" in name for name in systems) and any("macos" in name for name in systems)
    assert any("windows" in name for name in flow["jobs"]["library"]["strategy"]["matrix"]["os"])
    assert settings["macos"]["archs"] == ["arm64"] and PROJECT["tool"]["scikit-build"]["wheel"]["py-api"] == "py3"
