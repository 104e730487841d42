"""Write tools/constraints.txt: every Python package of this repository, in the version and the file that is tested.

python tools/supply/lock.py            after a change of tools/pyproject.toml: keeps the versions that the file has
python tools/supply/lock.py --upgrade  the newest versions within the ranges

Run it with the Python and on the platform that the file is for (Python 3.11 on x86-64 Linux); pip finds the versions
in the index that it is set up for. Then sh tests/run, and tools/supply/licences.py for the page of licences.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
LOCK = ROOT / "tools/constraints.txt"
PYPROJECT = ROOT / "tools/pyproject.toml"
HEAD = """\
# Every Python package of this repository as it is tested: version, SHA-256 of its file, and the group that needs it.
# Written by tools/supply/lock.py, read by tools/setup on Python 3.11 on x86-64 Linux; users get the ranges of
# tools/pyproject.toml. docs also needs what demo needs, tests what docs needs; ninja is for machines that have none.
"""
# scipy 1.17 takes 1.8 s of processor to import where 1.16 takes 1.1: every command and every test process pays it.
HELD = ("scipy<1.17",)
OLDEST = "3.11.0"  # Debian 12 has 3.11.2, and a package may ask for a later one
GROUPS = ("pip", "build", "demo", "docs", "tests", "cmake", "ninja")  # a package stands in the first that needs it


def requirements() -> dict[str, list[Requirement]]:
    """Return what each group asks for by name, from pyproject.toml; an extra that names another one is spelt out."""
    with PYPROJECT.open("rb") as file:
        told: dict[str, Any] = tomllib.load(file)
    extras = told["project"]["optional-dependencies"]

    def spell_out(texts: Iterable[str]) -> list[Requirement]:
        found = []
        for text in texts:
            wanted = Requirement(text)
            own = wanted.name == told["project"]["name"]
            found += spell_out(t for extra in wanted.extras for t in extras[extra]) if own else [wanted]
        return found

    return {
        "pip": spell_out(["pip", "uv"]),
        "build": spell_out(told["build-system"]["requires"]),
        "cmake": spell_out(["cmake>=3.20"]),
        "ninja": spell_out(["ninja"]),
        "demo": spell_out(told["project"]["dependencies"]),
        "docs": spell_out(extras["docs"]),
        "tests": spell_out(extras["test"]),
    }


def read_lock() -> dict[str, tuple[str, str, str]]:
    """Return version, SHA-256 and group for each package of the lock file."""
    found = {}
    for line in LOCK.read_text(encoding="utf-8").splitlines() if LOCK.exists() else []:
        if line.startswith("#"):
            continue
        words = line.split()  # name==version --hash=sha256:… # group
        name, _, version = words[0].partition("==")
        found[name] = (version, words[1].removeprefix("--hash=sha256:"), words[3])
    return found


def resolve(wanted: list[Requirement], kept: dict[str, str]) -> list[dict[str, Any]]:
    """Let pip find versions for everything at once; wheels only, whose installation runs no code."""
    with tempfile.TemporaryDirectory() as folder:
        report, constraints = Path(folder) / "report.json", Path(folder) / "kept.txt"
        constraints.write_text("".join(f"{name}=={version}\n" for name, version in kept.items()))
        command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "install", "--dry-run"]
        command += [
            "--ignore-installed",
            "--python-version",
            OLDEST,
            "--only-binary",
            ":all:",
            "--report",
            str(report),
            "-c",
            str(constraints),
        ]
        subprocess.run([*command, *map(str, wanted)], check=True)
        found: list[dict[str, Any]] = json.loads(report.read_text())["install"]
    return found


def closure(names: Iterable[str], needs: dict[str, list[Requirement]]) -> set[str]:
    """Return packages and all that they need, here and with the extras asked for."""
    found: set[tuple[str, str]] = set()
    open_ends = [(canonicalize_name(w.name), extra) for w in map(Requirement, names) for extra in ("", *w.extras)]
    while open_ends:
        name, extra = end = open_ends.pop()
        if end in found:
            continue
        found.add(end)
        for need in needs.get(name, []):
            if need.marker is None or need.marker.evaluate({"extra": extra}):
                open_ends += [(canonicalize_name(need.name), more) for more in ("", *need.extras)]
    return {name for name, _ in found}


def main(upgrade: bool) -> None:
    """Resolve, and write one line a package in the order of the groups."""
    groups = requirements()
    kept = {} if upgrade else {name: version for name, (version, _, _) in read_lock().items()}
    wanted = [*(w for group in groups.values() for w in group), *map(Requirement, HELD)]
    packages = {canonicalize_name(p["metadata"]["name"]): p for p in resolve(wanted, kept)}
    needs = {name: [Requirement(t) for t in p["metadata"].get("requires_dist", [])] for name, p in packages.items()}
    lines, done = [], set[str]()
    for group in GROUPS:
        for name in sorted(closure(map(str, groups[group]), needs) - done):
            package = packages[name]
            digest = package["download_info"]["archive_info"]["hashes"]["sha256"]
            lines.append(f"{name}=={package['metadata']['version']} --hash=sha256:{digest} # {group}\n")
            done.add(name)
    LOCK.write_text(HEAD + "".join(lines), encoding="utf-8")
    print(f"{LOCK.relative_to(ROOT)}: {len(lines)} packages")


if __name__ == "__main__":
    main("--upgrade" in sys.argv[1:])
