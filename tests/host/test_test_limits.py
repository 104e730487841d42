"""The tests' own command: what hangs is ended by processor time, and the list of slow tests names tests."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from processor_limit import processor_limit


def test_a_loop_without_an_end_is_ended() -> None:
    with pytest.raises(pytest.fail.Exception, match="processor time"), processor_limit(0.05):
        while True:
            pass
    assert signal.getitimer(signal.ITIMER_PROF)[0] == 0.0


def test_waiting_is_no_processor_time() -> None:
    """As a test waits whose machine is busy with others."""
    with processor_limit(0.2):
        time.sleep(0.5)


ROOT = Path(__file__).resolve().parents[2]


def test_the_list_of_slow_tests_names_tests() -> None:
    lines = (ROOT / "tests" / "slow.txt").read_text().splitlines()
    names = [line.split()[0].split("::") for line in lines if not line.startswith("#")]
    assert len(names) > 50
    for file, *functions in names:
        assert (ROOT / file).is_file()
        for function in functions:
            assert re.search(rf"^def {function}\(", (ROOT / file).read_text(), re.M), f"{file} has no {function}"


def test_a_list_for_the_night_that_names_no_test_is_refused(tmp_path: Path) -> None:
    """Else a test whose parameters changed would run by day again, and nobody would notice."""
    for name in ("conftest.py", "processes_left.py", "processor_limit.py", "slow.txt"):
        shutil.copy(ROOT / "tests" / name, tmp_path)
    (tmp_path / "test_one.py").write_text("def test_it():\n    pass\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", ".", "test_one.py"]
    for line, code, words in (
        ("test_one.py::test_it | nothing", 0, "1 passed"),
        ("test_one.py::test_it[a] | nothing", 4, "names tests that are not there: test_one.py::test_it[a]"),
    ):
        (tmp_path / "night.txt").write_text(f"# a list\n{line}\n")
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == code and words in done.stdout + done.stderr


CRASHING = """
import os, signal, pytest

@pytest.mark.parametrize("k", range(12))
def test_alone(k):
    if k in {crashing}:
        os.kill(os.getpid(), signal.SIGSEGV)
"""
TOGETHER = """
import os, signal, pytest

@pytest.fixture(scope="module")
def prepared():
    return 1

@pytest.mark.parametrize("k", range(6))
def test_together(prepared, k):
    if k == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.mark.parametrize("crashing", [{0}, {5}, {10}, {11}, {3, 4, 11}])
def test_a_worker_that_dies_fails_its_test_alone(tmp_path: Path, crashing: set[int]) -> None:
    """Wherever in the run: the others' tests run all, once, and the run ends."""
    for name in ("conftest.py", "free_worker.py", "processes_left.py", "processor_limit.py"):
        shutil.copy(ROOT / "tests" / name, tmp_path)
    for name in ("slow.txt", "night.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "test_alone.py").write_text(CRASHING.replace("{crashing}", str(crashing)))
    (tmp_path / "test_together.py").write_text(TOGETHER)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", ".", "-n", "2", "--dist"]
    done = subprocess.run([*command, "loadscope"], cwd=tmp_path, capture_output=True, text=True, check=False)
    failed = len(crashing) + 1
    assert done.returncode == 1 and f"{failed} failed, {18 - failed} passed" in done.stdout, done.stdout


def test_a_word_that_is_no_mode_is_wrong_usage() -> None:
    done = subprocess.run(["sh", "tests/run", "fast"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr == "usage: sh tests/run [quick|nightly]\n"
