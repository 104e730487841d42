"""tools/setup where it cannot do its work, and where it finds half of it done; Python and pip are stand-ins here."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# A Python that can make environments and whose pip writes down what it is asked for. LOCKED: what platform it claims.
STAND_IN = """#!/bin/sh
case "$*" in
    *_base_executable*) echo "$TREE/python$VERSION" ;;
    *libc_ver*) echo "$VERSION CPython ${PLATFORM:-linux-x86_64} glibc" ;;
    *sys.version_info\\[:2\\]*) case $0 in *.venv/*) cat "$TREE/.venv/version" ;; *) echo "$VERSION" ;; esac ;;
    '-c import ensurepip') ;;
    '-m venv '*)
        mkdir -p .venv/bin && cp "$0" .venv/bin/python
        echo "$VERSION" >.venv/version
        [ -z "${UV:-}" ] || { echo >.venv/bin/uv && chmod +x .venv/bin/uv; }
        echo venv >>"$TREE/log" ;;
    '-m pip --version') ;;
    *install*)
        echo "$*" >>"$TREE/log"
        case "$*" in *"${FAIL:-nothing}"*) echo "$SAY"; [ -z "${SIGNAL:-}" ] || kill -KILL $PPID $$; exit 1 ;; esac ;;
    *) echo "unexpected: $*" >&2; exit 9 ;;
esac
"""


class Tree:
    """A copy of what set-up reads, and its runs with the stand-in."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "tools").mkdir(parents=True)
        for name in ("setup", "constraints.txt", "pyproject.toml"):
            shutil.copy(ROOT / "tools" / name, folder / "tools" / name)
        for version in ("3.11", "3.12"):
            python = folder / f"python{version}"
            python.write_text(STAND_IN)
            python.chmod(0o755)

    def run(self, version: str = "3.11", **more: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"TREE": str(self.folder), "VERSION": version} | more
        environment["PYTHON"] = str(self.folder / f"python{version}")
        command = ["sh", str(self.folder / "tools/setup"), "demo"]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    def taken(self) -> list[str]:
        """Return what has been asked of venv and pip since the last call."""
        log = self.folder / "log"
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        return lines


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    """Make a tree in which nothing has been set up."""
    return Tree(tmp_path / "tree")


def last(done: subprocess.CompletedProcess[str]) -> str:
    return done.stderr.splitlines()[-1]


def test_locked_packages_are_installed_by_hash_and_once(tree: Tree) -> None:
    """pip first, then the packages, wheels only and by hash, then the repository itself; a second run does nothing."""
    assert tree.run().returncode == 0
    made, pip, packages, own = tree.taken()
    assert made == "venv" and "--no-deps --editable ./tools" in own
    assert "--require-hashes --only-binary :all:" in pip and "--require-hashes --only-binary :all:" in packages
    names = {line.split("==")[0] for line in (tree.folder / "build/locked.txt").read_text().splitlines()}
    assert {"numpy", "asammdf", "scikit-build-core"} <= names and not names & {"pytest", "sphinx", "pip"}
    assert tree.run().returncode == 0 and tree.taken() == []


def test_uv_installs_what_is_locked_and_pip_what_uv_cannot(tree: Tree) -> None:
    """Where uv is there, pip is not asked for packages; where uv fails, pip is, and the environment is kept."""
    assert tree.run(UV="1").returncode == 0
    made, *packages, own = tree.taken()
    assert made == "venv" and all("supply/install.py build/locked.txt" in line for line in packages)
    assert "-m pip" in own and "--editable ./tools" in own
    shutil.rmtree(tree.folder / ".venv")
    assert tree.run(UV="1", FAIL="supply/install.py", SAY="").returncode == 0
    lines = tree.taken()
    assert (
        sum("--require-hashes --only-binary :all:" in line for line in lines) == 2 == sum("supply" in x for x in lines)
    )


def test_an_end_of_uv_by_a_signal_is_not_taken_for_an_answer(tree: Tree) -> None:
    """What it left is not trusted: the next run makes the environment anew."""
    assert tree.run(UV="1", FAIL="supply/install.py", SAY="", SIGNAL="1").returncode < 0
    tree.taken()
    done = tree.run(UV="1")
    assert done.returncode == 0 and "interrupted" in done.stderr and tree.taken()[0] == "venv"


def test_a_folder_that_becomes_a_package_is_installed(tree: Tree) -> None:
    """An editable installation lists modules by their files; a package of a former module's name is not found by it."""
    assert tree.run().returncode == 0 and tree.taken()
    (tree.folder / "tools/src/aeolid/baseline").mkdir(parents=True)
    (tree.folder / "tools/src/aeolid/baseline/__init__.py").touch()
    assert tree.run().returncode == 0 and "--editable ./tools" in tree.taken()[-1]
    assert tree.run().returncode == 0 and tree.taken() == []


@pytest.mark.parametrize(
    ("version", "more"), [("3.12", {}), ("3.11", {"PLATFORM": "linux-aarch64"}), ("3.11", {"AEOLID_UNLOCKED": "1"})]
)
def test_elsewhere_the_ranges_are_taken_and_it_is_said(version: str, more: dict[str, str], tree: Tree) -> None:
    """Another Python or platform has no tested files; nothing is refused."""
    done = tree.run(version, **more)
    assert done.returncode == 0 and "no tested versions for this Python and platform" in done.stderr
    assert not any("--require-hashes" in line for line in tree.taken())


@pytest.mark.parametrize(
    ("says", "told"),
    [
        ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "not the tested file"),
        ("ERROR: Could not install packages due to an OSError: No space left on device", "the disk is full"),
        ("WARNING: Retrying after connection broken by 'NewConnectionError'", "check the network and pip's settings"),
        ("ERROR: No matching distribution found for numpy==2.4.6", "check the network and pip's settings"),
        ("error: something else", "pip could not install"),
    ],
)
def test_a_failure_of_pip_is_one_sentence_with_the_remedy(says: str, told: str, tree: Tree) -> None:
    """Exit code 1; what pip did in full stands in build/pip.log, and the next run goes on in the same environment."""
    done = tree.run(FAIL="locked.txt", SAY=says)
    assert done.returncode == 1 and told in last(done) and "Traceback" not in done.stderr
    assert says in (tree.folder / "build/pip.log").read_text()
    tree.taken()
    assert tree.run().returncode == 0 and "venv" not in tree.taken()


def test_a_tree_that_cannot_be_written_to(tree: Tree) -> None:
    """For root every folder is writable, so a file stands where the folder build should be."""
    (tree.folder / "build").touch()
    done = tree.run()
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1
    assert "cannot be written to" in done.stderr and "copy the repository to a folder of your own" in done.stderr
    assert tree.taken() == [] and not (tree.folder / ".venv").exists()


def test_an_environment_that_was_interrupted_is_made_anew(tree: Tree) -> None:
    """Set-up and pip are killed in the middle of an installation: what pip left cannot be trusted."""
    assert tree.run(FAIL="locked.txt", SAY="", SIGNAL="1").returncode < 0
    tree.taken()
    done = tree.run()
    assert done.returncode == 0 and "interrupted" in done.stderr and tree.taken()[0] == "venv"


@pytest.mark.parametrize(
    ("harm", "told"),
    [
        (lambda venv: (venv / "bin/python").unlink(), "lost its Python"),
        (lambda venv: (venv / "bin/python").write_text("#!/nowhere/python\n"), "lost its Python"),
        (lambda venv: (venv / ".home").unlink(), "not finished, or made elsewhere"),
        (lambda venv: (venv / ".home").write_text("/elsewhere\n"), "not finished, or made elsewhere"),
        (lambda venv: (venv / "version").write_text("3.9\n"), "of Python 3.9"),
    ],
    ids=["python is gone", "its base is gone", "half made", "moved", "another Python"],
)
def test_an_environment_that_cannot_be_used_is_made_anew(harm: object, told: str, tree: Tree) -> None:
    """Whatever has happened to .venv, the next run says what and mends it."""
    assert tree.run().returncode == 0
    tree.taken()
    assert callable(harm)
    harm(tree.folder / ".venv")
    done = tree.run()
    assert done.returncode == 0 and told in done.stderr and tree.taken()[0] == "venv"
    assert tree.run().returncode == 0 and tree.taken() == []


def test_another_python_asked_for_replaces_the_environment(tree: Tree) -> None:
    """PYTHON names one of another version: said, and made anew."""
    assert tree.run().returncode == 0
    tree.taken()
    done = tree.run("3.12")
    assert done.returncode == 0 and "the one here is of Python 3.11" in done.stderr and tree.taken()[0] == "venv"


def test_usage(tree: Tree) -> None:
    """A wrong word is wrong usage."""
    done = subprocess.run(["sh", str(tree.folder / "tools/setup"), "all"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "usage" in done.stderr
