"""What the tool is made of: every package is locked, has a known licence, and stands in the bill of materials."""

from __future__ import annotations

import json
import re
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/supply"))
import licences
import lock
import sbom

LOCKED = lock.read_lock()
GROUPS = lock.requirements()
UNLOCKED = {name for name, (version, _, group) in LOCKED.items() if group not in ("cmake", "ninja")
            and (not list(metadata.distributions(name=name)) or metadata.version(name) != version)}  # fmt: skip


def faults(wanted: list[Requirement], locked: dict[str, tuple[str, str, str]]) -> list[str]:
    """List requirements that the lock leaves out or holds in a version outside the range."""
    found = []
    for need in wanted:
        name = canonicalize_name(need.name)
        if name not in locked:
            found.append(f"{need}: not in tools/constraints.txt; run tools/supply/lock.py")
        elif not need.specifier.contains(locked[name][0], prereleases=True):
            found.append(f"{need}: tools/constraints.txt has {locked[name][0]}; run tools/supply/lock.py")
    return found


def test_every_dependency_is_locked_within_its_range() -> None:
    """A new dependency of pyproject.toml cannot come in without the lock."""
    assert faults([need for group in GROUPS.values() for need in group], LOCKED) == []


def test_a_dependency_outside_the_lock_is_noticed() -> None:
    """An unlocked package and a range that moved: both are faults."""
    told = faults([Requirement("leftpad>=1"), Requirement("numpy>=99")], LOCKED)
    assert len(told) == 2 and "leftpad>=1: not in" in told[0] and "numpy>=99: tools/constraints.txt has" in told[1]


@pytest.mark.skipif(bool(UNLOCKED), reason="the environment is not the locked one: other Python, platform or versions")
def test_the_lock_is_closed() -> None:
    """What the packages need themselves is locked too, in a group that is installed with them; nothing is left over."""
    needs = {name: [Requirement(t) for t in metadata.requires(name) or []] for name, (_, _, group) in LOCKED.items()
             if group not in ("cmake", "ninja")}  # fmt: skip
    reached: set[str] = set()
    for group in lock.GROUPS:
        reached |= lock.closure(map(str, GROUPS[group]), needs)
        assert reached == {
            name for name, (_, _, g) in LOCKED.items() if lock.GROUPS.index(g) <= lock.GROUPS.index(group)
        }


@pytest.mark.skipif(bool(UNLOCKED), reason="the environment is not the locked one: other Python, platform or versions")
def test_the_lock_serves_every_python_of_its_version() -> None:
    """Debian 12 has 3.11.2: a package for 3.11.5 and later installs where the lock is written and not there."""
    ranges = {name: metadata.metadata(name).get("Requires-Python") for name, (_, _, group) in LOCKED.items()
              if group not in ("cmake", "ninja")}  # fmt: skip
    assert [n for n, told in ranges.items() if told and not SpecifierSet(told).contains(lock.OLDEST)] == []


def test_the_lock_names_files_and_no_index() -> None:
    """A line is a name, a version, a SHA-256 and a group: no address, no option."""
    text = lock.LOCK.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    form = re.compile(r"[a-z0-9-]+==[0-9][\w.]* --hash=sha256:[0-9a-f]{64} # (pip|build|cmake|ninja|demo|docs|tests)")
    assert len(lines) == len(LOCKED) > 100 and [line for line in lines if not form.fullmatch(line)] == []
    assert "://" not in text and "index" not in text


@pytest.mark.skipif(bool(UNLOCKED), reason="the environment is not the locked one: other Python, platform or versions")
def test_the_page_of_licences_is_that_of_the_packages() -> None:
    """Regenerated, it is the same; LGPL and MPL packages are named above the table."""
    assert licences.page() == licences.PAGE.read_text(encoding="utf-8"), "run tools/supply/licences.py"
    named = set(re.findall(r"^- \*\*([\w-]+)\*\*", licences.page(), re.MULTILINE))
    assert {"asammdf", "python-can", "certifi", "hypothesis", "pathspec"} <= named


def test_every_locked_package_is_on_the_page() -> None:
    """Name, version and a licence that somebody has looked at, in whatever environment the tests run."""
    page = licences.PAGE.read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| ([\w-]+) \| ([\w.]+) \| [\w.+-]", page, re.MULTILINE))
    rows.pop("package")
    assert rows == {name: version for name, (version, _, _) in LOCKED.items()}


def test_an_unknown_licence_stops_the_list(monkeypatch: pytest.MonkeyPatch) -> None:
    """GPL is neither permissive nor on the list of conditions, so a person must decide; none at all likewise."""
    for told in ("GPL-3.0-only", ""):
        monkeypatch.setattr(licences, "licence_of", lambda name, told=told: told if name == "rich" else "MIT")
        with pytest.raises(SystemExit, match=r"rich .*: the licence is (GPL-3.0-only|nothing we can read); read it"):
            licences.table()


def test_the_bill_of_materials(tmp_path: Path) -> None:
    """CycloneDX 1.6: the library with a hash of its sources, and each package as it is locked."""
    sbom.main(tmp_path / "sbom.json")
    bill = json.loads((tmp_path / "sbom.json").read_text())
    assert (bill["bomFormat"], bill["specVersion"], bill["metadata"]["component"]["name"]) == (
        "CycloneDX",
        "1.6",
        "aeolid",
    )
    parts = {part["name"]: part for part in bill["components"]}
    assert set(parts) == {*LOCKED, "libaeolid"}
    assert parts["libaeolid"]["hashes"][0]["content"] == sbom.source_hash()
    assert parts["libaeolid"]["version"] == bill["metadata"]["component"]["version"] == metadata.version("aeolid")
    for name, (version, digest, _) in LOCKED.items():
        assert (parts[name]["version"], parts[name]["hashes"][0]["content"]) == (version, digest)
    needed = next(d["dependsOn"] for d in bill["dependencies"] if d["ref"] == "aeolid")
    assert "libaeolid" in needed and any(n.startswith("numpy==") for n in needed)
    assert not any(n.startswith("pytest==") for n in needed)
