"""What all Python tests share: threads, marks, the order and the workers they run on, a limit, and their answers."""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from functools import wraps
from pathlib import Path
from typing import Any

import pytest
from processes_left import processes_left, starting, watch_processes
from processor_limit import processor_limit

import aeolid  # noqa: F401 — chooses the instructions of numpy and OpenBLAS, which read them as they are loaded

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    # On small matrices a second thread only waits, and tests run side by side.
    os.environ.setdefault(variable, "1")

MARKS = {  # the longest first, so that no worker waits for another at the end
    "nightly": "more of what another test shows already; `sh tests/run nightly` alone runs it",
    "diagnosis": "makes whole diagnoses, seconds to minutes of processor each; not in `sh tests/run quick`",
    "slow": "takes some ten seconds of processor or more; not in `sh tests/run quick`",
}
MOST_PROCESSOR_S = 1200.0  # of the process that runs a test; the longest takes a tenth of it
VERY_SLOW_S = 50.0  # a file of one piece that takes as long goes before everything: a guest that boots


ANSWERS = os.environ.get("AEOLID_ANSWERS")  # a folder; tests/studies/rounding.py asks for them
told: list[dict[str, Any]] = []  # by diagnoses in this process, since the test began


def pytest_configure(config: pytest.Config) -> None:
    """Make the marks known, and hear what is diagnosed where somebody wants to know."""
    for name, meaning in MARKS.items():
        config.addinivalue_line("markers", f"{name}: {meaning}")
    watch_processes()
    if ANSWERS:
        from aeolid.diagnose.conclusion import verdict

        diagnose = verdict.diagnose

        @wraps(diagnose)
        def heard(*arguments: Any, **options: Any) -> dict[str, Any]:
            told.append(diagnose(*arguments, **options))
            return told[-1]

        verdict.diagnose = heard  # before any test imports it


def slow_tests() -> dict[str, float]:
    """Return the tests, without their parameters, and the files that tests/slow.txt lists, with their seconds."""
    lines = (Path(__file__).parent / "slow.txt").read_text(encoding="utf-8").splitlines()
    return {line.split()[0]: float(line.split()[1]) for line in lines if line and not line.startswith("#")}


def night_tests() -> set[str]:
    """Return the tests, with their parameters, that tests/night.txt leaves to the night."""
    lines = (Path(__file__).parent / "night.txt").read_text(encoding="utf-8").splitlines()
    return {line.split(" | ")[0].strip() for line in lines if line and not line.startswith("#")}


def _require_known(night: set[str], collected: set[str], asked: list[str]) -> None:
    """Refuse a list that names tests which are not there; as far as whole files were asked for."""
    files = {name.split("::")[0] for name in collected}
    unknown = sorted(name for name in night - collected if name.split("::")[0] in files)
    if unknown and not any("::" in word for word in asked):
        raise pytest.UsageError(f"tests/night.txt names tests that are not there: {', '.join(unknown)}")


@pytest.hookimpl(tryfirst=True)  # before -m chooses by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is slow or for the night and put the longest tests first; nothing else changes its place."""
    slow, night = slow_tests(), night_tests()
    _require_known(night, {item.nodeid for item in items}, config.args)
    for item in items:
        if item.nodeid in night:
            item.add_marker("nightly")
        if slow.keys() & {item.nodeid.split("[")[0], item.nodeid.split("::")[0]}:
            item.add_marker("slow")

    def place(item: pytest.Item) -> tuple[bool, int]:
        mark = next((k for k, m in enumerate(MARKS) if item.get_closest_marker(m)), len(MARKS))
        return slow.get(item.nodeid.split("::")[0], 0.0) < VERY_SLOW_S, mark

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give tests to whichever worker is free, in the order above."""
    from free_worker import FreeWorker

    config.option.loadscopereorder = False
    return FreeWorker(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Generator[None, Any, Any]:
    """Limit what fixtures take; in processor time, which no other load on the machine uses up."""
    with processor_limit(MOST_PROCESSOR_S):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, Any, Any]:
    """Limit what a test takes."""
    with processor_limit(MOST_PROCESSOR_S), starting():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Generator[None, Any, Any]:
    """Fail a test that leaves a process behind, once its fixtures are torn down."""
    result = yield
    wrong = processes_left()
    assert not wrong, "\n".join(wrong)
    return result


@pytest.fixture(autouse=True)
def _answers_are_kept(request: pytest.FixtureRequest) -> Generator[None]:
    """Write down what every diagnosis of the test says, in this process or in a diagnosis.json of another."""
    if not ANSWERS:
        yield
        return
    base = request.getfixturevalue("tmp_path_factory").getbasetemp()
    before = set(base.rglob("diagnosis.json"))
    yield
    answers = {f"diagnosis {k + 1}": found for k, found in enumerate(told)}
    for file in sorted(set(base.rglob("diagnosis.json")) - before):
        answers[str(file.relative_to(base))] = json.loads(file.read_text(encoding="utf-8"))
    told.clear()
    Path(ANSWERS).mkdir(parents=True, exist_ok=True)
    with open(Path(ANSWERS) / f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.jsonl", "a", encoding="utf-8") as out:
        for name, found in answers.items():
            out.write(json.dumps({"test": f"{request.node.nodeid} {name}", "diagnosis": found}, default=str) + "\n")
